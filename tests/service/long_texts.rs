//! Texts of files and requests that are long: they are not repeated in answers, labels and records, and what is kept of
//! many is counted.

use crate::harness::{App, multipart, small};
use crate::meshes;
use axum::body::Body;
use axum::http::Request;
use futures_util::StreamExt;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// A tetrahedron that moves, with a clip of this name and more buffers, none of which is needed.
fn animated(clip: &str, more: &[String]) -> Vec<u8> {
    use base64::Engine;
    let floats = |numbers: &[f32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let corners = floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.]);
    let faces: Vec<u8> = [0_u16, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
        .iter()
        .flat_map(|n| n.to_le_bytes())
        .collect();
    let moments = floats(&[0., 1.]);
    let places = floats(&[0., 0., 0., 1., 1., 1.]);
    let parts = [corners, faces, moments, places];
    let mut views = Vec::new();
    let mut at = 0;
    for part in &parts {
        views.push(json!({"buffer": 0, "byteOffset": at, "byteLength": part.len()}));
        at += part.len();
    }
    let data = base64::engine::general_purpose::STANDARD.encode(parts.concat());
    let mut buffers =
        vec![json!({"byteLength": at, "uri": format!("data:application/octet-stream;base64,{data}")})];
    buffers.extend(more.iter().map(|uri| json!({"byteLength": 1, "uri": uri})));
    json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 2, "type": "SCALAR"},
            {"bufferView": 3, "componentType": 5126, "count": 2, "type": "VEC3"},
        ],
        "bufferViews": views,
        "buffers": buffers,
        "animations": [{
            "name": clip,
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
            "samplers": [{"input": 2, "output": 3}],
        }],
    })
    .to_string()
    .into_bytes()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_label_of_a_pose_is_no_longer_than_people_read() {
    let app = App::new();
    let answer = app
        .post(
            "/v1/classes/bean/shapes?create=true&poses=64",
            "model/gltf+json",
            animated(&"n".repeat(1 << 20), &[]),
        )
        .await;
    assert_eq!(answer.status, 201, "{:.300}", answer.text());
    let shapes = answer.value()["shapes"].as_array().unwrap().clone();
    assert_eq!(shapes.len(), 64);
    assert!(answer.body.len() < 200_000, "{}", answer.body.len());
    let label = shapes[0]["pose"]["label"].as_str().unwrap();
    assert!(label.starts_with("nnn") && label.ends_with("…@0.01"), "{label}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_problem_repeats_only_the_beginning_of_a_text() {
    let app = App::new();
    let long = "\u{7f}".repeat(1 << 20);
    let accessor = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "accessors": [{"count": long}],
    });
    for (document, code) in [
        (accessor, "malformed_mesh"),
        (
            json!({"asset": {"version": "2.0"}, "scene": long}),
            "malformed_mesh",
        ),
        (
            json!({"asset": {"version": "2.0"}, "nodes": long}),
            "malformed_mesh",
        ),
        (
            json!({"asset": {"version": "2.0"}, "extensionsRequired": [long]}),
            "unsupported_feature",
        ),
        (
            json!({"asset": {"version": "2.0"}, "extensionsRequired": long}),
            "malformed_mesh",
        ),
    ] {
        let answer = app
            .post(
                "/v1/classes/bean/shapes?create=true",
                "model/gltf+json",
                document.to_string(),
            )
            .await;
        assert!(answer.body.len() < 4000, "{code}: {} bytes", answer.body.len());
        answer.fails(422, code);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_names_of_buffers_are_bounded_together() {
    let app = App::new();
    let uris: Vec<String> = (0..100)
        .map(|i| format!("{}{i}/x.bin", "folder".repeat(200)))
        .collect();
    let (media_type, body) = multipart(&[("a.gltf", &animated("clip", &uris)), ("x.bin", b"x")]);
    let refused = app
        .post("/v1/classes/bean/shapes?create=true&poses=64", &media_type, body)
        .await
        .fails(413, "mesh_too_large");
    assert_eq!(refused["limit"], 65_536, "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn many_buffers_are_found_among_many_files_in_time() {
    let app = App::new();
    let uris: Vec<String> = (0..50_000).map(|i| format!("a/b{i}/c.bin")).collect();
    let document = animated("clip", &uris);
    let names: Vec<String> = (0..2000).map(|i| format!("d{i}.bin")).collect();
    let mut files: Vec<(&str, &[u8])> = vec![("a.gltf", &document)];
    files.extend(names.iter().map(|name| (name.as_str(), &b"x"[..])));
    let (media_type, body) = multipart(&files);
    let began = Instant::now();
    let answer = app
        .post("/v1/classes/bean/shapes?create=true", &media_type, body)
        .await;
    assert_eq!(answer.status, 201, "{:.300}", answer.text());
    assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_long_shapes_is_short_and_the_pages_have_all() {
    let app = App::new();
    let uris: Vec<String> = (0..50)
        .map(|i| format!("{}{i}/x.bin", "folder".repeat(200)))
        .collect();
    let (media_type, body) = multipart(&[("a.gltf", &animated("clip", &uris)), ("x.bin", b"x")]);
    let added = app
        .post("/v1/classes/bean/shapes?create=true&poses=64", &media_type, body)
        .await;
    assert_eq!(added.status, 201, "{:.300}", added.text());
    let (mut seen, mut cursor, mut pages) = (0, String::new(), 0);
    loop {
        let page = app
            .get(&format!("/v1/classes/bean/shapes?limit=1000{cursor}"))
            .await;
        assert!(page.body.len() < 2 << 20, "{}", page.body.len());
        let page = page.value();
        seen += page["items"].as_array().unwrap().len();
        pages += 1;
        match page["next_cursor"].as_str() {
            Some(next) => cursor = format!("&cursor={next}"),
            None => break,
        }
    }
    assert_eq!(seen, 64);
    assert!(pages > 2, "{pages}");
    assert_eq!(app.state.memory.used(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reindex_names_a_bounded_number_of_classes() {
    let app = App::new();
    let classes: Vec<Value> = (0..1001).map(|i| i.to_string().into()).collect();
    let refused = app
        .json("POST", "/v1/reindex", json!({"scope": {"classes": classes}}))
        .await
        .fails(422, "invalid_field");
    assert_eq!(refused["limit"], 1000, "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn lines_of_a_batch_count_until_their_client_takes_them() {
    let app = App::indexed().await;
    let mut parameters = small();
    parameters["samples_per_shape"] = 0.into();
    let job = app
        .reindex(json!({"scope": "all", "parameters": parameters}))
        .await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let meshes: Vec<Vec<u8>> = (0..3).map(|pose| meshes::off("bean", pose)).collect();
    let (media_type, body) = multipart(&[
        ("a.off", &meshes[0]),
        ("b.off", &meshes[1]),
        ("c.off", &meshes[2]),
    ]);
    let request = Request::post("/v1/query/batch?details=samples")
        .header("host", "localhost")
        .header("content-type", media_type)
        .body(Body::from(body))
        .unwrap();
    let response = tower::ServiceExt::oneshot(app.router.clone(), request)
        .await
        .unwrap();
    let mut lines = response.into_body().into_data_stream();
    let first = lines.next().await.unwrap().unwrap();
    assert!(first.len() > 100_000, "{}", first.len());
    assert!(app.state.memory.used() >= first.len() as u64);
    while lines.next().await.is_some() {}
    drop(lines);
    assert_eq!(app.state.memory.used(), 0);
}
