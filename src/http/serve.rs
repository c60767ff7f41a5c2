//! From settings to a listening service, and back down in good order.

use super::housekeeping;
use super::router::router;
use super::state::{AppState, OpenError};
use std::future::{Future, IntoFuture};
use tokio::net::TcpListener;

/// Why serving ended early.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The service did not start.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The listener failed.
    #[error("the listener failed: {0}")]
    Listener(#[from] std::io::Error),
}

/// Serves until `shutdown` resolves: then no more connections are accepted, open streams end, running requests have
/// until the deadline, the running job goes back to the queue, and everything is flushed.
///
/// # Errors
/// [`ServeError`] where the listener fails.
pub async fn serve(
    state: AppState,
    listener: TcpListener,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> Result<(), ServeError> {
    tokio::spawn(housekeeping::run(state.clone()));
    let stopping = state.stopping.clone();
    let stop = stopping.clone();
    let server = axum::serve(listener, router(state.clone())).with_graceful_shutdown(async move {
        shutdown.await;
        tracing::info!("shutting down");
        stop.cancel();
    });
    let deadline = state.config.shutdown_timeout;
    let overdue = async {
        stopping.cancelled().await;
        tokio::time::sleep(deadline).await;
    };
    let served = tokio::select! {
        served = server.into_future() => served,
        () = overdue => {
            tracing::warn!(?deadline, "requests were still running at the deadline and are dropped");
            Ok(())
        }
    };
    let closing = state.clone();
    let closed = tokio::task::spawn_blocking(move || {
        if !closing.jobs.shutdown(deadline) {
            tracing::warn!("the worker was still busy at the deadline; its job runs again at the next start");
        }
        if let Err(error) = closing.store.flush() {
            tracing::error!(%error, "the last flush failed");
        }
    })
    .await;
    if let Err(error) = closed {
        tracing::error!(%error, "closing failed");
    }
    Ok(served?)
}
