//! How far a job is: sent to whoever follows it at once, written to the store every half second.

use crate::model::{Job, Step};
use crate::store::Store;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tracing::Span;

const WRITE_EVERY: Duration = Duration::from_millis(500);

/// The progress of one running job. Shared by the threads that work on it.
pub(super) struct Progress {
    store: Store,
    channel: watch::Sender<Job>,
    written: Mutex<Instant>,
    /// The job's span, and that of the step that began last.
    job: Span,
    step: Mutex<Span>,
}

impl Progress {
    /// Of the job whose span this is called in.
    pub(super) fn new(store: Store, channel: watch::Sender<Job>) -> Self {
        Self {
            store,
            channel,
            written: Mutex::new(Instant::now()),
            job: Span::current(),
            step: Mutex::new(Span::none()),
        }
    }

    /// The span of the step that began last. The threads of the pool know no other way where they are.
    pub(super) fn step(&self) -> Span {
        self.step.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Begins a step.
    pub(super) fn begin(&self, name: &str, total: usize) {
        *self.step.lock().unwrap_or_else(PoisonError::into_inner) =
            tracing::info_span!(parent: &self.job, "step", name);
        self.channel.send_modify(|job| {
            job.steps.push(Step {
                name: name.to_owned(),
                finished: 0,
                total,
            });
        });
        self.write();
    }

    /// Counts one more in the step that began last.
    pub(super) fn advance(&self) {
        self.channel.send_modify(|job| {
            if let Some(step) = job.steps.last_mut() {
                step.finished = (step.finished + 1).min(step.total);
            }
        });
        self.write();
    }

    fn write(&self) {
        // Whoever finds another thread at it leaves it to that one.
        let Ok(mut written) = self.written.try_lock() else {
            return;
        };
        if written.elapsed() < WRITE_EVERY {
            return;
        }
        *written = Instant::now();
        let job = self.channel.borrow().clone();
        if let Err(error) = self.store.put_progress(&job) {
            tracing::warn!(%error, job = %job.id, "progress was not written");
        }
    }
}
