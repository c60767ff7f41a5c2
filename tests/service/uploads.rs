//! Every way to send meshes.

use crate::harness::{App, multipart};
use crate::meshes::{mesh, off};
use serde_json::json;
use std::io::{Cursor, Write};

pub fn zip_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        writer
            .start_file(*name, zip::write::SimpleFileOptions::default())
            .unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

pub fn tar_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut builder = tar::Builder::new(Vec::new());
    for (name, bytes) in files {
        let mut header = tar::Header::new_gnu();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        builder.append_data(&mut header, name, *bytes).unwrap();
    }
    builder.into_inner().unwrap()
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_format_is_read_raw_and_given_back_byte_for_byte() {
    let app = App::new();
    let bean = mesh("bean", 0);
    for (format, media_type, bytes) in [
        ("off", "application/octet-stream", bean.off()),
        ("obj", "text/plain", bean.obj()),
        ("ply", "application/x-www-form-urlencoded", bean.ply()),
        ("stl", "model/stl", bean.stl()),
        ("glb", "model/gltf-binary", bean.glb()),
    ] {
        let path = format!("/v1/classes/{format}/shapes?create=true&name=a%20b.{format}");
        let answer = app.post(&path, media_type, bytes.clone()).await;
        assert_eq!(answer.status, 201, "{format}: {}", answer.text());
        let shape = answer.value()["shapes"][0].clone();
        assert_eq!(shape["format"], format);
        assert_eq!(shape["report"]["vertices"], 548, "{shape}");
        let original = app.get(shape["original"].as_str().unwrap()).await;
        assert_eq!(original.body, bytes);
        assert_eq!(
            original.header("content-disposition"),
            format!("attachment; filename*=UTF-8''a%20b.{format}")
        );
        assert_eq!(
            original.header("etag"),
            format!("\"{}\"", shape["hash"].as_str().unwrap())
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn archives_and_forms_bring_many() {
    let app = App::new();
    let (a, b) = (off("bean", 0), mesh("bean", 1).obj());
    let files: &[(&str, &[u8])] = &[
        ("poses/a.off", &a),
        ("poses/b.obj", &b),
        ("poses/b.mtl", b"newmtl x"),
    ];
    for (class, media_type, body) in [
        ("zip", "application/zip", zip_of(files)),
        ("told-by-bytes", "application/octet-stream", zip_of(files)),
        ("tar", "application/x-tar", tar_of(files)),
        ("tgz", "application/gzip", gzip(&tar_of(files))),
    ] {
        let answer = app
            .post(
                &format!("/v1/classes/{class}/shapes?create=true"),
                media_type,
                body,
            )
            .await;
        assert_eq!(answer.status, 201, "{class}: {}", answer.text());
        let body = answer.value();
        assert_eq!(body["shapes"][0]["name"], "poses/a.off");
        assert_eq!(body["shapes"][1]["name"], "poses/b.obj");
        assert_eq!(body["ignored"], json!(["poses/b.mtl"]));
    }
    let (media_type, body) = multipart(&[
        ("a.off", &a),
        ("b.obj", &b),
        ("c.zip", &zip_of(&[("c.off", &off("bean", 2))])),
    ]);
    let answer = app
        .post("/v1/classes/form/shapes?create=true", &media_type, body)
        .await;
    assert_eq!(answer.status, 201, "{}", answer.text());
    assert_eq!(answer.value()["class"]["shapes"], 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gltf_finds_its_buffer_in_the_same_request() {
    let app = App::new();
    let (document, buffer) = mesh("bean", 0).gltf("my%20buffer.bin");
    let (media_type, body) = multipart(&[("bean.gltf", &document), ("my buffer.bin", &buffer)]);
    let answer = app
        .post("/v1/classes/bean/shapes?create=true", &media_type, body)
        .await;
    assert_eq!(answer.status, 201, "{}", answer.text());
    assert_eq!(
        answer.value()["shapes"][0]["companions"]
            .as_array()
            .unwrap()
            .len(),
        1
    );

    let (other, other_buffer) = mesh("bean", 1).gltf("b.bin");
    let zip = zip_of(&[
        ("one/x.gltf", &other),
        ("one/b.bin", &other_buffer),
        ("two/b.bin", b"wrong one"),
    ]);
    let answer = app.post("/v1/classes/bean/shapes", "application/zip", zip).await;
    assert_eq!(answer.status, 201, "{}", answer.text());

    let alone = app
        .post("/v1/classes/bean/shapes", "model/gltf+json", document)
        .await;
    assert_eq!(alone.fails(422, "missing_buffer")["uri"], "my%20buffer.bin");

    // What was stored with its buffer can be learnt.
    let job = app.reindex(json!({"parameters": crate::harness::small()})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    assert_eq!(job["result"]["failed_shapes"], json!([]), "{job}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_is_stored_whole_or_not_at_all() {
    let app = App::new();
    let good = off("bean", 0);
    let (media_type, body) = multipart(&[
        ("good.off", &good),
        ("cut.off", &good[..200]),
        ("text.obj", b"hello"),
    ]);
    let answer = app
        .post("/v1/classes/bean/shapes?create=true", &media_type, body)
        .await;
    let problem = answer.fails(422, "upload_rejected");
    assert_eq!(problem["failed"], 2);
    assert_eq!(problem["total"], 3);
    assert_eq!(problem["failures"][0]["name"], "cut.off");
    assert_eq!(problem["failures"][0]["code"], "truncated_mesh");
    assert_eq!(problem["failures"][1]["name"], "text.obj");
    app.get("/v1/classes/bean").await.fails(404, "class_not_found");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_bytes_are_the_same_shape() {
    let app = App::new();
    let path = "/v1/classes/bean/shapes?create=true";
    let first = app.post(path, "model/off", off("bean", 0)).await;
    assert_eq!(first.status, 201);
    let again = app.post(path, "model/off", off("bean", 0)).await;
    assert_eq!(again.status, 200);
    assert_eq!(again.value()["shapes"][0]["existing"], true);
    assert_eq!(again.value()["shapes"][0]["id"], first.value()["shapes"][0]["id"]);
    assert_eq!(again.value()["class"]["shapes"], 1);
}
