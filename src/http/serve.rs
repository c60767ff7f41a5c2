//! From settings to a listening service, and back down in good order.
//!
//! A connection is cut where its client dribbles: the head of a request has a time limit, a size limit and, over TLS,
//! a handshake limit; bodies have theirs in [`super::upload`] and [`super::extract`]. How many connections there may be
//! is the matter of [`super::connections`].

use super::connection::{ConnectionServer, turn_away};
use super::housekeeping;
use super::local_access::{LocalAccess, local_url};
use super::open::OpenError;
use super::scrubber;
use super::state::AppState;
use super::tls::TlsError;
use crate::store::Health;
use crate::store::error::is_out_of_descriptors;
use std::future::Future;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// Why serving ended early.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The service did not start.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The certificate or its key cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
}

/// How long to wait after a connection could not be accepted.
const ACCEPT_AGAIN: Duration = Duration::from_millis(50);
/// How often in a row that is logged.
const LOG_EVERY: u32 = 200;
/// Connections at a time that are told why there is no place for them.
const TURNED_AWAY: usize = 64;
/// How long connections have to end after they were told to end at once.
const CUT_WITHIN: Duration = Duration::from_secs(1);

/// Serves until `shutdown` resolves: then no more connections are accepted, open streams end, running requests have
/// until the deadline, the running job goes back to the queue, and everything is flushed.
///
/// # Errors
/// [`ServeError`] where the certificate cannot be used.
pub async fn serve(
    state: AppState,
    listener: TcpListener,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> Result<(), ServeError> {
    tokio::spawn(housekeeping::run(state.clone()));
    tokio::spawn(scrubber::run(state.clone()));
    let cut = CancellationToken::new();
    let server = Arc::new(ConnectionServer::new(state.clone(), cut.clone())?);
    let tasks = TaskTracker::new();
    tokio::select! {
        never = accept(&server, &listener, &tasks) => match never {},
        () = shutdown => {}
    }
    drop(listener);
    tracing::info!("shutting down");
    state.stopping.cancel();
    tasks.close();
    let deadline = state.config.shutdown_timeout;
    if tokio::time::timeout(deadline, tasks.wait()).await.is_err() {
        tracing::warn!(
            ?deadline,
            "requests were still running at the deadline and are dropped"
        );
        cut.cancel();
        // What does not end now ends with the runtime.
        let _ = tokio::time::timeout(CUT_WITHIN, tasks.wait()).await;
    }
    close(&state, deadline).await;
    Ok(())
}

/// Writes the address and the local token to the data directory, where its owner finds them until [`serve`] ends. Call it
/// before the service says that it listens.
pub fn announce(state: &AppState, listening: SocketAddr) {
    let url = local_url(listening, state.config.tls_cert.is_some());
    if let Err(error) = state.local_token.publish(&state.config.data_dir, url) {
        tracing::warn!(%error, "the local token was not written; while there is no key, keys are made with the service stopped");
    }
}

async fn close(state: &AppState, deadline: Duration) {
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
        if let Err(error) = LocalAccess::remove(&closing.config.data_dir) {
            tracing::warn!(%error, "the file of the local token was not removed; it is of no use any more");
        }
    })
    .await;
    if let Err(error) = closed {
        tracing::error!(%error, "closing failed");
    }
}

async fn accept(
    server: &Arc<ConnectionServer>,
    listener: &TcpListener,
    tasks: &TaskTracker,
) -> std::convert::Infallible {
    let polite = Arc::new(Semaphore::new(TURNED_AWAY));
    let mut failures = 0_u32;
    loop {
        let (socket, peer) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                accept_failed(server, &error, failures);
                failures = failures.wrapping_add(1);
                tokio::time::sleep(ACCEPT_AGAIN).await;
                continue;
            }
        };
        failures = 0;
        match server.state.connections.admit(peer.ip()).await {
            Some(place) => {
                let server = Arc::clone(server);
                tasks.spawn(async move { server.serve(socket, peer, place).await });
            }
            None => tell(server, socket, peer, &polite),
        }
    }
}

/// The system gave no connection. Where it has no descriptors left, an idle connection makes way.
fn accept_failed(server: &ConnectionServer, error: &std::io::Error, before: u32) {
    if is_out_of_descriptors(error) {
        server.state.connections.dismiss_oldest();
    }
    if before.is_multiple_of(LOG_EVERY) {
        tracing::warn!(%error, "a connection could not be accepted; trying again");
    }
}

/// An address that has all its connections busy gets no other, and is told so where few are being told at the moment.
fn tell(server: &Arc<ConnectionServer>, socket: TcpStream, peer: SocketAddr, polite: &Arc<Semaphore>) {
    tracing::debug!(%peer, "the address has as many busy connections as it may; another was closed");
    if server.is_encrypted() {
        return;
    }
    if let Ok(permit) = Arc::clone(polite).try_acquire_owned() {
        tokio::spawn(async move {
            turn_away(socket).await;
            drop(permit);
        });
    }
}
