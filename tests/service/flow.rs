//! From nothing to a ranked answer.

use crate::harness::{App, small};
use crate::meshes::{CLASSES, mesh, off};
use axum::body::Body;
use serde_json::json;

#[tokio::test(flavor = "multi_thread")]
async fn classes_are_made_learnt_and_recognised() {
    let app = App::new();
    for class in CLASSES {
        let made = app.json("POST", "/v1/classes", json!({"name": class})).await;
        assert_eq!(made.status, 201);
        let location = made.header("location").to_owned();
        assert_eq!(app.get(&location).await.value()["name"], class);
        for pose in 0..3 {
            let answer = app
                .post(
                    &format!("{location}/shapes?name={class}{pose}.off"),
                    "model/off",
                    off(class, pose),
                )
                .await;
            assert_eq!(answer.status, 201, "{}", answer.text());
            let body = answer.value();
            assert_eq!(body["shapes"][0]["existing"], false);
            assert_eq!(body["shapes"][0]["format"], "off");
            assert!(body["shapes"][0]["report"]["vertices"].as_u64().unwrap() > 400);
            assert_eq!(body["class"]["shapes"], pose + 1);
            assert_eq!(body["class"]["index_state"], "not_indexed");
        }
    }
    app.post("/v1/query", "model/off", off("bean", 3))
        .await
        .fails(409, "index_empty");

    let started = app
        .json(
            "POST",
            "/v1/reindex",
            json!({"scope": "stale", "parameters": small()}),
        )
        .await;
    assert_eq!(started.status, 202);
    let job = started.value();
    assert_eq!(
        started.header("location"),
        format!("/v1/jobs/{}", job["id"].as_str().unwrap())
    );

    // The events end by themselves, with the final state.
    let events = app.get(&format!("{}/events", started.header("location"))).await;
    assert_eq!(events.header("content-type"), "text/event-stream");
    let text = events.text();
    let last = text.lines().rfind(|l| l.starts_with("data:")).unwrap();
    let last: serde_json::Value = serde_json::from_str(last.trim_start_matches("data:").trim()).unwrap();
    assert_eq!(last["state"], "succeeded", "{last}");
    assert!(text.contains("event: progress"));
    assert_eq!(last["result"]["relearned"].as_array().unwrap().len(), 3);
    assert!(
        last["steps"]
            .as_array()
            .unwrap()
            .iter()
            .all(|s| s["finished"] == s["total"])
    );

    let index = app.get("/v1/index").await.value();
    assert_eq!(index["generation"], 1);
    assert_eq!(index["parameters"]["atoms"], 12);
    assert_eq!(index["classes"].as_array().unwrap().len(), 3);
    assert!(
        index["classes"]
            .as_array()
            .unwrap()
            .iter()
            .all(|c| c["index_state"] == "current")
    );

    for class in CLASSES {
        let answer = app
            .post(
                "/v1/query?name=held-out.obj",
                "application/octet-stream",
                mesh(class, 4).obj(),
            )
            .await;
        assert_eq!(answer.status, 200, "{}", answer.text());
        let body = answer.value();
        assert_eq!(body["classes"][0]["class"]["name"], class, "{body}");
        assert_eq!(body["classes"][0]["rank"], 1);
        assert_eq!(body["classes"].as_array().unwrap().len(), 3);
        assert_eq!(body["format"], "obj");
        assert_eq!(body["generation"], 1);
        assert_eq!(body["name"], "held-out.obj");
        assert_eq!(body["nearest_shapes"], json!([]));
        assert!(body["confidence"].as_f64().unwrap() > 0.0);
        let scores: Vec<f64> = body["classes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c["score"].as_f64().unwrap())
            .collect();
        assert!(scores.is_sorted());
        for stage in [
            "wait",
            "read",
            "prepare",
            "laplacian",
            "eigenpairs",
            "signatures",
            "ranking",
            "total",
        ] {
            assert!(
                body["timings_ms"][stage].is_number(),
                "{stage}: {}",
                body["timings_ms"]
            );
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn options_shape_the_answer_and_changes_show_at_once() {
    let app = App::indexed().await;
    let by_objective = app
        .post("/v1/query?top=2", "model/off", off("star", 4))
        .await
        .value();
    assert_eq!(by_objective["classes"].as_array().unwrap().len(), 2);
    assert_eq!(by_objective["compared"], 3);
    let by_error = app
        .post("/v1/query?rank_by=frobenius", "model/off", off("star", 4))
        .await
        .value();
    assert_eq!(by_error["rank_by"], "frobenius");
    assert_eq!(
        by_error["classes"][0]["score"],
        by_error["classes"][0]["reconstruction_error"]
    );

    // A new name is in the next answer, a deleted class is not.
    let renamed = app
        .json("PATCH", "/v1/classes/star", json!({"name": "starfish"}))
        .await;
    assert_eq!(renamed.status, 200);
    assert_eq!(renamed.value()["index_state"], "current");
    assert_eq!(app.delete("/v1/classes/bean").await.status, 204);
    let after = app.post("/v1/query", "model/off", off("star", 4)).await.value();
    assert_eq!(after["classes"][0]["class"]["name"], "starfish");
    assert_eq!(after["compared"], 2);

    // A shape more makes its class stale; a reindex learns only that one.
    let more = app
        .post("/v1/classes/bottle/shapes", "model/off", off("bottle", 5))
        .await
        .value();
    assert_eq!(more["class"]["index_state"], "stale");
    assert_eq!(app.get("/v1/index").await.value()["stale"], json!(["bottle"]));
    let job = app.reindex(json!({})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    assert_eq!(job["result"]["relearned"].as_array().unwrap().len(), 1, "{job}");
    assert_eq!(job["result"]["relearned"][0]["class"]["name"], "bottle");
    assert_eq!(app.get("/v1/index").await.value()["parameters"]["atoms"], 12);
}

#[tokio::test(flavor = "multi_thread")]
async fn single_shapes_are_ranked_where_the_parameters_ask_for_them() {
    let app = App::indexed().await;
    let job = app.reindex(json!({"parameters": {"per_shape": true}})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let answer = app
        .post("/v1/query?top=3", "model/off", off("star", 1))
        .await
        .value();
    let nearest = answer["nearest_shapes"].as_array().unwrap();
    assert_eq!(nearest.len(), 3);
    assert_eq!(nearest[0]["class"]["name"], "star");
    let shape = nearest[0]["shape"].as_str().unwrap();
    let name = app.get(&format!("/v1/classes/star/shapes/{shape}")).await.value()["name"].clone();
    assert!(name.as_str().unwrap().starts_with("star"), "{name}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_empty_body_starts_a_reindex_and_jobs_are_listed() {
    let app = App::new();
    app.post("/v1/classes/bean/shapes?create=true", "model/off", off("bean", 0))
        .await;
    let first = app
        .json("POST", "/v1/reindex", json!({"parameters": small()}))
        .await
        .value();
    app.wait(first["id"].as_str().unwrap()).await;
    let second = app.call("POST", "/v1/reindex", None, Body::empty()).await;
    assert_eq!(second.status, 202, "{}", second.text());
    app.wait(second.value()["id"].as_str().unwrap()).await;
    let page = app.get("/v1/jobs?limit=1").await.value();
    assert_eq!(page["items"][0]["id"], second.value()["id"]);
    let cursor = page["next_cursor"].as_str().unwrap();
    let page = app
        .get(&format!("/v1/jobs?limit=1&cursor={cursor}"))
        .await
        .value();
    assert_eq!(page["items"][0]["id"], first["id"]);
    assert!(page["next_cursor"].is_null());
    let id = first["id"].as_str().unwrap();
    let body = app
        .call("POST", &format!("/v1/jobs/{id}/cancel"), None, Body::empty())
        .await
        .fails(409, "job_finished");
    assert_eq!(body["state"], "succeeded");
}
