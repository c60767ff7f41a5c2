//! What those who run the service see.

use crate::harness::App;
use crate::meshes::dense;
use axum::Router;
use axum::body::Body;
use axum::http::Request;
use axum::routing::get;
use serde_json::json;
use shapelex::http::middleware::around;
use shapelex::http::operation::Operations;
use std::time::Duration;

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

#[tokio::test(flavor = "multi_thread")]
async fn a_panic_is_a_problem_and_is_counted() {
    let mut app = App::new();
    let boom = || async {
        if true {
            panic!("on purpose");
        }
    };
    let boom = Router::new().route("/boom", get(boom));
    app.router = around(boom, &app.state, Operations::default()).with_state(app.state.clone());
    let body = app.get("/boom").await.fails(500, "internal");
    assert!(
        !body.to_string().contains("on purpose"),
        "what went wrong is for the log: {body}"
    );
    let text = shapelex::http::gauges::render(&app.state);
    let count = text
        .lines()
        .find_map(|l| l.strip_prefix("shapelex_panics_total "));
    assert_ne!(count, Some("0"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_house_turns_away_and_says_when_to_come_back() {
    let app = App::with(|c| {
        c.query_threads = 1;
        c.query_queue = 1;
        c.query_wait = Duration::from_secs(30);
    });
    let dense = dense().off();
    let path = |i: u32| format!("/v1/classes/c{i}/shapes?create=true");
    let (a, b, c) = (path(1), path(2), path(3));
    let (a, b, c) = tokio::join!(
        app.post(&a, "model/off", dense.clone()),
        app.post(&b, "model/off", dense.clone()),
        app.post(&c, "model/off", dense.clone()),
    );
    let mut statuses = [&a, &b, &c].map(|r| r.status.as_u16());
    statuses.sort_unstable();
    assert_eq!(statuses, [201, 201, 503]);
    let refused = [&a, &b, &c].into_iter().find(|r| r.status == 503).unwrap();
    assert_eq!(refused.fails(503, "overloaded")["retry_after_seconds"], 30);
    assert_eq!(refused.header("retry-after"), "30");
}

/// A grid of `side`² vertices with bumps, as OFF.
fn scan(side: usize) -> Vec<u8> {
    let mut text = format!("OFF\n{} {} 0\n", side * side, 2 * (side - 1) * (side - 1));
    for i in 0..side * side {
        let (x, y) = ((i % side) as f64, (i / side) as f64);
        text += &format!("{x} {y} {}\n", 8.0 * (0.07 * x).sin() * (0.05 * y).cos());
    }
    for i in 0..side - 1 {
        for j in 0..side - 1 {
            let a = i * side + j;
            text += &format!("3 {a} {} {}\n", a + 1, a + side + 1);
            text += &format!("3 {a} {} {}\n", a + side + 1, a + side);
        }
    }
    text.into_bytes()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_thread_is_free_soon_after_the_deadline_in_whatever_stage() {
    let indexed = App::indexed().await;
    let parameters = json!({"eigenpairs": 400, "part_eigenpairs": 400, "working_size": 20_000, "atoms": 12,
                            "iterations": 2, "samples_per_shape": 100});
    let job = indexed.reindex(json!({"parameters": parameters})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let scan = scan(400);
    let mut freed = Vec::new();
    for milliseconds in [5, 30, 80, 150, 300, 600, 1000] {
        let limit = Duration::from_millis(milliseconds);
        let state = indexed.state.clone();
        let body = scan.clone();
        // As a client that leaves does it: the request is dropped.
        let left = tokio::time::timeout(limit, indexed.post("/v1/query", "model/off", body)).await;
        let began = std::time::Instant::now();
        // What was reserved is given back, too.
        while state.compute.running() + state.unpacking.running() > 0 || state.memory.used() > 0 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        println!(
            "left after {limit:?}: free after {:?}, {}",
            began.elapsed(),
            left.is_err()
        );
        freed.push(began.elapsed());
    }
    freed.sort_unstable();
    let median = freed[freed.len() / 2];
    assert!(median < Duration::from_millis(100), "{freed:?}");
    assert!(freed[freed.len() - 1] < Duration::from_secs(1), "{freed:?}");
}

#[tokio::test]
async fn a_mesh_that_does_not_fit_the_memory_is_refused_before_it_is_built() {
    let app = App::with(|config| config.memory_bytes = 200 << 10);
    let mesh = crate::meshes::off("bean", 0);
    let long = [&mesh[..], &vec![b'\n'; 40 << 10]].concat();
    let path = "/v1/classes/bean/shapes?create=true";
    let refused = app
        .post(path, "model/off", long)
        .await
        .fails(413, "mesh_too_large");
    assert_eq!(refused["limit"], 200 << 10);
    assert_eq!(app.get("/v1/classes").await.value()["items"], json!([]));
    assert_eq!(app.state.memory.used(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn metrics_tell_of_the_process_the_build_the_jobs_and_the_verdicts() {
    let app = App::indexed().await;
    let query = app
        .post("/v1/query", "model/off", crate::meshes::off("bean", 9))
        .await;
    assert_eq!(query.status, 200);
    let metrics = app.get("/metrics").await.text();
    let value = |series: &str| -> f64 {
        let line = metrics.lines().find(|line| line.starts_with(series));
        let value = line.and_then(|line| line.rsplit(' ').next());
        value.unwrap_or_else(|| panic!("no {series}")).parse().unwrap()
    };
    assert!(value("process_cpu_seconds_total") > 0.0);
    assert!(value("process_resident_memory_bytes") > 1e6);
    assert!(value("process_open_fds") > 2.0);
    assert!(value("process_threads") > 1.0);
    let build = format!("shapelex_build_info{{version=\"{}\"}}", env!("CARGO_PKG_VERSION"));
    assert_eq!(value(&build), 1.0);
    // Other tests of this process run jobs and queries too.
    assert!(value("shapelex_jobs_total{outcome=\"succeeded\"}") >= 1.0);
    assert!(value("shapelex_job_seconds_count{outcome=\"succeeded\"}") >= 1.0);
    for verdict in ["known", "none_of_these", "not_judged"] {
        value(&format!("shapelex_query_answers_total{{verdict=\"{verdict}\"}}"));
    }
    let judged: f64 = ["known", "none_of_these"]
        .map(|verdict| value(&format!("shapelex_query_answers_total{{verdict=\"{verdict}\"}}")))
        .iter()
        .sum();
    assert!(value("shapelex_query_p_value_count") >= judged.min(1.0));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reindex_that_does_not_fit_its_memory_fails_and_names_the_numbers() {
    let app = App::with(|config| config.indexing_memory_bytes = 48 << 20);
    for class in crate::meshes::CLASSES {
        for pose in 0..2 {
            let path = format!("/v1/classes/{class}/shapes?create=true&name={pose}.off");
            let answer = app
                .post(&path, "model/off", crate::meshes::off(class, pose))
                .await;
            assert_eq!(answer.status, 201, "{}", answer.text());
        }
    }
    // What fits runs, if need be one shape at a time.
    let job = app.reindex(json!({"parameters": crate::harness::small()})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    for (parameter, value) in [("refine_below", 100_000), ("atoms", 5000)] {
        let mut parameters = crate::harness::small();
        parameters[parameter] = json!(value);
        parameters["samples_per_shape"] = json!(0);
        parameters["energies"] = json!(2000);
        let job = app
            .reindex(json!({"scope": "all", "parameters": parameters}))
            .await;
        assert_eq!(job["state"], "failed", "{parameter}: {job}");
        assert_eq!(job["failure"]["code"], "memory_exceeded", "{parameter}: {job}");
        let detail = job["failure"]["detail"].as_str().unwrap();
        assert!(
            detail.contains("MiB") && detail.contains("--indexing-memory-mib"),
            "{detail}"
        );
    }
    // The index that is served stays.
    let answer = app
        .post("/v1/query", "model/off", crate::meshes::off("bean", 5))
        .await;
    assert_eq!(answer.status, 200, "{}", answer.text());
}
