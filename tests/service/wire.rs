//! What every answer keeps to, whatever it is about: problems in the API's own words, cursors of their own list, and
//! compression where it is asked for.

use crate::harness::App;
use axum::body::Body;
use axum::http::Request;
use serde_json::json;
use std::io::Read;

#[tokio::test]
async fn problems_of_query_strings_name_the_parameter_its_value_and_its_range() {
    let app = App::new();
    let detail = |path: &str, problem: serde_json::Value| {
        let detail = problem["detail"].as_str().unwrap_or_default().to_owned();
        assert!(!detail.contains("eserialize"), "{path}: {detail}");
        detail
    };
    let path = "/v1/classes?limit=ten";
    let problem = app.get(path).await.fails(400, "invalid_query");
    assert_eq!(problem["name"], "limit");
    assert_eq!(
        detail(path, problem),
        "limit must be a whole number from 1 to 1000, got 'ten'"
    );
    let path = "/v1/jobs?offset=3";
    let problem = app.get(path).await.fails(400, "invalid_query");
    assert_eq!(problem["name"], "offset");
    assert!(detail(path, problem).contains("there are limit, cursor"));
    for path in [
        "/v1/query?top=x",
        "/v1/query?rank_by=y",
        "/v1/query/batch?time_limit_ms=-1",
    ] {
        let answer = app.post(path, "model/off", "OFF").await;
        let problem = answer.fails(400, "invalid_query");
        assert!(detail(path, problem).contains("must be"), "{path}");
    }
}

#[tokio::test]
async fn problems_of_bodies_name_the_field() {
    let app = App::new();
    let answer = app.json("POST", "/v1/classes", json!({"name": 5})).await;
    let problem = answer.fails(422, "invalid_field");
    assert_eq!(problem["name"], "name");
    let answer = app
        .json("POST", "/v1/reindex", json!({"parameters": {"atoms": "many"}}))
        .await;
    let problem = answer.fails(422, "invalid_field");
    assert!(
        problem["name"].as_str().unwrap().starts_with("parameters"),
        "{problem}"
    );
    let answer = app
        .call("POST", "/v1/classes", Some("application/json"), "{\"name\": ")
        .await;
    answer.fails(400, "invalid_json");
    let answer = app
        .call(
            "POST",
            "/v1/classes",
            Some("application/json"),
            "{\"name\": \"a\"} x",
        )
        .await;
    answer.fails(400, "invalid_json");
}

#[tokio::test]
async fn a_cursor_belongs_to_the_list_that_made_it() {
    let app = App::indexed().await;
    let next = |answer: crate::harness::Answer| answer.value()["next_cursor"].as_str().map(str::to_owned);
    let of_classes = next(app.get("/v1/classes?limit=1").await).unwrap();
    let classes = app.get("/v1/classes").await.value();
    let name = |i: usize| classes["items"][i]["id"].as_str().unwrap().to_owned();
    let shapes = |i: usize| format!("/v1/classes/{}/shapes?limit=1", name(i));
    let of_shapes = next(app.get(&shapes(0)).await).unwrap();
    assert_eq!(
        app.get(&format!("{}&cursor={of_shapes}", shapes(0))).await.status,
        200
    );
    for (path, cursor) in [
        ("/v1/jobs?limit=1".to_owned(), &of_classes),
        ("/v1/classes?limit=1".to_owned(), &of_shapes),
        (shapes(1), &of_shapes),
        (shapes(0), &of_classes),
    ] {
        let answer = app.get(&format!("{path}&cursor={cursor}")).await;
        answer.fails(400, "invalid_cursor");
    }
}

#[tokio::test]
async fn large_documents_are_compressed_where_the_client_asks() {
    let app = App::new();
    let ask = |path: &str, encoding: Option<&str>| {
        let mut request = Request::get(path);
        if let Some(encoding) = encoding {
            request = request.header("accept-encoding", encoding);
        }
        request.body(Body::empty()).unwrap()
    };
    let plain = app.send(ask("/openapi.json", None)).await;
    assert!(!plain.headers.contains_key("content-encoding"));
    for encoding in ["gzip", "zstd"] {
        let packed = app.send(ask("/openapi.json", Some(encoding))).await;
        assert_eq!(packed.header("content-encoding"), encoding);
        assert!(
            packed
                .header("vary")
                .to_ascii_lowercase()
                .contains("accept-encoding")
        );
        assert!(packed.body.len() < plain.body.len() / 4, "{}", packed.body.len());
        let mut unpacked = Vec::new();
        match encoding {
            "gzip" => {
                let mut reader = flate2::read::GzDecoder::new(&packed.body[..]);
                reader.read_to_end(&mut unpacked).unwrap();
            }
            _ => unpacked = zstd::decode_all(&packed.body[..]).unwrap(),
        }
        assert_eq!(unpacked, plain.body);
    }
    // Short answers are sent as they are.
    let short = app.send(ask("/healthz", Some("gzip"))).await;
    assert!(!short.headers.contains_key("content-encoding"));
}
