//! Pages of other sites, and other programs of the same machine, at a service without keys.

use crate::harness::{Answer, App, multipart};
use crate::meshes::off;
use axum::body::Body;
use axum::http::Request;
use serde_json::json;

/// What a page can send anywhere without asking there first, and what it would do.
fn simple_requests() -> Vec<(&'static str, &'static str, &'static str, Body)> {
    let (form, files) = multipart(&[("evil.off", off("bean", 1).as_ref())]);
    let form: &'static str = form.leak();
    vec![
        (
            "POST",
            "/v1/classes",
            "text/plain",
            Body::from(r#"{"name":"evil"}"#),
        ),
        (
            "POST",
            "/v1/classes",
            "application/x-www-form-urlencoded",
            Body::from(r#"{"name":"evil"}"#),
        ),
        ("POST", "/v1/classes", "", Body::from(r#"{"name":"evil"}"#)),
        ("POST", "/v1/reindex", "", Body::empty()),
        (
            "POST",
            "/v1/classes/evil/shapes?create=true",
            form,
            Body::from(files.clone()),
        ),
        (
            "POST",
            "/v1/classes/evil/shapes?create=true",
            "text/plain",
            Body::from(off("bean", 1)),
        ),
        ("POST", "/v1/query", form, Body::from(files.clone())),
        ("POST", "/v1/query/batch", form, Body::from(files)),
        (
            "POST",
            "/v1/keys",
            "text/plain",
            Body::from(r#"{"name":"evil","scope":"admin"}"#),
        ),
        ("POST", "/v1/snapshots", "", Body::empty()),
        ("POST", "/v1/snapshots/restore", "text/plain", Body::from("x")),
        ("PUT", "/v1/classes", "", Body::empty()),
        ("DELETE", "/v1/classes/dog", "", Body::empty()),
        (
            "PATCH",
            "/v1/classes/dog",
            "text/plain",
            Body::from(r#"{"name":"evil"}"#),
        ),
    ]
}

async fn send(app: &App, headers: &[(&str, &str)], request: (&str, &str, &str, Body)) -> Answer {
    let (method, path, media_type, body) = request;
    let mut builder = Request::builder()
        .method(method)
        .uri(path)
        .header("host", "127.0.0.1:7345");
    for (name, value) in headers {
        builder = builder.header(*name, *value);
    }
    if !media_type.is_empty() {
        builder = builder.header("content-type", media_type);
    }
    app.send(builder.body(body).unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_another_site_changes_nothing() {
    let app = App::new();
    app.json("POST", "/v1/classes", json!({"name": "dog"})).await;
    let foreign: &[&[(&str, &str)]] = &[
        &[("origin", "https://evil.example")],
        &[("origin", "null")],
        &[("origin", "http://127.0.0.1:8000")],
        &[("origin", "http://localhost:7345")],
        &[
            ("origin", "http://127.0.0.1:7345"),
            ("origin", "https://evil.example"),
        ],
        &[("origin", "http://127.0.0.1:7345.evil.example")],
        &[("origin", "ftp://127.0.0.1:7345")],
        &[("origin", "")],
        &[("sec-fetch-site", "cross-site")],
        &[("sec-fetch-site", "same-site")],
        &[
            ("origin", "http://127.0.0.1:7345"),
            ("sec-fetch-site", "cross-site"),
        ],
    ];
    for headers in foreign {
        for request in simple_requests() {
            let what = format!("{headers:?} {} {}", request.0, request.1);
            let answer = send(&app, headers, request).await;
            assert_eq!(answer.problem(), (403, "cross_site_request".to_owned()), "{what}");
        }
    }
    let classes = app.get("/v1/classes").await.value();
    assert_eq!(classes["items"].as_array().unwrap().len(), 1);
    assert_eq!(classes["items"][0]["name"], "dog");
    assert!(app.state.keys.is_empty() && app.get("/v1/jobs").await.value()["items"] == json!([]));
    // What it may not do is in the audit log.
    let log = std::fs::read_to_string(app.state.store.path().join("audit.log")).unwrap();
    assert!(log.contains("\"create_key\"") && log.contains("cross_site_request"));
}

#[tokio::test(flavor = "multi_thread")]
async fn programs_the_services_own_page_and_named_origins_are_served() {
    let app = App::with(|c| c.cors_origins = vec!["https://viewer.example".to_owned()]);
    let own: &[&[(&str, &str)]] = &[
        &[],
        &[
            ("origin", "http://127.0.0.1:7345"),
            ("sec-fetch-site", "same-origin"),
        ],
        &[("origin", "http://127.0.0.1:7345")],
        &[("sec-fetch-site", "none")],
        &[
            ("origin", "https://viewer.example"),
            ("sec-fetch-site", "cross-site"),
        ],
    ];
    for (i, headers) in own.iter().enumerate() {
        let body = Body::from(json!({"name": format!("class {i}")}).to_string());
        let made = send(&app, headers, ("POST", "/v1/classes", "application/json", body)).await;
        assert_eq!(made.status, 201, "{headers:?} {}", made.text());
    }
    let read = send(
        &app,
        &[("origin", "https://evil.example")],
        ("GET", "/v1/classes", "", Body::empty()),
    )
    .await;
    assert_eq!(
        read.status, 200,
        "a page may send a GET; it cannot read the answer"
    );
    assert_eq!(read.header("access-control-allow-origin"), "");
    assert_eq!(read.header("cross-origin-resource-policy"), "same-origin");
    let all = App::with(|c| c.cors_origins = vec!["*".to_owned()]);
    let body = Body::from(r#"{"name":"x"}"#);
    let any = send(
        &all,
        &[("origin", "null")],
        ("POST", "/v1/classes", "application/json", body),
    )
    .await;
    assert_eq!(any.status, 201);
}

#[tokio::test(flavor = "multi_thread")]
async fn behind_a_proxy_the_configured_name_is_the_services_own() {
    let app = App::with(|c| c.hosts = vec!["shapes.example".to_owned()]);
    let send = |host: &str, origin: &str, name: &str| {
        let request = Request::post("/v1/classes")
            .header("host", host)
            .header("origin", origin)
            .header("sec-fetch-site", "same-origin")
            .header("content-type", "application/json")
            .body(Body::from(json!({ "name": name }).to_string()))
            .unwrap();
        app.send(request)
    };
    // The proxy passes the name on, or not.
    assert_eq!(
        send("shapes.example", "https://shapes.example", "a").await.status,
        201
    );
    assert_eq!(
        send("127.0.0.1:7345", "https://shapes.example", "b").await.status,
        201
    );
    send("other.example", "https://other.example", "c")
        .await
        .fails(421, "misdirected_request");
    send("shapes.example", "https://other.example", "c")
        .await
        .fails(403, "cross_site_request");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_name_that_was_bound_to_this_machine_reads_nothing() {
    let app = App::new();
    let get = |host: &str, path: &str| {
        app.send(
            Request::get(path)
                .header("host", host)
                .body(Body::empty())
                .unwrap(),
        )
    };
    for path in [
        "/",
        "/v1/classes",
        "/v1/index",
        "/metrics",
        "/openapi.json",
        "/v1/snapshots",
        "/nowhere",
    ] {
        let refused = get("evil.test:7345", path)
            .await
            .fails(421, "misdirected_request");
        assert!(
            refused["detail"].as_str().unwrap().contains("--host"),
            "{refused}"
        );
    }
    for path in ["/healthz", "/readyz"] {
        assert_eq!(get("10.244.1.7:7345", path).await.status, 200, "{path}");
    }
    assert_eq!(get("LOCALHOST.:1", "/v1/classes").await.status, 200);
    for host in ["[::1].evil.test", "[::1]evil", "localhost:x", "localhost:99999"] {
        get(host, "/v1/classes").await.fails(421, "misdirected_request");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_on_another_port_of_a_configured_name_is_a_page_of_another_site() {
    let app = App::with(|c| c.hosts = vec!["shapes.example".to_owned()]);
    let post = |origin: &'static str, name: &str| {
        app.send(
            Request::post("/v1/classes")
                .header("host", "shapes.example:7345")
                .header("origin", origin)
                .header("content-type", "application/json")
                .body(Body::from(json!({"name": name}).to_string()))
                .unwrap(),
        )
    };
    for origin in [
        "http://shapes.example:8080",
        "https://shapes.example:8443",
        "http://a@shapes.example:7345",
    ] {
        post(origin, "evil").await.fails(403, "cross_site_request");
    }
    for (origin, name) in [
        ("http://shapes.example:7345", "same"),
        ("https://shapes.example", "proxy"),
    ] {
        assert_eq!(post(origin, name).await.status, 201, "{origin}");
    }
}

#[test]
fn beyond_loopback_names_matter_where_no_key_does() {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let app = App::with(|c| {
        c.listen = "0.0.0.0:7345".parse().unwrap();
        c.allow_anonymous = true;
    });
    let get = |host: &str| {
        app.send(
            Request::get("/v1/classes")
                .header("host", host)
                .body(Body::empty())
                .unwrap(),
        )
    };
    runtime.block_on(async {
        assert_eq!(
            get("10.0.0.7:7345").await.status,
            200,
            "an address of this machine"
        );
        get("evil.test").await.fails(421, "misdirected_request");
        let body = json!({"name": "root", "scope": "admin"}).to_string();
        let made = app.post_as_owner("/v1/keys", "application/json", body).await;
        assert_eq!(made.status, 201, "{}", made.text());
        get("shapes.example").await.fails(401, "unauthorized");
    });
}

#[tokio::test(flavor = "multi_thread")]
async fn json_is_read_where_it_says_that_it_is_json() {
    let app = App::new();
    let post = |path: &'static str, media_type: Option<&'static str>, body: &'static str| {
        app.call("POST", path, media_type, body)
    };
    for media_type in [
        None,
        Some("text/plain"),
        Some("application/x-www-form-urlencoded"),
        Some("multipart/form-data; boundary=x"),
        Some("application/jsonx"),
        Some("text/json"),
    ] {
        post("/v1/classes", media_type, r#"{"name":"a"}"#)
            .await
            .fails(415, "unsupported_media_type");
        post("/v1/reindex", media_type, r#"{"scope":"all"}"#)
            .await
            .fails(415, "unsupported_media_type");
    }
    for (name, media_type) in [
        ("a", "application/json"),
        ("b", "Application/JSON; charset=utf-8"),
        ("c", "application/merge-patch+json"),
    ] {
        let made = app
            .post("/v1/classes", media_type, json!({ "name": name }).to_string())
            .await;
        assert_eq!(made.status, 201, "{media_type}: {}", made.text());
    }
    // Without a body there is nothing to be told about; nothing to learn from is the index's answer.
    post("/v1/reindex", None, "").await.fails(409, "nothing_to_index");
    for media_type in ["", "text/plain", "application/x-www-form-urlencoded"] {
        app.post_as_owner("/v1/snapshots/restore", media_type, "x")
            .await
            .fails(415, "unsupported_media_type");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_and_restores_need_the_token_until_there_is_a_key() {
    let app = App::new();
    let key = || json!({"name": "root", "scope": "admin"});
    let snapshot = app.post("/v1/snapshots", "", "").await.value();
    let restore = format!("/v1/snapshots/{}/restore", snapshot["id"].as_str().unwrap());
    app.json("POST", "/v1/keys", key())
        .await
        .fails(401, "unauthorized");
    app.get("/v1/keys").await.fails(401, "unauthorized");
    app.delete("/v1/keys/x").await.fails(401, "unauthorized");
    app.post(&restore, "", "").await.fails(401, "unauthorized");
    app.post("/v1/snapshots/restore", "application/zstd", "x")
        .await
        .fails(401, "unauthorized");
    let token = app.state.local_token.secret().to_owned();
    let with = |secret: &str, method: &str, path: &str| {
        let request = Request::builder()
            .method(method)
            .uri(path)
            .header("authorization", format!("Bearer {secret}"));
        app.send(request.body(Body::empty()).unwrap())
    };
    for wrong in ["slt_", &token[..token.len() - 1], &format!("{token}x"), ""] {
        with(wrong, "GET", "/v1/keys").await.fails(401, "unauthorized");
    }
    assert_eq!(with(&token, "GET", "/v1/keys").await.status, 200);
    assert_eq!(with(&token, "POST", &restore).await.status, 200);
    let made = app
        .post_as_owner("/v1/keys", "application/json", key().to_string())
        .await;
    assert_eq!(made.status, 201, "{}", made.text());
    // From the first key on it opens nothing.
    for path in ["/v1/keys", "/v1/classes"] {
        with(&token, "GET", path).await.fails(401, "unauthorized");
    }
    let log = std::fs::read_to_string(app.state.store.path().join("audit.log")).unwrap();
    assert!(!log.contains("slt_"), "{log}");
}
