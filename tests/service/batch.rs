//! Many queries in one request.

use crate::harness::{App, multipart};
use crate::meshes::{CLASSES, off};
use serde_json::Value;

#[tokio::test(flavor = "multi_thread")]
async fn every_mesh_has_its_line_and_the_last_one_counts() {
    let app = App::indexed().await;
    let meshes: Vec<(String, Vec<u8>)> = CLASSES.iter().map(|c| (format!("{c}.off"), off(c, 4))).collect();
    let mut files: Vec<(&str, &[u8])> = meshes.iter().map(|(n, b)| (n.as_str(), b.as_slice())).collect();
    files.push(("empty.off", b""));
    files.push(("points.off", b"OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n"));
    let (media_type, body) = multipart(&files);
    let answer = app.post("/v1/query/batch?top=1", &media_type, body).await;
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert_eq!(answer.header("content-type"), "application/x-ndjson");
    let text = answer.text();
    let mut lines: Vec<Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let summary = lines.pop().unwrap();
    assert_eq!(
        summary,
        serde_json::json!({"summary": {"total": 5, "ok": 3, "failed": 2}})
    );
    lines.sort_by_key(|l| l["index"].as_u64());
    assert_eq!(lines.len(), 5);
    for (line, class) in lines.iter().zip(CLASSES) {
        assert_eq!(line["status"], "ok", "{line}");
        assert_eq!(line["name"], format!("{class}.off"));
        assert_eq!(line["classes"][0]["class"]["name"], class);
    }
    assert_eq!(lines[3]["status"], "failed");
    assert_eq!(lines[3]["problem"]["code"], "empty_body");
    assert_eq!(lines[4]["problem"]["code"], "no_faces");
    assert_eq!(lines[4]["problem"]["request_id"], answer.header("x-request-id"));
}

#[tokio::test(flavor = "multi_thread")]
async fn an_empty_index_fails_every_line_by_code() {
    let app = App::new();
    let bean = off("bean", 0);
    let (media_type, body) = multipart(&[("a.off", &bean), ("b.off", &bean)]);
    let answer = app.post("/v1/query/batch", &media_type, body).await;
    answer.fails(409, "index_empty");
}
