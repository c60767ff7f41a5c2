//! Everything that can be wrong with a request has its own problem, and the service goes on.

use crate::harness::{App, multipart};
use crate::meshes::{dense, mesh, off};
use axum::body::Body;
use axum::http::Request;
use serde_json::json;

/// What is sent, as what, and the status and code it is answered with.
fn cases() -> Vec<(&'static str, &'static str, Vec<u8>, u16, &'static str)> {
    let bean = mesh("bean", 0);
    let text = |s: &str| s.as_bytes().to_vec();
    let cut = |bytes: Vec<u8>| bytes[..bytes.len() * 2 / 3].to_vec();
    let huge_stl = {
        let mut bytes = vec![b' '; 80];
        bytes.extend(50_000_000u32.to_le_bytes());
        bytes.extend([0u8; 500]);
        bytes
    };
    let huge_ply = text(
        "ply\nformat binary_little_endian 1.0\nelement vertex 90000000\nproperty float x\nproperty float y\n\
         property float z\nelement face 90000000\nproperty list uchar int vertex_indices\nend_header\n",
    );
    vec![
        ("empty body", "model/off", vec![], 400, "empty_body"),
        (
            "no format",
            "application/octet-stream",
            text("hello there"),
            415,
            "unknown_format",
        ),
        (
            "text as GLB",
            "model/gltf-binary",
            text("hello there"),
            422,
            "malformed_mesh",
        ),
        ("cut OFF", "model/off", cut(bean.off()), 422, "truncated_mesh"),
        ("cut PLY", "model/ply", cut(bean.ply()), 422, "truncated_mesh"),
        ("cut STL", "model/stl", cut(bean.stl()), 422, "truncated_mesh"),
        (
            "cut GLB",
            "model/gltf-binary",
            cut(bean.glb()),
            422,
            "truncated_mesh",
        ),
        (
            "index out of range",
            "model/off",
            text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"),
            422,
            "index_out_of_range",
        ),
        (
            "index out of range in OBJ",
            "model/obj",
            text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
            422,
            "index_out_of_range",
        ),
        (
            "NaN",
            "model/obj",
            text("v nan 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 3 4\n"),
            422,
            "not_finite",
        ),
        (
            "infinity",
            "model/obj",
            text("v inf 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 3 4\n"),
            422,
            "not_finite",
        ),
        (
            "one triangle",
            "model/off",
            text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
            422,
            "mesh_too_small",
        ),
        (
            "all degenerate",
            "model/off",
            text("OFF\n4 2 0\n0 0 0\n1 0 0\n2 0 0\n3 0 0\n3 0 1 2\n3 1 2 3\n"),
            422,
            "degenerate_mesh",
        ),
        (
            "points only",
            "model/off",
            text("OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n"),
            422,
            "no_faces",
        ),
        (
            "promises too many triangles",
            "model/stl",
            huge_stl,
            413,
            "mesh_too_large",
        ),
        (
            "promises too many vertices",
            "model/ply",
            huge_ply,
            413,
            "mesh_too_large",
        ),
        (
            "wrong content type",
            "text/html",
            bean.off(),
            415,
            "unsupported_media_type",
        ),
        (
            "JSON content type",
            "application/json",
            bean.off(),
            415,
            "unsupported_media_type",
        ),
        (
            "no archive",
            "application/zip",
            bean.off(),
            422,
            "invalid_archive",
        ),
        (
            "needs an extension that we do not read",
            "model/gltf+json",
            text(
                r#"{"asset":{"version":"2.0"},"extensionsRequired":["EXT_mesh_primitive_restart"],"extensionsUsed":["EXT_mesh_primitive_restart"],"scenes":[{"nodes":[]}],"scene":0}"#,
            ),
            422,
            "unsupported_feature",
        ),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_meshes_have_their_own_problems_in_uploads_and_queries() {
    let app = App::indexed().await;
    let before = app.get("/v1/classes/bean").await.value();
    let mut wrong = Vec::new();
    for (what, media_type, body, status, code) in cases() {
        for path in ["/v1/query", "/v1/classes/bean/shapes"] {
            let found = app.post(path, media_type, body.clone()).await.problem();
            if found != (status, code.to_owned()) {
                wrong.push(format!("{what} at {path}: {found:?}, expected {status} {code}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // Nothing was stored, and the service still answers.
    assert_eq!(app.get("/v1/classes/bean").await.value(), before);
    let answer = app.post("/v1/query", "model/off", off("bean", 4)).await.value();
    assert_eq!(answer["classes"][0]["class"]["name"], "bean");
}

/// Where a body is received without an index.
const UPLOAD: &str = "/v1/classes/bean/shapes?create=true";

#[tokio::test(flavor = "multi_thread")]
async fn a_body_over_the_limit_is_refused_however_it_is_sent() {
    let app = App::with(|c| c.max_body_bytes = 10_000);
    let long = vec![b'x'; 10_001];
    let raw = app.post(UPLOAD, "model/off", long.clone()).await;
    assert_eq!(raw.fails(413, "body_too_large")["limit_bytes"], 10_000);
    let declared = Request::post(UPLOAD)
        .header("content-type", "model/off")
        .header("content-length", "99999999999")
        .body(Body::empty())
        .unwrap();
    app.send(declared).await.fails(413, "body_too_large");
    let chunks = futures_util::stream::iter((0..20).map(|_| Ok::<_, std::io::Error>(vec![b'x'; 1000])));
    let chunked = app.post(UPLOAD, "model/off", Body::from_stream(chunks)).await;
    chunked.fails(413, "body_too_large");
    let (media_type, body) = multipart(&[("a.off", &long)]);
    let form = app.post(UPLOAD, &media_type, body).await;
    assert_eq!(form.fails(413, "body_too_large")["limit_bytes"], 10_000);
    let json = format!("{{\"name\": \"{}\"}}", "x".repeat(300_000));
    let json = app.post("/v1/classes", "application/json", json).await;
    json.fails(413, "body_too_large");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_over_the_limit_is_refused_with_the_numbers() {
    let app = App::with(|c| c.limits.max_vertices = 100);
    let answer = app
        .post("/v1/classes/bean/shapes?create=true", "model/off", off("bean", 0))
        .await;
    let problem = answer.fails(413, "mesh_too_large");
    assert_eq!(problem["limit"], 100);
    assert_eq!(problem["what"], "vertices");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_never_ends_is_given_up() {
    let app = App::with(|c| c.upload_timeout = std::time::Duration::from_millis(50));
    let stalled = futures_util::stream::pending::<Result<Vec<u8>, std::io::Error>>();
    let answer = app.post(UPLOAD, "model/off", Body::from_stream(stalled)).await;
    answer.fails(408, "request_timeout");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_unknown_is_said_to_be() {
    let app = App::new();
    app.post("/v1/classes/unicorn/shapes", "model/off", off("bean", 0))
        .await
        .fails(404, "class_not_found");
    app.post("/v1/query", "model/off", off("bean", 0))
        .await
        .fails(409, "index_empty");
    app.json("POST", "/v1/reindex", json!({}))
        .await
        .fails(409, "nothing_to_index");
    app.get("/v1/jobs/7").await.fails(404, "job_not_found");
    app.get("/v1/jobs/7/events").await.fails(404, "job_not_found");
    app.get("/v2/classes").await.fails(404, "route_not_found");
    app.get("/v1/classes/").await.fails(404, "route_not_found");
    app.get("/v1/classes/%FF").await.problem();
    app.call("PUT", "/v1/classes", None, Body::empty())
        .await
        .fails(405, "method_not_allowed");
    app.json("POST", "/v1/reindex", json!({"scope": {"classes": ["unicorn"]}}))
        .await
        .fails(404, "class_not_found");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_class_without_a_dictionary_is_named_and_not_answered() {
    let app = App::indexed().await;
    app.post(
        "/v1/classes/newcomer/shapes?create=true",
        "model/off",
        off("star", 6),
    )
    .await;
    assert_eq!(
        app.get("/v1/index").await.value()["not_indexed"],
        json!(["newcomer"])
    );
    let answer = app.post("/v1/query", "model/off", off("star", 6)).await.value();
    assert_eq!(answer["classes"].as_array().unwrap().len(), 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn json_bodies_are_checked_to_the_last_field() {
    let app = App::new();
    for (path, body, status, code) in [
        ("/v1/classes", "{", 400, "invalid_json"),
        ("/v1/classes", "", 400, "invalid_json"),
        ("/v1/classes", "{}", 422, "invalid_field"),
        ("/v1/classes", r#"{"name": 5}"#, 422, "invalid_field"),
        (
            "/v1/classes",
            r#"{"name": "x", "colour": "red"}"#,
            422,
            "invalid_field",
        ),
        ("/v1/classes", r#"{"name": "a\u0000b"}"#, 422, "invalid_name"),
        ("/v1/reindex", r#"{"scope": "everything"}"#, 422, "invalid_field"),
        (
            "/v1/reindex",
            r#"{"scope": {"classes": []}}"#,
            422,
            "invalid_field",
        ),
        ("/v1/reindex", r#"{"preset": "best"}"#, 422, "invalid_field"),
        (
            "/v1/reindex",
            r#"{"parameters": {"atom": 5}}"#,
            422,
            "invalid_field",
        ),
        (
            "/v1/reindex",
            r#"{"parameters": {"atoms": 0}}"#,
            422,
            "invalid_parameter",
        ),
        (
            "/v1/reindex",
            r#"{"parameters": {"lambda": -1}}"#,
            422,
            "invalid_parameter",
        ),
        (
            "/v1/reindex",
            r#"{"parameters": {"hypotheses": ["whitened"]}}"#,
            422,
            "invalid_parameter",
        ),
        ("/v1/reindex", "[]", 422, "invalid_field"),
        ("/v1/reindex", r#"{"parameters": []}"#, 422, "invalid_field"),
    ] {
        let answer = app.post(path, "application/json", body).await;
        assert_eq!(
            answer.problem(),
            (status, code.to_owned()),
            "{path} {body}: {}",
            answer.text()
        );
    }
    app.post("/v1/classes", "text/plain", "{\"name\": \"x\"}")
        .await
        .fails(415, "unsupported_media_type");
    for query in ["top=0", "top=-1", "top=x", "rank_by=luck", "colour=red"] {
        let answer = app
            .post(&format!("/v1/query?{query}"), "model/off", off("bean", 0))
            .await;
        answer.fails(400, "invalid_query");
    }
    for query in ["poses=0", "poses=65", "poses=x", "create=perhaps"] {
        let path = format!("/v1/classes/bean/shapes?{query}");
        app.post(&path, "model/off", off("bean", 0))
            .await
            .fails(400, "invalid_query");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn forms_without_a_mesh_or_with_two_are_told_so() {
    let app = App::indexed().await;
    let (media_type, body) = multipart(&[]);
    app.post("/v1/query", &media_type, body)
        .await
        .fails(400, "no_files");
    let (media_type, body) = multipart(&[("a.mtl", b"newmtl x")]);
    let none = app
        .post("/v1/query", &media_type, body)
        .await
        .fails(400, "no_files");
    assert_eq!(none["ignored"], json!(["a.mtl"]));
    let bean = off("bean", 0);
    let (media_type, body) = multipart(&[("a.off", &bean), ("b.off", &bean)]);
    let two = app.post("/v1/query", &media_type, body).await;
    assert_eq!(two.fails(400, "one_mesh_expected")["found"], 2);
    app.post("/v1/query", "multipart/form-data", "x")
        .await
        .fails(400, "invalid_multipart");
    app.post("/v1/query", "multipart/form-data; boundary=x", "--x\r\nbroken")
        .await
        .fails(400, "invalid_multipart");
    app.post("/v1/classes/bean/shapes?poses=4", "model/off", bean)
        .await
        .fails(422, "no_animation");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_query_past_its_deadline_is_stopped() {
    let late = App::with(|c| c.query_timeout = std::time::Duration::from_millis(1));
    let answer = late
        .post("/v1/classes/bean/shapes?create=true", "model/off", dense().off())
        .await;
    let problem = answer.fails(504, "deadline_exceeded");
    assert!(problem["limit_seconds"].is_number());
    late.get("/v1/classes/bean").await.fails(404, "class_not_found");
}
