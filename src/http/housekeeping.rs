//! What the service does by itself every few seconds: it looks whether a disk that was full has space again, and makes
//! the snapshots of the schedule.

use super::state::{AppState, Parts};
use crate::model::{Snapshot, SnapshotOrigin};
use crate::store::StoreError;
use jiff::Timestamp;
use std::time::{Duration, Instant};

const EVERY: Duration = Duration::from_secs(2);
/// How long a scheduled snapshot that failed is not tried again.
const RETRY: Duration = Duration::from_secs(300);

/// Runs until the service is asked to stop.
pub async fn run(state: AppState) {
    let mut not_before = Instant::now();
    loop {
        tokio::select! {
            () = state.stopping.cancelled() => return,
            () = tokio::time::sleep(EVERY) => {}
        }
        let tended = state
            .blocking(move |parts| {
                recover(parts);
                Ok(Instant::now() >= not_before && !follow_schedule(parts))
            })
            .await;
        if tended != Ok(false) {
            not_before = Instant::now() + RETRY;
        }
    }
}

/// Makes a store writable again that was full, and does what the full disk kept from being done.
fn recover(parts: &Parts) {
    match parts.store.recover() {
        Ok(()) => {}
        Err(StoreError::Full { detail }) => return tracing::debug!(detail, "the disk is still full"),
        // A start afresh is the way out; readiness says so.
        Err(StoreError::ReadOnly { .. } | StoreError::RecoveryMode { .. }) => return,
        Err(error) => return tracing::error!(%error, "the store does not recover"),
    }
    if !parts.jobs.is_behind() {
        return;
    }
    match parts.jobs.catch_up() {
        Ok(()) => tracing::info!("what the full disk kept from being done is done"),
        Err(error) => tracing::error!(%error, "the index and the jobs are still not what they should be"),
    }
}

/// Makes a snapshot where one is due and removes those it replaces. `false` where that failed.
fn follow_schedule(parts: &Parts) -> bool {
    let Some(every) = parts.config.snapshot_every else {
        return true;
    };
    if parts.store.recovery_mode().is_some() {
        return true;
    }
    let made = due(parts, every).and_then(|due| {
        if due {
            let snapshot = parts.store.create_snapshot(SnapshotOrigin::Scheduled)?;
            tracing::info!(snapshot = %snapshot.id, bytes = snapshot.bytes, "made a scheduled snapshot");
            parts.store.prune_snapshots(parts.config.snapshot_keep)?;
        }
        Ok(())
    });
    match made {
        // Somebody is at it; the next look is soon enough.
        Ok(()) | Err(StoreError::SnapshotRunning) => true,
        Err(error) => {
            tracing::error!(%error, "a scheduled snapshot was not made");
            false
        }
    }
}

fn due(parts: &Parts, every: Duration) -> Result<bool, StoreError> {
    let snapshots = parts.store.list_snapshots(None, usize::MAX)?;
    let last = snapshots.iter().rfind(|s| s.origin == SnapshotOrigin::Scheduled);
    let age = |s: &Snapshot| Timestamp::now().duration_since(s.created_at).unsigned_abs();
    Ok(last.is_none_or(|last| age(last) >= every))
}
