//! From settings to a listening service, and back down in good order.
//!
//! A connection is cut where its client dribbles: the head of a request has a time limit, a size limit and, over TLS,
//! a handshake limit; bodies have theirs in [`super::upload`] and [`super::extract`]. Connections beyond the limit wait
//! to be served until another one ends.

use super::housekeeping;
use super::router::router;
use super::scrubber;
use super::state::{AppState, OpenError};
use super::tls::{Tls, TlsError};
use crate::store::Health;
use axum::Router;
use axum::extract::Request;
use axum_server::{Handle, Server};
use std::convert::Infallible;
use std::future::Future;
use std::net::SocketAddr;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tower::Service;

/// Why serving ended early.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The service did not start.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The certificate or its key cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The listener failed.
    #[error("the listener failed: {0}")]
    Listener(#[from] std::io::Error),
}

/// Serves until `shutdown` resolves: then no more connections are accepted, open streams end, running requests have
/// until the deadline, the running job goes back to the queue, and everything is flushed.
///
/// # Errors
/// [`ServeError`] where the certificate cannot be used or the listener fails.
pub async fn serve(
    state: AppState,
    listener: TcpListener,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> Result<(), ServeError> {
    tokio::spawn(housekeeping::run(state.clone()));
    tokio::spawn(scrubber::run(state.clone()));
    let tls = Tls::load(&state.config)?;
    let handle = Handle::new();
    let deadline = state.config.shutdown_timeout;
    let stop = async {
        shutdown.await;
        tracing::info!("shutting down");
        state.stopping.cancel();
        handle.graceful_shutdown(Some(deadline));
        tokio::time::sleep(deadline).await;
    };
    let served = tokio::select! {
        served = accept(&state, listener, tls, handle.clone()) => served,
        () = stop => {
            tracing::warn!(?deadline, "requests were still running at the deadline and are dropped");
            handle.shutdown();
            Ok(())
        }
    };
    let closing = state.clone();
    let closed = tokio::task::spawn_blocking(move || {
        if !closing.jobs.shutdown(deadline) {
            tracing::warn!("the worker was still busy at the deadline; its job runs again at the next start");
        }
        if closing.store.health() == Health::Ready
            && let Err(error) = closing.store.flush()
        {
            tracing::error!(%error, "the last flush failed");
        }
    })
    .await;
    if let Err(error) = closed {
        tracing::error!(%error, "closing failed");
    }
    Ok(served?)
}

async fn accept(
    state: &AppState,
    listener: TcpListener,
    tls: Tls,
    handle: Handle<SocketAddr>,
) -> std::io::Result<()> {
    let config = &state.config;
    let connections = Connections {
        router: router(state.clone()),
        places: Arc::clone(&state.connections),
    };
    let mut server = Server::<SocketAddr>::from_listener(listener)
        .http1_only()
        .handle(handle)
        .first_request_timeout(config.header_timeout);
    server
        .http_builder()
        .http1()
        .header_read_timeout(Some(config.header_timeout))
        .max_buf_size(config.max_header_bytes.max(SMALLEST_BUFFER))
        .keep_alive(true);
    tls.serve(
        server,
        connections,
        config.header_timeout.max(Duration::from_secs(1)),
    )
    .await
}

/// hyper takes no smaller one.
const SMALLEST_BUFFER: usize = 8192;

/// Makes the service of each connection, which holds a place until the connection ends.
#[derive(Clone)]
pub(super) struct Connections {
    router: Router,
    places: Arc<Semaphore>,
}

impl Service<SocketAddr> for Connections {
    type Response = Connection;
    type Error = Infallible;
    type Future = std::pin::Pin<Box<dyn Future<Output = Result<Connection, Infallible>> + Send>>;

    fn poll_ready(&mut self, _: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Poll::Ready(Ok(()))
    }

    fn call(&mut self, _: SocketAddr) -> Self::Future {
        let (router, places) = (self.router.clone(), Arc::clone(&self.places));
        Box::pin(async move {
            // Nobody closes the semaphore; without a place the connection would be served all the same.
            let place = places.acquire_owned().await.ok().map(Arc::new);
            Ok(Connection {
                router,
                _place: place,
            })
        })
    }
}

/// The routes, as one connection sees them.
#[derive(Clone)]
pub(super) struct Connection {
    router: Router,
    _place: Option<Arc<OwnedSemaphorePermit>>,
}

impl<B> Service<Request<B>> for Connection
where
    Router: Service<Request<B>>,
{
    type Response = <Router as Service<Request<B>>>::Response;
    type Error = <Router as Service<Request<B>>>::Error;
    type Future = <Router as Service<Request<B>>>::Future;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Self::Error>> {
        Service::<Request<B>>::poll_ready(&mut self.router, context)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        Service::<Request<B>>::call(&mut self.router, request)
    }
}
