//! A service that shows the catalogue and leaves everything as it is.

use crate::harness::{App, small};
use crate::meshes::{CLASSES, off};
use serde_json::json;
use shapelex::http::{AppState, ServiceConfig};
use std::collections::BTreeMap;
use std::path::Path;

/// Every file below a directory with its contents, but for what a start writes by itself.
fn files(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(directory).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        if entry.file_type().unwrap().is_dir() {
            let inside = files(&entry.path());
            found.extend(
                inside
                    .into_iter()
                    .map(|(below, bytes)| (format!("{name}/{below}"), bytes)),
            );
        } else if !name.starts_with("audit.log") && !name.starts_with("snap.") {
            found.insert(name, std::fs::read(entry.path()).unwrap());
        }
    }
    found
}

#[tokio::test(flavor = "multi_thread")]
async fn it_shows_the_catalogue_and_changes_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let open = |recovery_mode| {
        App::on(
            AppState::open(ServiceConfig {
                data_dir: directory.path().to_owned(),
                recovery_mode,
                ..ServiceConfig::default()
            })
            .unwrap(),
        )
    };
    let app = open(false);
    for class in CLASSES {
        let path = format!("/v1/classes/{class}/shapes?create=true&name={class}.off");
        let answer = app.post(&path, "model/off", off(class, 0)).await;
        assert_eq!(answer.status, 201, "{}", answer.text());
    }
    let job = app.reindex(json!({"parameters": small()})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    drop(app);

    let app = open(true);
    let before = files(directory.path());
    assert_eq!(app.get("/healthz").await.status, 200);
    let ready = app.get("/readyz").await.fails(503, "not_ready");
    let why = ready["checks"]["store"].as_str().unwrap();
    assert!(why.contains("recovery mode"), "{why}");
    let classes = app.get("/v1/classes").await.value();
    assert_eq!(classes["items"].as_array().unwrap().len(), CLASSES.len());
    let class = classes["items"][0]["id"].as_str().unwrap();
    let shapes = app.get(&format!("/v1/classes/{class}/shapes")).await.value();
    let original = shapes["items"][0]["original"].as_str().unwrap();
    assert!(app.get(original).await.body == off(CLASSES[0], 0));
    assert_eq!(
        app.get("/v1/jobs").await.value()["items"][0]["state"],
        "succeeded"
    );

    // Failed is never confused with "no match", and no write is lost for it is not taken.
    let query = app.post("/v1/query", "model/off", off(CLASSES[0], 1)).await;
    query.fails(503, "recovery_mode");
    let shapes = format!("/v1/classes/{class}/shapes");
    app.post(&shapes, "model/off", off(CLASSES[0], 1))
        .await
        .fails(503, "recovery_mode");
    app.delete(&format!("/v1/classes/{class}"))
        .await
        .fails(503, "recovery_mode");
    app.json("POST", "/v1/reindex", json!({}))
        .await
        .fails(503, "recovery_mode");
    app.json("POST", "/v1/snapshots", json!({}))
        .await
        .fails(503, "recovery_mode");
    let named = json!({"name": "new"});
    app.json("POST", "/v1/classes", named.clone())
        .await
        .fails(503, "recovery_mode");
    assert!(files(directory.path()) == before, "something was written");
    drop(app);

    let app = open(false);
    assert_eq!(
        app.post("/v1/query", "model/off", off(CLASSES[0], 1))
            .await
            .status,
        200
    );
    assert_eq!(app.json("POST", "/v1/classes", named).await.status, 201);
}
