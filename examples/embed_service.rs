//! The service inside another program: `cargo run --release --example embed_service`.
//!
//! Opens a data directory, calls the API in the process without a socket, then serves it on a free port until Ctrl-C.

use axum::body::Body;
use axum::http::Request;
use shapelex::http::{AppState, ServiceConfig, router};
use std::error::Error;
use tower::ServiceExt;

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let config = ServiceConfig {
        data_dir: "embedded-data".into(),
        ..ServiceConfig::default()
    };
    let state = AppState::open(config)?;
    let service = router(state);

    let request = Request::get("/v1/index").body(Body::empty())?;
    let response = service.clone().oneshot(request).await?;
    let status = response.status();
    let body = axum::body::to_bytes(response.into_body(), 1 << 20).await?;
    println!("GET /v1/index: {status}, {} bytes", body.len());

    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await?;
    println!("listening on http://{}", listener.local_addr()?);
    axum::serve(listener, service)
        .with_graceful_shutdown(async {
            // Without a signal handler the service stops at once.
            let _ = tokio::signal::ctrl_c().await;
        })
        .await?;
    Ok(())
}
