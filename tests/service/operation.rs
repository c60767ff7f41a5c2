//! What those who run the service see.

use crate::harness::App;
use axum::body::Body;
use axum::http::Request;

#[tokio::test(flavor = "multi_thread")]
async fn probes_answer_and_readiness_names_what_is_wrong() {
    let app = App::new();
    assert_eq!(app.get("/healthz").await.value()["status"], "ok");
    assert_eq!(app.get("/readyz").await.value()["status"], "ready");
    app.state.stopping.cancel();
    let answer = app.get("/readyz").await;
    assert_eq!(answer.header("retry-after"), "2");
    assert_eq!(answer.fails(503, "not_ready")["checks"]["store"], "ok");
    assert_eq!(app.get("/healthz").await.status, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn metrics_exist_before_anything_happened() {
    let app = App::new();
    let text = app.get("/metrics").await.text();
    for series in [
        "shapelex_stage_seconds_bucket{stage=\"eigenpairs\",le=\"0.1\"}",
        "shapelex_stage_seconds_count{stage=\"ranking\"}",
        "shapelex_http_requests_total{operation=\"query_mesh\",status=\"5xx\"} 0",
        "shapelex_http_request_seconds_bucket{operation=\"create_class\",le=\"+Inf\"}",
        "shapelex_problems_total{code=\"overloaded\"}",
        "shapelex_jobs_pending",
        "shapelex_ready",
    ] {
        assert!(text.contains(series), "no {series} in:\n{text}");
    }
    app.get("/v1/nothing-here").await.fails(404, "route_not_found");
    let text = app.get("/metrics").await.text();
    assert!(!text.contains("nothing-here"), "labels must be bounded");
}

#[tokio::test(flavor = "multi_thread")]
async fn request_ids_go_through_or_are_made() {
    let app = App::new();
    let with = |id: &str| {
        Request::get("/v1/classes")
            .header("x-request-id", id)
            .body(Body::empty())
            .unwrap()
    };
    assert_eq!(app.send(with("abc-123")).await.header("x-request-id"), "abc-123");
    let long = "x".repeat(129);
    for bad in ["has space", long.as_str(), ""] {
        let made = app.send(with(bad)).await;
        assert_eq!(made.header("x-request-id").len(), 36, "{bad:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_pages_need_nothing_from_elsewhere() {
    let app = App::new();
    for path in ["/", "/docs"] {
        let page = app.get(path).await;
        assert_eq!(page.status, 200);
        assert!(page.header("content-type").starts_with("text/html"));
        assert!(
            page.header("content-security-policy")
                .contains("default-src 'none'")
        );
        let text = page.text();
        for outside in ["http://", "https://", "//cdn"] {
            assert!(!text.contains(outside), "{path} refers to {outside}");
        }
    }
}
