//! Classes and shapes: listed in pages, changed only as they were read, deleted.

use crate::harness::App;
use crate::meshes::off;
use axum::body::Body;
use axum::http::Request;
use serde_json::json;

#[tokio::test(flavor = "multi_thread")]
async fn lists_come_in_pages_that_join() {
    let app = App::new();
    let names: Vec<String> = (0..7).map(|i| format!("class {i}")).collect();
    for name in &names {
        assert_eq!(
            app.json("POST", "/v1/classes", json!({"name": name}))
                .await
                .status,
            201
        );
    }
    let (mut seen, mut cursor, mut pages) = (Vec::new(), String::new(), 0);
    loop {
        let page = app.get(&format!("/v1/classes?limit=3{cursor}")).await.value();
        seen.extend(
            page["items"]
                .as_array()
                .unwrap()
                .iter()
                .map(|c| c["name"].as_str().unwrap().to_owned()),
        );
        pages += 1;
        match page["next_cursor"].as_str() {
            Some(next) => cursor = format!("&cursor={next}"),
            None => break,
        }
    }
    assert_eq!((seen, pages), (names, 3));
    app.get("/v1/classes?limit=0").await.fails(400, "invalid_query");
    app.get("/v1/classes?limit=1001")
        .await
        .fails(400, "invalid_query");
    app.get("/v1/classes?page=2").await.fails(400, "invalid_query");
    app.get("/v1/classes?cursor=nonsense")
        .await
        .fails(400, "invalid_cursor");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_class_answers_to_its_id_and_its_name() {
    let app = App::new();
    let made = app
        .json("POST", "/v1/classes", json!({"name": "sea lion"}))
        .await
        .value();
    let id = made["id"].as_str().unwrap();
    assert_eq!(app.get(&format!("/v1/classes/{id}")).await.value(), made);
    assert_eq!(app.get("/v1/classes/sea%20lion").await.value(), made);
    let taken = app.json("POST", "/v1/classes", json!({"name": "sea lion"})).await;
    assert_eq!(taken.fails(409, "class_exists")["class"], id);
    app.json("POST", "/v1/classes", json!({"name": "  "}))
        .await
        .fails(422, "invalid_name");
    app.get("/v1/classes/walrus").await.fails(404, "class_not_found");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_class_is_changed_only_as_it_was_read() {
    let app = App::new();
    app.json("POST", "/v1/classes", json!({"name": "dog"})).await;
    let tag = app.get("/v1/classes/dog").await.header("etag").to_owned();
    let patch = |tag: &str, name: &str| {
        Request::patch("/v1/classes/dog")
            .header("if-match", tag)
            .header("content-type", "application/json")
            .body(Body::from(json!({"name": name}).to_string()))
            .unwrap()
    };
    app.post("/v1/classes/dog/shapes", "model/off", off("bean", 0))
        .await;
    app.send(patch(&tag, "wolf"))
        .await
        .fails(412, "revision_mismatch");
    let tag = app.get("/v1/classes/dog").await.header("etag").to_owned();
    assert_eq!(app.send(patch(&tag, "wolf")).await.status, 200);
    let stale = Request::delete("/v1/classes/wolf").header("if-match", &tag);
    app.send(stale.body(Body::empty()).unwrap())
        .await
        .fails(412, "revision_mismatch");
    assert_eq!(app.delete("/v1/classes/wolf").await.status, 204);
    app.delete("/v1/classes/wolf").await.fails(404, "class_not_found");
}

#[tokio::test(flavor = "multi_thread")]
async fn shapes_are_listed_downloaded_once_and_deleted() {
    let app = App::new();
    for pose in 0..3 {
        app.post(
            "/v1/classes/bean/shapes?create=true",
            "model/off",
            off("bean", pose),
        )
        .await;
    }
    app.json("POST", "/v1/classes", json!({"name": "other"})).await;
    let page = app.get("/v1/classes/bean/shapes?limit=2").await.value();
    assert_eq!(page["items"].as_array().unwrap().len(), 2);
    assert!(page["next_cursor"].is_string());
    let shape = page["items"][0]["id"].as_str().unwrap();
    let path = format!("/v1/classes/bean/shapes/{shape}");
    let original = app.get(&format!("{path}/original")).await;
    let again = Request::get(format!("{path}/original"))
        .header("if-none-match", original.header("etag"))
        .body(Body::empty())
        .unwrap();
    let again = app.send(again).await;
    assert_eq!((again.status.as_u16(), again.body.len()), (304, 0));
    app.get(&format!("/v1/classes/other/shapes/{shape}"))
        .await
        .fails(404, "shape_not_found");
    app.get("/v1/classes/bean/shapes/7")
        .await
        .fails(404, "shape_not_found");
    assert_eq!(app.delete(&path).await.status, 204);
    app.get(&path).await.fails(404, "shape_not_found");
    app.get(&format!("{path}/original"))
        .await
        .fails(404, "shape_not_found");
    assert_eq!(app.get("/v1/classes/bean").await.value()["shapes"], 2);
}
