//! A service in a directory of its own, and requests to it.

use axum::Router;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, Request, StatusCode};
use serde_json::{Value, json};
use shapelex::http::{AppState, ServiceConfig, router};
use std::time::{Duration, Instant};
use tower::ServiceExt;

/// A running service. Its directory goes with it.
pub struct App {
    pub state: AppState,
    pub router: Router,
    _directory: Option<tempfile::TempDir>,
}

/// An answer, read to its end.
pub struct Answer {
    pub status: StatusCode,
    pub headers: HeaderMap,
    pub body: Bytes,
}

impl App {
    pub fn new() -> Self {
        Self::with(|_| {})
    }

    pub fn with(change: impl FnOnce(&mut ServiceConfig)) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let mut config = ServiceConfig {
            data_dir: directory.path().to_owned(),
            query_threads: 2,
            indexing_threads: 1,
            ..ServiceConfig::default()
        };
        change(&mut config);
        let state = AppState::open(config).unwrap();
        Self {
            router: router(state.clone()),
            state,
            _directory: Some(directory),
        }
    }

    /// A service whose directory is the test's.
    pub fn on(state: AppState) -> Self {
        Self {
            router: router(state.clone()),
            state,
            _directory: None,
        }
    }

    pub async fn send(&self, request: Request<Body>) -> Answer {
        let response = self.router.clone().oneshot(request).await.unwrap();
        let (parts, body) = response.into_parts();
        Answer {
            status: parts.status,
            headers: parts.headers,
            body: axum::body::to_bytes(body, usize::MAX).await.unwrap(),
        }
    }

    pub async fn get(&self, path: &str) -> Answer {
        self.call("GET", path, None, Body::empty()).await
    }

    pub async fn delete(&self, path: &str) -> Answer {
        self.call("DELETE", path, None, Body::empty()).await
    }

    pub async fn json(&self, method: &str, path: &str, body: Value) -> Answer {
        self.call(method, path, Some("application/json"), body.to_string())
            .await
    }

    pub async fn post(&self, path: &str, media_type: &str, body: impl Into<Body>) -> Answer {
        self.call("POST", path, Some(media_type), body).await
    }

    pub async fn call(
        &self,
        method: &str,
        path: &str,
        media_type: Option<&str>,
        body: impl Into<Body>,
    ) -> Answer {
        let mut request = Request::builder().method(method).uri(path);
        if let Some(media_type) = media_type {
            request = request.header("content-type", media_type);
        }
        self.send(request.body(body.into()).unwrap()).await
    }

    /// A POST of the data directory's owner, who brings the local token.
    pub async fn post_as_owner(&self, path: &str, media_type: &str, body: impl Into<Body>) -> Answer {
        let token = self.state.local_token.secret();
        let request = Request::post(path)
            .header("authorization", format!("Bearer {token}"))
            .header("content-type", media_type)
            .body(body.into())
            .unwrap();
        self.send(request).await
    }

    /// Starts a reindex with small parameters and waits for its end.
    pub async fn reindex(&self, body: Value) -> Value {
        let started = self.json("POST", "/v1/reindex", body).await;
        assert_eq!(started.status, 202, "{}", started.text());
        self.wait(started.value()["id"].as_str().unwrap()).await
    }

    /// Waits for a job's final state.
    pub async fn wait(&self, job: &str) -> Value {
        let began = Instant::now();
        loop {
            let job = self.get(&format!("/v1/jobs/{job}")).await.value();
            if !["enqueued", "processing"].contains(&job["state"].as_str().unwrap()) {
                return job;
            }
            assert!(began.elapsed() < Duration::from_secs(120), "stuck: {job}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// A service with three classes of three shapes each, indexed.
    pub async fn indexed() -> Self {
        let app = Self::new();
        for class in crate::meshes::CLASSES {
            for pose in 0..3 {
                let path = format!("/v1/classes/{class}/shapes?create=true&name={class}{pose}.off");
                let answer = app
                    .post(&path, "model/off", crate::meshes::off(class, pose))
                    .await;
                assert_eq!(answer.status, 201, "{}", answer.text());
            }
        }
        let job = app.reindex(json!({"parameters": small()})).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        app
    }
}

/// Parameters that learn quickly.
pub fn small() -> Value {
    json!({"eigenpairs": 50, "energies": 40, "atoms": 12, "iterations": 5, "batch": 64, "samples_per_shape": 100})
}

impl Answer {
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    pub fn value(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|e| panic!("{e}: {}", self.text()))
    }

    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |v| v.to_str().unwrap())
    }

    /// Checks that this is a whole problem document and gives its status and code.
    #[track_caller]
    pub fn problem(&self) -> (u16, String) {
        assert_eq!(
            self.header("content-type"),
            "application/problem+json",
            "{}",
            self.text()
        );
        let body = self.value();
        assert_eq!(body["status"], self.status.as_u16());
        for member in ["type", "title", "detail", "code", "request_id"] {
            assert!(
                body[member].as_str().is_some_and(|s| !s.is_empty()),
                "{member}: {body}"
            );
        }
        assert_eq!(body["request_id"], self.header("x-request-id"));
        (self.status.as_u16(), body["code"].as_str().unwrap().to_owned())
    }

    /// Checks the status and the code of a problem.
    #[track_caller]
    pub fn fails(&self, status: u16, code: &str) -> Value {
        assert_eq!(self.problem(), (status, code.to_owned()), "{}", self.text());
        self.value()
    }
}

/// A multipart body and its content type.
pub fn multipart(files: &[(&str, &[u8])]) -> (String, Vec<u8>) {
    let boundary = "----shapelex-test-boundary";
    let mut body = Vec::new();
    for (name, bytes) in files {
        body.extend_from_slice(
            format!(
                "--{boundary}\r\ncontent-disposition: form-data; name=\"file\"; filename=\"{name}\"\r\n\
                 content-type: application/octet-stream\r\n\r\n"
            )
            .as_bytes(),
        );
        body.extend_from_slice(bytes);
        body.extend_from_slice(b"\r\n");
    }
    body.extend_from_slice(format!("--{boundary}--\r\n").as_bytes());
    (format!("multipart/form-data; boundary={boundary}"), body)
}
