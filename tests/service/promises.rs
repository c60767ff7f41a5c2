//! What a client that repeats itself, caches or is in a hurry can rely on.

use crate::harness::{Answer, App, small};
use crate::meshes;
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};

async fn with(app: &App, method: &str, path: &str, header: (&str, &str), body: Option<Value>) -> Answer {
    let mut request = Request::builder()
        .method(method)
        .uri(path)
        .header(header.0, header.1);
    let body = match body {
        Some(body) => {
            request = request.header("content-type", "application/json");
            Body::from(body.to_string())
        }
        None => Body::empty(),
    };
    app.send(request.body(body).unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_idempotency_key_is_the_same_job() {
    let app = App::indexed().await;
    let ask = |key: &'static str, body: Value| {
        let app = &app;
        async move { with(app, "POST", "/v1/reindex", ("idempotency-key", key), Some(body)).await }
    };
    let first = ask("nightly-1", json!({"scope": "all"})).await;
    assert_eq!(first.status, 202, "{}", first.text());
    let job = first.value()["id"].as_str().unwrap().to_owned();
    let again = ask("nightly-1", json!({"scope": "all"})).await;
    assert_eq!(
        (again.status.as_u16(), again.value()["id"].as_str().unwrap()),
        (202, job.as_str())
    );
    assert_eq!(
        ask("nightly-1", json!({"scope": "stale"}))
            .await
            .fails(422, "idempotency_key_reused")["job"],
        job.as_str()
    );
    let other = ask("nightly-2", json!({"scope": "all"})).await;
    assert_ne!(other.value()["id"], job.as_str());
    app.wait(&job).await;
    let done = ask("nightly-1", json!({"scope": "all"})).await;
    assert_eq!(done.value()["id"], job.as_str(), "also when the job has ended");
    let long: &'static str = Box::leak("k".repeat(201).into_boxed_str());
    for bad in ["", "two words", long] {
        ask(bad, json!({})).await.fails(400, "invalid_request");
    }
    app.wait(other.value()["id"].as_str().unwrap()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tags_of_classes_tell_what_changed() {
    let app = App::new();
    app.post(
        "/v1/classes/bean/shapes?create=true",
        "model/off",
        meshes::off("bean", 0),
    )
    .await;
    let path = "/v1/classes/bean";
    let tag = app.get(path).await.header("etag").to_owned();
    let same = with(&app, "GET", path, ("if-none-match", &tag), None).await;
    assert_eq!(
        (same.status.as_u16(), same.body.len(), same.header("etag")),
        (304, 0, tag.as_str())
    );
    let job = app.reindex(json!({"parameters": small()})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    // The answer says `current` now, so the copy at hand is old; the class itself has not changed.
    assert_eq!(
        with(&app, "GET", path, ("if-none-match", &tag), None)
            .await
            .status,
        200
    );
    let renamed = with(
        &app,
        "PATCH",
        path,
        ("if-match", &tag),
        Some(json!({"name": "pea"})),
    )
    .await;
    assert_eq!(renamed.status, 200, "{}", renamed.text());
    with(&app, "DELETE", "/v1/classes/pea", ("if-match", &tag), None)
        .await
        .fails(412, "revision_mismatch");
    for garbage in ["", "\"", "nonsense", "W/\"1-2-3\""] {
        with(&app, "DELETE", "/v1/classes/pea", ("if-match", garbage), None)
            .await
            .fails(412, "revision_mismatch");
    }
    let now = renamed.header("etag");
    assert_eq!(
        with(&app, "DELETE", "/v1/classes/pea", ("if-match", now), None)
            .await
            .status,
        204
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_time_limit_gives_the_best_so_far_or_says_that_there_is_none() {
    let app = App::indexed().await;
    let mesh = || meshes::off(meshes::CLASSES[1], 7);
    let whole = app.post("/v1/query", "model/off", mesh()).await.value();
    assert_eq!(
        (&whole["partial"], &whole["not_compared"]),
        (&json!(false), &json!([]))
    );
    // With time enough the ranking is the same, to the last digit.
    let limited = app
        .post("/v1/query?time_limit_ms=60000", "model/off", mesh())
        .await
        .value();
    assert_eq!(limited["partial"], false);
    for member in ["classes", "confidence", "compared", "nearest_shapes"] {
        assert_eq!(limited[member], whole[member], "{member}");
    }
    app.post("/v1/query?time_limit_ms=1", "model/off", meshes::dense().off())
        .await
        .fails(504, "deadline_exceeded");
    app.post("/v1/query?time_limit_ms=0", "model/off", mesh())
        .await
        .fails(400, "invalid_query");
}
