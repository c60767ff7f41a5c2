//! Starting and ending the service, for `serve` and for `demo`.

use super::{CliError, process};
use crate::http::{AppState, OpenError, ServiceConfig, announce, serve};
use std::future::Future;
use std::net::SocketAddr;
use tokio::net::TcpListener;

/// Threads that wait for the disk, at most. Each has a stack and memory of its own; more would only queue at the disk.
const BLOCKING_THREADS: usize = 64;

/// Serves until `shutdown` resolves. `listening` is told the address once connections are accepted.
///
/// # Errors
/// [`CliError::Failed`] where the data directory cannot be opened, the address cannot be bound or serving fails.
pub fn run_until(
    mut config: ServiceConfig,
    shutdown: impl Future<Output = ()> + Send + 'static,
    listening: impl FnOnce(SocketAddr) -> Result<(), CliError>,
) -> Result<(), CliError> {
    process::prepare(&mut config);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .max_blocking_threads(BLOCKING_THREADS)
        .build()?;
    let outcome = runtime.block_on(async {
        // Waited for from the start: a signal that comes right after the address is told must not end the process unasked.
        let shutdown = tokio::spawn(shutdown);
        let address = config.listen;
        // The address first: opening a large data directory takes a while, a taken port should say so at once.
        let listener = TcpListener::bind(address)
            .await
            .map_err(|error| CliError::Failed(format!("cannot listen on {address}: {error}")))?;
        let state = tokio::task::spawn_blocking(move || AppState::open(config))
            .await
            .map_err(|error| CliError::Failed(format!("the service did not start: {error}")))?
            .map_err(|error| match error {
                OpenError::Unguarded { .. } => CliError::Usage(error.to_string()),
                other => CliError::Failed(other.to_string()),
            })?;
        let address = listener.local_addr()?;
        announce(&state, address);
        listening(address)?;
        let stopped = async move {
            // It does not panic, and is not cancelled before the runtime ends.
            let _ = shutdown.await;
        };
        serve(state, listener, stopped)
            .await
            .map_err(|error| CliError::Failed(error.to_string()))
    });
    // Whatever still computes has been asked to stop and given its time; it must not hold the process back.
    runtime.shutdown_background();
    outcome
}

/// Resolves at the first SIGINT or SIGTERM. A second one ends the process at once.
pub async fn interrupted() {
    signal().await;
    tokio::spawn(async {
        signal().await;
        std::process::exit(130);
    });
}

#[cfg(unix)]
async fn signal() {
    use tokio::signal::unix::{SignalKind, signal};
    let Ok(mut terminate) = signal(SignalKind::terminate()) else {
        // Without a handler the signal ends the process by itself.
        return std::future::pending().await;
    };
    tokio::select! {
        _ = tokio::signal::ctrl_c() => {}
        _ = terminate.recv() => {}
    }
}

#[cfg(not(unix))]
async fn signal() {
    if tokio::signal::ctrl_c().await.is_err() {
        std::future::pending().await
    }
}
