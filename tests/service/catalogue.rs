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

#[tokio::test(flavor = "multi_thread")]
async fn names_that_mislead_are_refused_by_every_way_to_make_one() {
    let app = App::new();
    let dog = app
        .json("POST", "/v1/classes", json!({"name": "dog"}))
        .await
        .value();
    let id = dog["id"].as_str().unwrap();
    let refused = [
        "",
        " ",
        ".",
        "..",
        "a/b",
        "/",
        "a\\b",
        "\rabc",
        "abc\n",
        "a\0b",
        "\u{200b}dog",
        "dog\u{202e}",
        "d\u{2066}og",
        "dog\u{feff}",
        "\u{2028}dog",
        "dog\u{ad}",
        "dog\u{3164}",
        "dog\u{fe0f}",
        id,
        &id.to_uppercase(),
        &id.replace('-', ""),
        "00000000-0000-0000-0000-000000000000",
    ];
    for name in refused {
        let answers = [
            app.json("POST", "/v1/classes", json!({ "name": name })).await,
            app.json("PATCH", "/v1/classes/dog", json!({ "name": name }))
                .await,
        ];
        for answer in answers {
            answer.fails(422, "invalid_name");
        }
        let path: String = name.bytes().map(|byte| format!("%{byte:02X}")).collect();
        // These are the class itself, and what an address has no room for.
        if name.is_empty() || name.eq_ignore_ascii_case(id) || name == id.replace('-', "") {
            continue;
        }
        let path = format!("/v1/classes/{path}/shapes?create=true");
        let upload = app.post(&path, "model/off", off("bean", 0)).await;
        assert_eq!(upload.problem(), (422, "invalid_name".to_owned()), "{name:?}");
    }
    let classes = app.get("/v1/classes").await.value();
    assert_eq!(classes["items"].as_array().unwrap().len(), 1);
    for name in ["猫 (2)", "été", "a.b", "...", "🦊", "\u{1f469}"] {
        let made = app.json("POST", "/v1/classes", json!({ "name": name })).await;
        assert_eq!(made.status, 201, "{name}: {}", made.text());
    }
    // The same name in another spelling of Unicode.
    app.json("POST", "/v1/classes", json!({"name": "e\u{301}te\u{301}"}))
        .await
        .fails(409, "class_exists");
    assert_eq!(
        app.get("/v1/classes/e%CC%81te%CC%81").await.value()["name"],
        "\u{e9}t\u{e9}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_class_that_an_earlier_version_named_is_shown_filled_renamed_and_deleted() {
    use shapelex::model::ClassName;
    let app = App::new();
    for (old, path) in [
        ("a/b", "a%2Fb"),
        ("x\u{200b}", "x%E2%80%8B"),
        ("cafe\u{301}", "cafe%CC%81"),
    ] {
        let made = app
            .state
            .store
            .create_class(ClassName::stored(old).unwrap())
            .unwrap();
        let shown = app.get(&format!("/v1/classes/{path}")).await.value();
        assert_eq!(
            (&shown["name"], &shown["id"]),
            (&json!(old), &json!(made.id.to_string()))
        );
        assert_eq!(
            app.get(&format!("/v1/classes/{}", made.id)).await.value()["name"],
            old
        );
        let upload = app
            .post(
                &format!("/v1/classes/{path}/shapes?create=true"),
                "model/off",
                off("bean", 0),
            )
            .await;
        assert_eq!(upload.status, 201, "{}", upload.text());
        let renamed = app
            .json("PATCH", &format!("/v1/classes/{path}"), json!({"name": "new"}))
            .await;
        assert_eq!(renamed.status, 200, "{}", renamed.text());
        assert_eq!(app.delete("/v1/classes/new").await.status, 204);
    }
    assert_eq!(app.get("/v1/classes").await.value()["items"], json!([]));
}

#[test]
fn the_schema_of_names_says_what_the_code_does() {
    let document: serde_json::Value = serde_json::from_str(
        &shapelex::http::openapi::document(shapelex::http::routes::routes())
            .to_pretty_json()
            .map_err(|e| e.to_string())
            .unwrap(),
    )
    .unwrap();
    for request in ["CreateClass", "RenameClass"] {
        let pattern = &document["components"]["schemas"][request]["properties"]["name"]["pattern"];
        assert_eq!(pattern, &json!(shapelex::model::ClassName::pattern()));
    }
}
