//! Snapshots over HTTP.

use crate::harness::{App, small};
use crate::meshes::off;
use serde_json::json;

#[tokio::test]
async fn a_snapshot_is_made_listed_downloaded_and_restored_here_and_elsewhere() {
    let app = App::indexed().await;
    let ranked = async |app: &App| {
        let answer = app.post("/v1/query?top=3", "model/off", off("bean", 7)).await;
        assert_eq!(answer.status, 200, "{}", answer.text());
        let value = answer.value();
        (value["classes"].clone(), value["generation"].clone())
    };
    let before = ranked(&app).await;
    let made = app.post("/v1/snapshots", "application/json", "").await;
    assert_eq!(made.status, 201, "{}", made.text());
    let snapshot = made.value();
    let id = snapshot["id"].as_str().unwrap();
    assert_eq!(made.header("location"), format!("/v1/snapshots/{id}"));
    assert_eq!(snapshot["shapes"], 9);
    assert_eq!(snapshot["generation"], 1);
    assert_eq!(app.get("/v1/snapshots").await.value()["items"], json!([snapshot]));
    assert_eq!(app.get(&format!("/v1/snapshots/{id}")).await.value(), snapshot);
    let file = app.get(snapshot["file"].as_str().unwrap()).await;
    assert_eq!(file.header("content-type"), "application/zstd");
    assert_eq!(file.header("content-length"), file.body.len().to_string());
    assert_eq!(
        file.header("etag"),
        format!("\"{}\"", blake3::hash(&file.body).to_hex())
    );

    // Here: what came later goes, what went comes back, and the index with it.
    let classes = app.get("/v1/classes").await.value();
    for class in classes["items"].as_array().unwrap() {
        let path = format!("/v1/classes/{}", class["id"].as_str().unwrap());
        assert_eq!(app.delete(&path).await.status, 204);
    }
    app.json("POST", "/v1/classes", json!({"name": "later"})).await;
    let job = app.reindex(json!({})).await["id"].clone();
    let restored = app
        .post_as_owner(&format!("/v1/snapshots/{id}/restore"), "", "")
        .await;
    assert_eq!(restored.status, 200, "{}", restored.text());
    assert_eq!(
        (&restored.value()["classes"], &restored.value()["shapes"]),
        (&json!(3), &json!(9))
    );
    assert_eq!(ranked(&app).await, before);
    let known = app.get(&format!("/v1/jobs/{}", job.as_str().unwrap())).await;
    assert_eq!(known.status, 200, "a job that was acknowledged stays known");
    // The next generation's number was never used.
    let mut parameters = small();
    parameters["seed"] = json!(2); // With the same, the index is what it was, and stays.
    let next = app
        .reindex(json!({"scope": "all", "parameters": parameters}))
        .await;
    assert_eq!(next["generation"], 3, "{next}");

    // Elsewhere.
    let other = App::new();
    let restored = other
        .post_as_owner("/v1/snapshots/restore", "application/zstd", file.body.clone())
        .await;
    assert_eq!(restored.status, 200, "{}", restored.text());
    assert_eq!(ranked(&other).await, before);
    let shape = &other.get("/v1/classes/bean/shapes").await.value()["items"][0];
    let original = other.get(shape["original"].as_str().unwrap()).await;
    assert_eq!(original.body, off("bean", 0));

    assert_eq!(app.delete(&format!("/v1/snapshots/{id}")).await.status, 204);
    app.get(&format!("/v1/snapshots/{id}"))
        .await
        .fails(404, "snapshot_not_found");
    app.get(&format!("/v1/snapshots/{id}/file"))
        .await
        .fails(404, "snapshot_not_found");
}

#[tokio::test]
async fn what_is_no_snapshot_is_refused_and_changes_nothing() {
    let app = App::indexed().await;
    let empty = app
        .post_as_owner("/v1/snapshots/restore", "application/zstd", "")
        .await;
    empty.fails(400, "empty_body");
    let hello = app
        .post_as_owner("/v1/snapshots/restore", "application/zstd", "hello")
        .await;
    hello.fails(422, "invalid_snapshot");
    app.post_as_owner("/v1/snapshots/nothing/restore", "", "")
        .await
        .fails(404, "snapshot_not_found");
    app.delete("/v1/snapshots/nothing")
        .await
        .fails(404, "snapshot_not_found");
    let small = App::with(|config| config.snapshot_max_bytes = 100);
    let long = small
        .post_as_owner("/v1/snapshots/restore", "application/zstd", vec![7; 101])
        .await;
    long.fails(413, "body_too_large");
    assert_eq!(app.get("/v1/index").await.value()["generation"], 1);
    assert_eq!(
        app.get("/v1/classes").await.value()["items"]
            .as_array()
            .unwrap()
            .len(),
        3
    );
}

#[tokio::test]
async fn a_restore_waits_for_no_job_and_a_job_for_no_restore() {
    let app = App::indexed().await;
    let made = app.post("/v1/snapshots", "", "").await.value();
    let restore = format!("/v1/snapshots/{}/restore", made["id"].as_str().unwrap());
    let slow = json!({"scope": "all", "parameters": {"iterations": 10_000, "atoms": 60}});
    let job = app.json("POST", "/v1/reindex", slow).await.value();
    let refused = app
        .post_as_owner(&restore, "", "")
        .await
        .fails(409, "jobs_unfinished");
    assert_eq!(refused["jobs"], 1);
    // A snapshot does not wait for the job.
    assert_eq!(app.post("/v1/snapshots", "", "").await.status, 201);
    let id = job["id"].as_str().unwrap();
    app.post(&format!("/v1/jobs/{id}/cancel"), "", "").await;
    app.wait(id).await;
    let restored = app.post_as_owner(&restore, "", "").await;
    assert_eq!(restored.status, 200, "{}", restored.text());
}
