//! `openapi.yaml`, the route table and the problems are one contract.

use crate::harness::App;
use axum::body::Body;
use serde_json::Value;
use std::path::Path;

fn document() -> Value {
    serde_json::from_str(
        &shapelex::http::openapi::document(shapelex::http::routes::routes())
            .to_pretty_json()
            .map_err(|e| e.to_string())
            .unwrap(),
    )
    .unwrap()
}

#[test]
fn openapi_yaml_is_what_the_code_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi.yaml");
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    let made = shapelex::http::openapi::document(shapelex::http::routes::routes())
        .to_yaml()
        .map_err(|e| e.to_string())
        .unwrap();
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(&path, &made).unwrap();
        return;
    }
    assert!(
        written == made,
        "openapi.yaml differs from the handlers; run `shapelex openapi > openapi.yaml`, or this test with UPDATE_OPENAPI=1"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn the_document_and_the_route_table_agree_on_every_method() {
    let app = App::new();
    for (path, item) in document()["paths"].as_object().unwrap() {
        let address = path
            .replace("{class}", "x")
            .replace("{shape}", "x")
            .replace("{job}", "x")
            .replace("{key}", "x");
        for method in ["GET", "POST", "PUT", "PATCH", "DELETE"] {
            let described = item.get(method.to_lowercase()).is_some();
            let answer = app.call(method, &address, None, Body::empty()).await;
            let routed = answer.status != 405;
            assert_eq!(routed, described, "{method} {path} answered {}", answer.status);
            if !routed {
                let problem = answer.fails(405, "method_not_allowed");
                let detail = problem["detail"].as_str().unwrap();
                assert!(detail.starts_with("this address answers "), "{detail}");
                assert!(!answer.header("allow").is_empty(), "{method} {path}");
            } else if answer.status.as_u16() >= 400 {
                // Whatever failed, it is a problem the document knows for this operation.
                let (status, code) = answer.problem();
                assert_ne!(code, "route_not_found", "{method} {path}");
                let known = &item[method.to_lowercase()]["responses"][status.to_string()]["description"];
                assert!(
                    known.as_str().is_some_and(|d| d.contains(&format!("`{code}`"))),
                    "{method} {path} answered {status} {code}, described as {known}"
                );
            }
        }
    }
}

#[test]
fn a_query_of_a_stored_shape_needs_no_body() {
    let document = document();
    for (path, required) in [
        ("/v1/query", false),
        ("/v1/query/batch", false),
        ("/v1/shapes", true),
    ] {
        let body = &document["paths"][path]["post"]["requestBody"];
        assert_eq!(body["required"] == true, required, "{path}");
    }
}

#[test]
fn every_operation_is_named_described_and_tagged() {
    let document = document();
    let mut ids = std::collections::BTreeSet::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let id = operation["operationId"].as_str().unwrap();
            assert!(id.contains('_'), "{id} is not verb_resource");
            assert!(ids.insert(id.to_owned()), "{id} twice");
            assert!(operation["summary"].is_string(), "{method} {path}");
            assert_eq!(operation["tags"].as_array().unwrap().len(), 1, "{method} {path}");
        }
    }
    assert_eq!(ids.len(), 37);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_service_serves_its_own_document() {
    let app = App::new();
    let yaml = app.get("/openapi.yaml").await;
    assert_eq!(yaml.header("content-type"), "application/yaml");
    assert!(yaml.text().starts_with("openapi: 3.1"));
    assert_eq!(app.get("/openapi.json").await.value(), document());
}

#[test]
fn the_manual_lists_every_problem() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/api.md");
    let manual = std::fs::read_to_string(path).unwrap();
    let listed: Vec<&str> = manual
        .lines()
        .filter(|l| l.starts_with("| `") && l.matches('|').count() == 4)
        .collect();
    for code in shapelex::http::problem::Code::ALL {
        let line = format!(
            "| `{}` | {} | {} |",
            code.name(),
            code.status().as_u16(),
            code.title()
        );
        assert!(listed.contains(&line.as_str()), "docs/api.md lacks: {line}");
    }
}
