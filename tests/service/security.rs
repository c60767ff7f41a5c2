//! Who gets in, and what the service says to those it keeps out.

use crate::harness::{Answer, App};
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};
use shapelex::http::access::Access;
use shapelex::http::{AppState, OpenError, ServiceConfig};
use shapelex::model::Scope;

async fn with_key(app: &App, secret: &str, method: &str, path: &str, body: Option<Value>) -> Answer {
    let mut request = Request::builder().method(method).uri(path);
    if !secret.is_empty() {
        request = request.header("authorization", format!("Bearer {secret}"));
    }
    let body = match body {
        Some(body) => {
            request = request.header("content-type", "application/json");
            Body::from(body.to_string())
        }
        None => Body::empty(),
    };
    app.send(request.body(body).unwrap()).await
}

async fn make(app: &App, by: &str, body: Value) -> String {
    // While there is no key, the owner of the data directory makes the first.
    let by = if by.is_empty() {
        app.state.local_token.secret()
    } else {
        by
    };
    let answer = with_key(app, by, "POST", "/v1/keys", Some(body)).await;
    assert_eq!(answer.status, 201, "{}", answer.text());
    assert_eq!(answer.header("cache-control"), "no-store");
    answer.value()["secret"].as_str().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_are_off_until_the_first_and_then_every_request_needs_one() {
    let app = App::new();
    assert_eq!(app.get("/v1/classes").await.status, 200);
    let admin = make(&app, "", json!({"name": "root", "scope": "admin"})).await;
    assert!(admin.starts_with("slx_") && admin.len() == 47, "{admin}");
    let refused = app.get("/v1/classes").await;
    assert!(refused.header("www-authenticate").starts_with("Bearer"));
    refused.fails(401, "unauthorized");
    for public in [
        "/healthz",
        "/readyz",
        "/",
        "/docs",
        "/openapi.yaml",
        "/openapi.json",
    ] {
        assert_eq!(app.get(public).await.status, 200, "{public}");
    }
    app.get("/metrics").await.fails(401, "unauthorized");
    app.get("/nowhere").await.fails(404, "route_not_found");
    assert_eq!(
        with_key(&app, &admin, "GET", "/v1/classes", None).await.status,
        200
    );
    let other_header = Request::get("/v1/classes").header("x-api-key", &admin);
    assert_eq!(
        app.send(other_header.body(Body::empty()).unwrap()).await.status,
        200
    );
    for wrong in ["slx_", "nonsense", &admin[..46], &format!("{admin}x")] {
        with_key(&app, wrong, "GET", "/v1/classes", None)
            .await
            .fails(401, "unauthorized");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn scopes_include_the_smaller_ones_and_no_more() {
    let app = App::new();
    let admin = make(&app, "", json!({"name": "root", "scope": "admin"})).await;
    let write = make(&app, &admin, json!({"name": "uploader", "scope": "write"})).await;
    let read = make(&app, &admin, json!({"name": "viewer", "scope": "read"})).await;
    let class = || Some(json!({"name": "dog"}));
    let refused = with_key(&app, &read, "POST", "/v1/classes", class()).await;
    assert!(refused.header("www-authenticate").contains("insufficient_scope"));
    assert_eq!(refused.fails(403, "insufficient_scope")["needed"], "write");
    assert_eq!(
        with_key(&app, &write, "POST", "/v1/classes", class())
            .await
            .status,
        201
    );
    assert_eq!(
        with_key(&app, &read, "GET", "/v1/classes/dog", None).await.status,
        200
    );
    assert_eq!(with_key(&app, &write, "GET", "/metrics", None).await.status, 200);
    with_key(&app, &write, "GET", "/v1/keys", None)
        .await
        .fails(403, "insufficient_scope");
    let listed = with_key(&app, &admin, "GET", "/v1/keys", None).await;
    for secret in [&admin, &write, &read] {
        assert!(!listed.text().contains(secret.as_str()), "secrets are shown once");
    }
    let names: Vec<Value> = listed.value()["items"]
        .as_array()
        .unwrap()
        .iter()
        .map(|k| k["name"].clone())
        .collect();
    assert_eq!(names, ["root", "uploader", "viewer"]);
    let gone = with_key(&app, &admin, "DELETE", "/v1/keys/viewer", None).await;
    assert_eq!(gone.status, 204);
    with_key(&app, &read, "GET", "/v1/classes", None)
        .await
        .fails(401, "unauthorized");
    with_key(&app, &admin, "DELETE", "/v1/keys/viewer", None)
        .await
        .fails(404, "key_not_found");
    with_key(&app, &admin, "DELETE", "/v1/keys/root", None)
        .await
        .fails(409, "last_admin_key");
    with_key(&app, &admin, "DELETE", "/v1/keys/uploader", None).await;
    assert_eq!(
        with_key(&app, &admin, "DELETE", "/v1/keys/root", None)
            .await
            .status,
        204
    );
    // The last key is gone, but the doors stay shut.
    app.get("/v1/classes").await.fails(401, "unauthorized");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_a_key_is_refused() {
    let app = App::new();
    let refuse = |body: Value| {
        let app = &app;
        async move {
            with_key(
                app,
                app.state.local_token.secret(),
                "POST",
                "/v1/keys",
                Some(body),
            )
            .await
        }
    };
    refuse(json!({"name": "a", "scope": "read"}))
        .await
        .fails(422, "invalid_field");
    let end = "2999-01-01T00:00:00Z";
    refuse(json!({"name": "a", "scope": "admin", "expires_at": end}))
        .await
        .fails(422, "invalid_field");
    refuse(json!({"name": "two words", "scope": "admin"}))
        .await
        .fails(422, "invalid_name");
    refuse(json!({"name": "a", "scope": "root"}))
        .await
        .fails(422, "invalid_field");
    let admin = make(&app, "", json!({"name": "a", "scope": "admin"})).await;
    for body in [
        json!({"name": "b", "scope": "read", "expires_at": "2001-01-01T00:00:00Z"}),
        json!({"name": "b", "scope": "read", "expires_at": "tomorrow"}),
        json!({"name": "b", "scope": "read", "queries_per_minute": 0}),
        json!({"name": "b", "scope": "read", "secret": "slx_mine"}),
    ] {
        with_key(&app, &admin, "POST", "/v1/keys", Some(body.clone()))
            .await
            .fails(422, "invalid_field");
    }
    let again = json!({"name": "a", "scope": "read"});
    with_key(&app, &admin, "POST", "/v1/keys", Some(again))
        .await
        .fails(409, "key_exists");
    let soon = jiff::Timestamp::now() + jiff::SignedDuration::from_millis(300);
    let short = json!({"name": "short", "scope": "read", "expires_at": soon.to_string()});
    let short = make(&app, &admin, short).await;
    assert_eq!(
        with_key(&app, &short, "GET", "/v1/classes", None).await.status,
        200
    );
    tokio::time::sleep(std::time::Duration::from_millis(350)).await;
    let expired = with_key(&app, &short, "GET", "/v1/classes", None).await;
    assert!(
        expired.fails(401, "unauthorized")["detail"]
            .as_str()
            .unwrap()
            .contains("expired")
    );
}

#[test]
fn keys_survive_a_restart_and_are_stored_as_hashes_only() {
    let directory = tempfile::tempdir().unwrap();
    let config = || ServiceConfig {
        data_dir: directory.path().to_owned(),
        ..ServiceConfig::default()
    };
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let secret = {
        let app = App::on(AppState::open(config()).unwrap());
        runtime.block_on(make(&app, "", json!({"name": "root", "scope": "admin"})))
    };
    for part in ["sled", "catalogue.log"] {
        for file in files_below(&directory.path().join(part)) {
            let bytes = std::fs::read(&file).unwrap();
            let found = bytes
                .windows(secret.len() - 4)
                .any(|w| w == &secret.as_bytes()[4..]);
            assert!(!found, "the secret is in {}", file.display());
        }
    }
    // Also where the records have to be rebuilt from the log.
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    let app = App::on(AppState::open(config()).unwrap());
    runtime.block_on(async {
        app.get("/v1/classes").await.fails(401, "unauthorized");
        assert_eq!(
            with_key(&app, &secret, "GET", "/v1/classes", None).await.status,
            200
        );
    });
}

fn files_below(path: &std::path::Path) -> Vec<std::path::PathBuf> {
    if path.is_file() {
        return vec![path.to_owned()];
    }
    std::fs::read_dir(path)
        .unwrap()
        .flat_map(|entry| files_below(&entry.unwrap().path()))
        .collect()
}

#[test]
fn beyond_loopback_nobody_is_served_without_a_key_unless_allowed() {
    let directory = tempfile::tempdir().unwrap();
    let config = |allow| ServiceConfig {
        data_dir: directory.path().to_owned(),
        listen: "0.0.0.0:0".parse().unwrap(),
        allow_anonymous: allow,
        ..ServiceConfig::default()
    };
    let refused = AppState::open(config(false)).err().unwrap();
    assert!(matches!(refused, OpenError::Unguarded { .. }), "{refused}");
    assert!(refused.to_string().contains("shapelex keys create"), "{refused}");
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let app = App::on(AppState::open(config(true)).unwrap());
    let secret = runtime.block_on(async {
        assert_eq!(app.get("/v1/classes").await.status, 200);
        make(&app, "", json!({"name": "root", "scope": "admin"})).await
    });
    drop(app);
    let app = App::on(AppState::open(config(false)).unwrap());
    runtime.block_on(async {
        app.get("/v1/classes").await.fails(401, "unauthorized");
        assert_eq!(
            with_key(&app, &secret, "GET", "/v1/classes", None).await.status,
            200
        );
    });
}

#[test]
fn what_changes_something_needs_more_than_to_read() {
    for route in shapelex::http::routes::routes() {
        let info = route.info;
        let Some(scope) = info.access.scope() else {
            assert_eq!(info.method, "GET", "{}: only reading is public", info.path);
            continue;
        };
        let changes = info.method != "GET" && !info.path.starts_with("/v1/query");
        assert!(
            !changes || scope >= Scope::Write,
            "{} {} changes something",
            info.method,
            info.path
        );
        let hands_over = info.path.starts_with("/v1/keys") || info.path.ends_with("/restore");
        assert_eq!(info.access == Access::Owner, hands_over, "{}", info.path);
    }
}
