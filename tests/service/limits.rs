//! Limits per key, the audit log, and what browsers are told.

use crate::harness::{Answer, App};
use crate::meshes;
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};
use shapelex::model::KeyLimits;

struct Keyed {
    app: App,
    admin: String,
}

impl Keyed {
    async fn new(app: App) -> Self {
        let body = json!({"name": "root", "scope": "admin"}).to_string();
        let made = app.post_as_owner("/v1/keys", "application/json", body).await;
        assert_eq!(made.status, 201, "{}", made.text());
        let admin = made.value()["secret"].as_str().unwrap().to_owned();
        Self { app, admin }
    }

    async fn send(&self, secret: &str, method: &str, path: &str, kind: &str, body: Body) -> Answer {
        let request = Request::builder()
            .method(method)
            .uri(path)
            .header("x-api-key", secret)
            .header("content-type", kind)
            .body(body)
            .unwrap();
        self.app.send(request).await
    }

    async fn make(&self, body: Value) -> String {
        let body = Body::from(body.to_string());
        let answer = self
            .send(&self.admin, "POST", "/v1/keys", "application/json", body)
            .await;
        assert_eq!(answer.status, 201, "{}", answer.text());
        answer.value()["secret"].as_str().unwrap().to_owned()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn queries_per_minute_are_counted_per_key_and_per_mesh() {
    let keyed = Keyed::new(App::indexed().await).await;
    let slow = keyed
        .make(json!({"name": "slow", "scope": "read", "queries_per_minute": 3}))
        .await;
    let other = keyed
        .make(json!({"name": "other", "scope": "read", "queries_per_minute": 3}))
        .await;
    let mesh = || Body::from(meshes::off(meshes::CLASSES[0], 5));
    for left in ["2", "1", "0"] {
        let answer = keyed.send(&slow, "POST", "/v1/query", "model/off", mesh()).await;
        assert_eq!(answer.status, 200, "{}", answer.text());
        assert_eq!(answer.header("ratelimit-limit"), "3");
        assert_eq!(answer.header("ratelimit-remaining"), left);
    }
    let refused = keyed.send(&slow, "POST", "/v1/query", "model/off", mesh()).await;
    let wait: u64 = refused.header("retry-after").parse().unwrap();
    assert!((1..=20).contains(&wait), "{wait}");
    assert_eq!(refused.header("ratelimit-remaining"), "0");
    refused.fails(429, "rate_limited");
    // Listing costs nothing, and another key has its own.
    assert_eq!(
        keyed
            .send(&slow, "GET", "/v1/classes", "", Body::empty())
            .await
            .status,
        200
    );
    let (kind, body) = crate::harness::multipart(&[
        ("a.off", meshes::off(meshes::CLASSES[0], 5).as_ref()),
        ("b.off", meshes::off(meshes::CLASSES[1], 5).as_ref()),
        ("c.off", meshes::off(meshes::CLASSES[2], 5).as_ref()),
    ]);
    let batch = keyed
        .send(&other, "POST", "/v1/query/batch", &kind, Body::from(body.clone()))
        .await;
    assert_eq!(batch.status, 200, "{}", batch.text());
    assert_eq!(batch.header("ratelimit-remaining"), "0");
    let again = keyed
        .send(&other, "POST", "/v1/query/batch", &kind, Body::from(body))
        .await;
    again.fails(429, "rate_limited");
}

#[tokio::test(flavor = "multi_thread")]
async fn quotas_count_what_is_there_and_settings_count_where_a_key_is_silent() {
    let app = App::with(|c| {
        c.key_limits = KeyLimits {
            classes: Some(2),
            ..KeyLimits::default()
        };
    });
    let keyed = Keyed::new(app).await;
    let mesh = meshes::off(meshes::CLASSES[0], 0);
    let bytes = mesh.len();
    let writer = keyed
        .make(json!({"name": "w", "scope": "write", "max_stored_bytes": bytes + bytes / 2}))
        .await;
    let upload = |class: &str, pose: u32| {
        let path = format!("/v1/classes/{class}/shapes?create=true");
        let body = Body::from(meshes::off(meshes::CLASSES[0], pose));
        let (keyed, writer) = (&keyed, &writer);
        async move { keyed.send(writer, "POST", &path, "model/off", body).await }
    };
    assert_eq!(upload("a", 0).await.status, 201);
    let refused = upload("a", 1).await.fails(403, "quota_exceeded");
    assert_eq!(
        (&refused["quota"], &refused["used"]),
        (&json!("stored_bytes"), &json!(bytes))
    );
    let class = |name: &str| Body::from(json!({ "name": name }).to_string());
    let make = |name: &str| keyed.send(&writer, "POST", "/v1/classes", "application/json", class(name));
    assert_eq!(make("b").await.status, 201);
    assert_eq!(make("c").await.fails(403, "quota_exceeded")["limit"], 2);
    // What is deleted, by whomever, counts no more.
    for gone in ["a", "b"] {
        let path = format!("/v1/classes/{gone}");
        assert_eq!(
            keyed
                .send(&keyed.admin, "DELETE", &path, "", Body::empty())
                .await
                .status,
            204
        );
    }
    assert_eq!(upload("d", 1).await.status, 201);
    assert_eq!(make("e").await.status, 201);
}

/// Counts how many of many requests at the same time were granted.
async fn granted(requests: impl IntoIterator<Item = Request<Body>>, apps: &[App]) -> usize {
    let routers = apps.iter().cycle().map(|app| app.router.clone());
    let sent: Vec<_> = requests
        .into_iter()
        .zip(routers)
        .map(|(request, router)| tokio::spawn(tower::ServiceExt::oneshot(router, request)))
        .collect();
    let mut granted = 0;
    for answer in sent {
        let status = answer.await.unwrap().unwrap().status();
        assert!(status == 201 || status == 403, "{status}");
        granted += usize::from(status == 201);
    }
    granted
}

#[tokio::test(flavor = "multi_thread", worker_threads = 8)]
async fn a_quota_holds_however_many_ask_at_the_same_time_and_by_whatever_way() {
    let keyed = Keyed::new(App::new()).await;
    // Two handles of the same service, each with its own routes.
    let apps = [App::on(keyed.app.state.clone()), App::on(keyed.app.state.clone())];
    let request = |secret: &str, path: &str, kind: &str, body: Body| {
        Request::post(path)
            .header("x-api-key", secret)
            .header("content-type", kind)
            .body(body)
            .unwrap()
    };
    for round in 0..4 {
        let key = json!({"name": format!("few-{round}"), "scope": "write", "max_classes": 3});
        let few = keyed.make(key).await;
        let requests = (0..24).map(|i| match i % 2 {
            0 => {
                let body = json!({"name": format!("class {round} {i}")}).to_string();
                request(&few, "/v1/classes", "application/json", Body::from(body))
            }
            _ => {
                let path = format!("/v1/classes/filled-{round}-{i}/shapes?create=true");
                request(
                    &few,
                    &path,
                    "model/off",
                    Body::from(meshes::off(meshes::CLASSES[0], i)),
                )
            }
        });
        assert_eq!(granted(requests, &apps).await, 3);
    }

    let length = |pose| meshes::off(meshes::CLASSES[1], pose).len();
    let limit = (0..24).map(length).max().unwrap() * 3;
    let key = json!({"name": "bytes", "scope": "write", "max_stored_bytes": limit});
    let little = keyed.make(key).await;
    let made = keyed
        .send(
            &keyed.admin,
            "POST",
            "/v1/classes",
            "application/json",
            Body::from("{\"name\":\"shared\"}"),
        )
        .await;
    assert_eq!(made.status, 201);
    let requests = (0..24).map(|pose| {
        let path = match pose % 2 {
            0 => "/v1/classes/shared/shapes".to_owned(),
            _ => format!("/v1/classes/own-{pose}/shapes?create=true"),
        };
        request(
            &little,
            &path,
            "model/off",
            Body::from(meshes::off(meshes::CLASSES[1], pose)),
        )
    });
    let granted = granted(requests, &apps).await;
    let id = keyed
        .app
        .state
        .store
        .api_keys()
        .unwrap()
        .iter()
        .find(|k| k.name.as_str() == "bytes")
        .unwrap()
        .id;
    let usage = keyed.app.state.store.usage(id).unwrap();
    assert!(usage.bytes <= limit as u64, "{usage:?} of {limit}");
    assert!(
        granted >= 3 && usage.shapes == granted as u64,
        "{granted} {usage:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn every_write_and_every_refused_one_is_in_the_audit_log() {
    let keyed = Keyed::new(App::new()).await;
    let reader = keyed.make(json!({"name": "viewer", "scope": "read"})).await;
    let class = || Body::from(json!({"name": "dog"}).to_string());
    keyed
        .send(&keyed.admin, "POST", "/v1/classes", "application/json", class())
        .await;
    keyed
        .send(&reader, "POST", "/v1/classes", "application/json", class())
        .await;
    keyed
        .send("slx_wrong", "DELETE", "/v1/classes/dog", "", Body::empty())
        .await;
    keyed.send(&reader, "GET", "/v1/classes", "", Body::empty()).await;
    let text = std::fs::read_to_string(keyed.app.state.store.path().join("audit.log")).unwrap();
    let lines: Vec<Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let told: Vec<(&str, &str, &str)> = lines
        .iter()
        .map(|l| {
            (
                l["who"].as_str().unwrap(),
                l["operation"].as_str().unwrap(),
                l["outcome"].as_str().unwrap(),
            )
        })
        .collect();
    assert_eq!(
        told,
        [
            ("anonymous", "create_key", "done"),
            ("root", "create_key", "done"),
            ("root", "create_class", "done"),
            ("viewer", "create_class", "insufficient_scope"),
            ("anonymous", "delete_class", "unauthorized"),
        ]
    );
    assert!(
        lines
            .iter()
            .all(|l| l["request_id"].is_string() && l["at"].is_string())
    );
    assert!(!text.contains("slx_"), "no secret is ever written");
}

#[tokio::test(flavor = "multi_thread")]
async fn other_sites_are_kept_out_unless_they_are_named() {
    let preflight = || {
        Request::builder()
            .method("OPTIONS")
            .uri("/v1/query")
            .header("origin", "https://viewer.example")
            .header("access-control-request-method", "POST")
            .body(Body::empty())
            .unwrap()
    };
    let closed = App::new();
    let answer = closed.send(preflight()).await;
    assert_eq!(answer.header("access-control-allow-origin"), "");
    let open = App::with(|c| c.cors_origins = vec!["https://viewer.example".to_owned()]);
    let answer = open.send(preflight()).await;
    assert_eq!(answer.status, 200);
    assert_eq!(
        answer.header("access-control-allow-origin"),
        "https://viewer.example"
    );
    let other = Request::get("/healthz").header("origin", "https://evil.example");
    let answer = open.send(other.body(Body::empty()).unwrap()).await;
    assert_eq!(answer.header("access-control-allow-origin"), "");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_answer_has_the_headers_that_keep_browsers_careful() {
    let app = App::new();
    for path in ["/", "/docs", "/v1/classes", "/nowhere"] {
        let answer = app.get(path).await;
        assert_eq!(answer.header("x-content-type-options"), "nosniff", "{path}");
        assert_eq!(answer.header("referrer-policy"), "no-referrer", "{path}");
        let policy = answer.header("content-security-policy").to_owned();
        assert!(policy.contains("frame-ancestors 'none'"), "{path}: {policy}");
    }
}
