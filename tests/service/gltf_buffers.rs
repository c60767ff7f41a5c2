//! A glTF and the files it refers to, in forms and in archives; and what reading it warns of.

use crate::harness::{App, multipart};
use crate::meshes::mesh;
use serde_json::{Value, json};
use std::io::{Cursor, Write};

fn zip_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        writer
            .start_file(*name, zip::write::SimpleFileOptions::default())
            .unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// The document as a GLB without a binary chunk.
fn glb(document: &[u8]) -> Vec<u8> {
    let mut json = document.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((20 + json.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes
}

/// Uploads and returns the companions of the first shape, by name.
async fn companions(app: &App, what: &str, media_type: &str, body: Vec<u8>) -> Vec<String> {
    let answer = app
        .post("/v1/classes/bean/shapes?create=true", media_type, body)
        .await;
    assert!(answer.status.is_success(), "{what}: {}", answer.text());
    let shape = answer.value()["shapes"][0].clone();
    assert_eq!(shape["report"]["vertices"], 548, "{what}: {shape}");
    let list = shape["companions"].as_array().unwrap().iter();
    list.map(|c| c["name"].as_str().unwrap().to_owned()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn buffers_are_found_under_every_spelling() {
    let app = App::new();
    let spellings = [
        ("./buffer.bin", "buffer.bin"),
        ("././buffer.bin", "buffer.bin"),
        (".\\\\buffer.bin", "buffer.bin"),
        ("my%20buffer.bin", "my buffer.bin"),
        ("m%C3%BCde.bin", "müde.bin"),
        ("müde.bin", "müde.bin"),
        ("C:\\\\models\\\\buffer.bin", "buffer.bin"),
        ("file:///home/me/buffer.bin", "buffer.bin"),
    ];
    for (uri, name) in spellings {
        let (document, buffer) = mesh("bean", 0).gltf(uri.replace("\\\\", "\\").as_str());
        let bom = [b"\xef\xbb\xbf", document.as_slice()].concat();
        let binary = glb(&document);
        let files: [(&str, &[u8]); 3] = [("a.gltf", &document), ("b.gltf", &bom), ("c.glb", &binary)];
        for (file, bytes) in files {
            let what = format!("{uri} in {file}");
            let (media_type, body) = multipart(&[(file, bytes), (name, &buffer)]);
            assert_eq!(companions(&app, &what, &media_type, body).await, [name], "{what}");
            let inside = format!("deep/{name}");
            let deep = format!("deep/{file}");
            let zip = zip_of(&[(&deep, bytes), (&inside, &buffer), (name, b"another")]);
            assert_eq!(
                companions(&app, &what, "application/zip", zip).await,
                [name],
                "{what}"
            );
        }
    }
    // Beside its folder, but inside the archive.
    let (document, buffer) = mesh("bean", 0).gltf("../buffers/x.bin");
    let zip = zip_of(&[("models/a.gltf", &document), ("buffers/x.bin", &buffer)]);
    companions(&app, "a folder beside it", "application/zip", zip).await;

    let (document, _) = mesh("bean", 0).gltf("../../secret.bin");
    let zip = zip_of(&[("models/a.gltf", &document), ("models/other.bin", b"x")]);
    let answer = app.post("/v1/query", "application/zip", zip.clone()).await;
    assert!(answer.status.is_client_error());
    let answer = app.post("/v1/classes/bean/shapes", "application/zip", zip).await;
    let problem = answer.fails(422, "missing_buffer");
    assert_eq!(problem["uri"], "../../secret.bin");
    assert!(
        problem["detail"]
            .as_str()
            .unwrap()
            .contains("same multipart request")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn one_file_under_many_names_is_kept_once() {
    let app = App::new();
    let (document, buffer) = mesh("bean", 0).gltf("x.bin");
    let mut document: Value = serde_json::from_slice(&document).unwrap();
    let length = document["buffers"][0]["byteLength"].clone();
    document["buffers"] = ["./x.bin", "x.bin", "././x.bin", "%78.bin"]
        .map(|uri| json!({"byteLength": length, "uri": uri}))
        .to_vec()
        .into();
    document["bufferViews"][1]["buffer"] = json!(3);
    let (media_type, body) = multipart(&[("a.gltf", document.to_string().as_bytes()), ("x.bin", &buffer)]);
    assert_eq!(
        companions(&app, "four spellings", &media_type, body).await,
        ["x.bin"]
    );
    // What was stored is read again.
    let job = app.reindex(json!({"parameters": crate::harness::small()})).await;
    assert_eq!(job["result"]["failed_shapes"], json!([]), "{job}");
}

#[tokio::test(flavor = "multi_thread")]
async fn buffers_of_one_name_in_different_folders_are_told_apart() {
    let app = App::new();
    let (document, buffer) = mesh("bean", 0).gltf("positions/data.bin");
    let mut document: Value = serde_json::from_slice(&document).unwrap();
    let middle = document["bufferViews"][0]["byteLength"].as_u64().unwrap() as usize;
    let (positions, indices) = buffer.split_at(middle);
    document["buffers"] = json!([
        {"byteLength": positions.len(), "uri": "positions/data.bin"},
        {"byteLength": indices.len(), "uri": "./indices/data.bin"},
    ]);
    document["bufferViews"][1]["buffer"] = json!(1);
    document["bufferViews"][1]["byteOffset"] = json!(0);
    let document = document.to_string();
    for (mesh, folder) in [("a.gltf", ""), ("set/a.gltf", "set/"), ("a.gltf", "./")] {
        let first = format!("{folder}positions/data.bin");
        let second = format!("{folder}indices\\data.bin");
        let files: [(&str, &[u8]); 3] = [
            (&second, indices),
            (mesh, document.as_bytes()),
            (&first, positions),
        ];
        let (media_type, body) = multipart(&files);
        assert_eq!(
            companions(&app, folder, &media_type, body).await,
            ["indices/data.bin", "positions/data.bin"]
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn instances_are_warned_of() {
    let app = App::indexed().await;
    let glb = mesh("bean", 0).glb();
    let json = 20 + u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
    let mut document: Value = serde_json::from_slice(&glb[20..json]).unwrap();
    document["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}});
    document["buffers"][0]["uri"] = "x.bin".into();
    let text = document.to_string();
    let files: [(&str, &[u8]); 2] = [("a.gltf", text.as_bytes()), ("x.bin", &glb[json + 8..])];
    let (media_type, body) = multipart(&files);
    let answer = app.post("/v1/query", &media_type, body.clone()).await;
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert!(
        answer.text().contains("one copy of each was read"),
        "{}",
        answer.text()
    );
    let added = app.post("/v1/classes/bean/shapes", &media_type, body).await;
    let warnings = added.value()["shapes"][0]["report"]["warnings"].to_string();
    assert!(warnings.contains("one copy of each was read"), "{}", added.text());
}
