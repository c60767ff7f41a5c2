//! Traces, as a collector gets them: the real process sends, a route of this test takes.
//!
//! `cargo test --release --features otlp --test otlp`
#![cfg(feature = "otlp")]

mod protobuf;

use axum::Router;
use axum::body::Bytes;
use axum::http::StatusCode;
use axum::routing::post;
use protobuf::Span;
use shapelex_eval::sample::{ZooOptions, creatures, species, write_obj};
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const TRACE: &str = "4bf92f3577b34da6a3ce929d0e0e4736";
const CALLER: &str = "00f067aa0ba902b7";

/// The service; killed when dropped.
struct Service {
    child: Child,
    url: String,
}

impl Service {
    fn start(collector: SocketAddr, data: &std::path::Path) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_shapelex"))
            .args([
                "serve",
                "--listen",
                "127.0.0.1:0",
                "--json",
                "--log",
                "error",
                "--data",
            ])
            .arg(data)
            .args(["--otlp-endpoint", &format!("http://{collector}")])
            .env("OTEL_BSP_SCHEDULE_DELAY", "100")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        let told: serde_json::Value = serde_json::from_str(&line).unwrap();
        Self {
            child,
            url: told["listening"].as_str().unwrap().to_owned(),
        }
    }

    fn send(&self, path: &str, body: &[u8], headers: &[(&str, &str)]) -> (u16, String) {
        let agent: ureq::Agent = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .proxy(None)
            .build()
            .into();
        let mut request = agent.post(format!("{}{path}", self.url));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let mut answer = request.send(body).unwrap();
        let text = answer.body_mut().read_to_string().unwrap();
        (answer.status().as_u16(), text)
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A collector that remembers every span.
async fn collector() -> (SocketAddr, Arc<Mutex<Vec<Span>>>) {
    let spans: Arc<Mutex<Vec<Span>>> = Arc::default();
    let taken = spans.clone();
    let take = move |body: Bytes| {
        taken.lock().unwrap().extend(protobuf::spans(&body));
        std::future::ready(StatusCode::OK)
    };
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let router = Router::new().route("/v1/traces", post(take));
    tokio::spawn(async move { axum::serve(listener, router).await });
    (address, spans)
}

/// Waits until the collector has a span for which this holds.
fn wait_for(spans: &Mutex<Vec<Span>>, what: &str, holds: impl Fn(&Span) -> bool) -> Span {
    let began = Instant::now();
    loop {
        let found = spans.lock().unwrap().iter().find(|s| holds(s)).cloned();
        if let Some(span) = found {
            return span;
        }
        let names: Vec<String> = spans.lock().unwrap().iter().map(|s| s.name.clone()).collect();
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "no {what} among {names:?}"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_is_a_child_of_its_callers_span_with_every_stage_below_it() {
    let (address, spans) = collector().await;
    let directory = tempfile::tempdir().unwrap();
    tokio::task::spawn_blocking(move || follow(address, &spans, directory.path()))
        .await
        .unwrap();
}

fn follow(address: SocketAddr, spans: &Mutex<Vec<Span>>, data: &std::path::Path) {
    let service = Service::start(address, data);
    let meshes: Vec<(String, Vec<u8>)> = creatures(&species(1, 2), 2, 1, &ZooOptions::default())
        .map(|creature| {
            let creature = creature.unwrap();
            (creature.class.clone(), write_obj(&creature.mesh))
        })
        .collect();
    let obj = ("content-type", "model/obj");
    for (i, (class, mesh)) in meshes.iter().enumerate() {
        let path = format!("/v1/classes/{class}/shapes?create=true&name={i}.obj");
        let (status, text) = service.send(&path, mesh, &[obj]);
        assert_eq!(status, 201, "{text}");
    }
    let upload = wait_for(spans, "upload", |s| s.name == "create_shapes");
    assert_eq!(
        upload.parent, "",
        "a request without a caller begins a trace of its own"
    );

    let parameters =
        br#"{"parameters": {"eigenpairs": 12, "energies": 12, "atoms": 4, "iterations": 2, "batch": 32,
        "samples_per_shape": 40, "query_samples": 40}}"#;
    let (status, text) = service.send("/v1/reindex", parameters, &[("content-type", "application/json")]);
    assert_eq!(status, 202, "{text}");
    let job = wait_for(spans, "job", |s| s.name == "job");
    let steps = |s: &Span| s.name == "step" && s.parent == job.id;
    wait_for(spans, "step of the job", |s| {
        steps(s) && s.attribute("name") == "describe shapes"
    });
    let step = wait_for(spans, "second step", |s| {
        steps(s) && s.attribute("name") == "learn classes"
    });
    wait_for(spans, "class", |s| s.name == "learn" && s.parent == step.id);
    let shape = wait_for(spans, "shape", |s| s.name == "describe" && s.trace == job.trace);
    wait_for(spans, "stage of a shape", |s| {
        s.name == "eigenpairs" && s.parent == shape.id
    });

    let parent = format!("00-{TRACE}-{CALLER}-01");
    let headers = [
        obj,
        ("traceparent", parent.as_str()),
        ("x-request-id", "followed"),
    ];
    let (status, text) = service.send("/v1/query", &meshes[0].1, &headers);
    assert_eq!(status, 200, "{text}");
    let request = wait_for(spans, "query", |s| s.name == "query_mesh");
    assert_eq!((request.trace.as_str(), request.parent.as_str()), (TRACE, CALLER));
    assert_eq!(request.attribute("request_id"), "followed");
    assert_eq!(request.attribute("http.response.status_code"), "200");
    for stage in [
        "receive",
        "wait",
        "read",
        "prepare",
        "laplacian",
        "eigenpairs",
        "signatures",
        "ranking",
    ] {
        let span = wait_for(spans, stage, |s| s.name == stage && s.trace == TRACE);
        assert_eq!(span.parent, request.id, "{stage}");
        assert!(
            span.begin >= request.begin && span.begin <= span.end && span.end <= request.end,
            "{stage} is not within its request"
        );
    }

    // A caller that does not keep its trace gets none.
    let unkept = format!("00-{}-{CALLER}-00", TRACE.replace('4', "5"));
    service.send(
        "/v1/query",
        &meshes[1].1,
        &[obj, ("traceparent", unkept.as_str())],
    );
    let (status, _) = service.send("/v1/query", b"no mesh", &[obj, ("x-request-id", "last")]);
    assert_eq!(status, 422);
    let last = wait_for(spans, "refused query", |s| s.attribute("request_id") == "last");
    assert_eq!(last.attribute("http.response.status_code"), "422");
    let all = spans.lock().unwrap();
    assert!(all.iter().all(|s| s.trace != TRACE.replace('4', "5")));
}

#[test]
fn a_collector_that_is_gone_stops_nothing() {
    let gone = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let directory = tempfile::tempdir().unwrap();
    let service = Service::start(gone, directory.path());
    for i in 0..50 {
        let body = format!("{{\"name\": \"class {i}\"}}");
        let (status, text) = service.send(
            "/v1/classes",
            body.as_bytes(),
            &[("content-type", "application/json")],
        );
        assert_eq!(status, 201, "{text}");
    }
}
