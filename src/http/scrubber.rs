//! Looks at everything that is stored now and then, slowly: `Store::scrub` with a pace, and when it is due.

use super::state::{AppState, Parts};
use crate::store::{Health, StoreError};
use jiff::Timestamp;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// How often it is asked whether one is due.
const LOOK: Duration = Duration::from_secs(30);
/// After a start, before the first one: a service that is just starting has other things to do.
const SETTLE: Duration = Duration::from_secs(60);
/// Longest sleep of the pace, so that a shutdown is seen soon.
const NAP: Duration = Duration::from_millis(100);

/// Runs until the service is asked to stop.
pub async fn run(state: AppState) {
    let Some(every) = state.config.scrub_every else {
        return;
    };
    let rechecked = state.blocking(|parts| {
        parts.store.recheck_damage();
        Ok(())
    });
    if let Err(problem) = rechecked.await {
        tracing::error!(
            ?problem,
            "what the last scrub found damaged was not looked at again"
        );
    }
    let mut wait = SETTLE.min(every);
    loop {
        tokio::select! {
            () = state.stopping.cancelled() => return,
            () = tokio::time::sleep(wait) => {}
        }
        wait = LOOK.min(every);
        let done = state
            .blocking(move |parts| {
                if parts.store.health() == Health::Ready && is_due(parts, every) {
                    scrub(parts)?;
                }
                Ok(())
            })
            .await;
        if let Err(problem) = done {
            tracing::error!(?problem, "a scrub did not end");
            wait = every.min(Duration::from_secs(3600));
        }
    }
}

fn is_due(parts: &Parts, every: Duration) -> bool {
    let age = |at: Timestamp| Timestamp::now().duration_since(at).unsigned_abs();
    parts
        .store
        .last_scrub()
        .is_none_or(|last| age(last.started_at) >= every)
}

/// Looks at everything once.
fn scrub(parts: &Parts) -> Result<(), StoreError> {
    tracing::info!("looking at all stored files and records");
    let mut pace = Pace::new(parts.config.scrub_bytes_per_second);
    let report = parts.store.scrub(&mut |bytes| {
        if parts.stopping.is_cancelled() {
            return ControlFlow::Break(());
        }
        pace.after(bytes, &|| parts.stopping.is_cancelled());
        ControlFlow::Continue(())
    })?;
    if let Some(report) = report {
        tracing::info!(
            files = report.originals,
            bytes = report.bytes,
            records = report.records,
            damaged_files = report.damaged_originals.len(),
            damaged_records = report.damaged_records.len(),
            "looked at all stored files and records"
        );
    }
    Ok(())
}

/// Keeps to so many bytes per second.
struct Pace {
    bytes_per_second: u64,
    began: Instant,
    bytes: u64,
}

impl Pace {
    fn new(bytes_per_second: u64) -> Self {
        Self {
            bytes_per_second: bytes_per_second.max(1),
            began: Instant::now(),
            bytes: 0,
        }
    }

    /// Sleeps until the bytes so far are due.
    fn after(&mut self, bytes: u64, stopped: &dyn Fn() -> bool) {
        self.bytes += bytes;
        let due = Duration::from_secs_f64(self.bytes as f64 / self.bytes_per_second as f64);
        while let Some(left) = due.checked_sub(self.began.elapsed())
            && !left.is_zero()
            && !stopped()
        {
            std::thread::sleep(left.min(NAP));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pace_is_kept_and_a_stop_ends_it() {
        let mut pace = Pace::new(1 << 20);
        let began = Instant::now();
        for _ in 0..4 {
            pace.after(64 << 10, &|| false);
        }
        assert!(began.elapsed() >= Duration::from_millis(250));
        let began = Instant::now();
        pace.after(1 << 30, &|| true);
        assert!(began.elapsed() < Duration::from_secs(1));
    }
}
