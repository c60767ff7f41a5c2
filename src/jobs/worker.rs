//! The worker thread: takes jobs in order, one at a time, and brings each to an end.

use super::context::Reindex;
use super::failure::{ReindexError, panic_text};
use super::progress::Progress;
use super::reindex::{Outcome, reindex};
use super::share::Share;
use super::{Inner, JobError, Running};
use crate::model::{Job, JobFailure, JobId, JobKind, JobState};
use crate::store::{Health, StoreError};
use jiff::Timestamp;
use shapelex_core::cancel::Cancel;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// A job that was running at that many crashes is not tried again.
const MAX_ATTEMPTS: u32 = 3;

/// How often a worker with jobs looks whether the store takes writes again.
const LOOK_AGAIN: Duration = Duration::from_millis(200);

/// How long a job waits that could not be done for want of file descriptors.
const TRY_AGAIN_AFTER: Duration = Duration::from_secs(2);

/// Puts the jobs a former process left unfinished back into the queue.
pub(super) fn requeue_interrupted(inner: &Inner) -> Result<(), JobError> {
    let mut again = Vec::new();
    let mut unwritten = Vec::new();
    for mut job in inner.store.unfinished_jobs()? {
        if job.state == JobState::Processing && job.attempts >= MAX_ATTEMPTS {
            job.state = JobState::Failed;
            job.finished_at = Some(Timestamp::now());
            job.failure = Some(JobFailure {
                code: "crashed_repeatedly".to_owned(),
                detail: format!(
                    "the process ended {} times while working on this job",
                    job.attempts
                ),
            });
            if !written_or_full(inner.store.put_job(&job))? {
                unwritten.push(job);
            }
            continue;
        }
        if job.state == JobState::Processing {
            job.state = JobState::Enqueued;
            job.steps.clear();
            // Not written on a full disk, the next start finds it as it was, and does the same.
            written_or_full(inner.store.put_job(&job))?;
        }
        again.push(job);
    }
    let mut state = inner.state();
    state.unwritten.extend(unwritten);
    for job in again {
        state.waiting.push_back(job.id);
        state.channels.insert(job.id, watch::Sender::new(job));
    }
    inner.count(&state);
    Ok(())
}

/// Whether a write was taken; `false` where the disk is full.
fn written_or_full(done: Result<(), StoreError>) -> Result<bool, StoreError> {
    match done {
        Ok(()) => Ok(true),
        Err(StoreError::Full { .. }) => Ok(false),
        Err(other) => Err(other),
    }
}

/// The thread's body: until it is told to stop.
pub(super) fn run(inner: &Arc<Inner>) {
    let _end = Stopped(inner);
    while let Some((id, channel, cancel)) = next(inner) {
        let ended = catch_unwind(AssertUnwindSafe(|| {
            tracing::info_span!("job", job = %id).in_scope(|| work(inner, &channel, &cancel))
        }))
        .unwrap_or_else(|panic| {
            let text = panic_text(panic.as_ref());
            tracing::error!(job = %id, text, "a job panicked");
            Err(ReindexError::failed(
                "internal",
                format!("a defect in shapelex: {text}"),
            ))
        });
        finish(inner, id, &channel, ended);
    }
}

/// Says that the worker has ended, however it did.
struct Stopped<'a>(&'a Inner);

impl Drop for Stopped<'_> {
    fn drop(&mut self) {
        self.0.state().stopped = true;
        self.0.changed.notify_all();
    }
}

/// Waits for the next job and marks it as running; `None` at shutdown.
fn next(inner: &Inner) -> Option<(JobId, watch::Sender<Job>, Cancel)> {
    let mut state = inner.state();
    loop {
        if state.stopping {
            return None;
        }
        // A job begun now could not write what it learns, or not read what it learns from. It waits; queries go on.
        let too_early = state.not_before.is_some_and(|moment| Instant::now() < moment);
        if !state.waiting.is_empty() && (too_early || inner.store.health() != Health::Ready) {
            state = inner
                .changed
                .wait_timeout(state, LOOK_AGAIN)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
            continue;
        }
        let Some(id) = state.waiting.pop_front() else {
            state = inner.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            continue;
        };
        let Some(channel) = state.channels.get(&id).cloned() else {
            continue;
        };
        let cancel = Cancel::new();
        state.running = Some(Running {
            id,
            cancel: cancel.clone(),
            on_request: false,
        });
        inner.count(&state);
        return Some((id, channel, cancel));
    }
}

fn work(inner: &Inner, channel: &watch::Sender<Job>, cancel: &Cancel) -> Result<Outcome, ReindexError> {
    channel.send_modify(|job| {
        job.state = JobState::Processing;
        job.started_at = Some(Timestamp::now());
        job.attempts += 1;
        job.steps.clear();
    });
    let job = channel.borrow().clone();
    // Durable before the work begins, so that a job that brings the process down is counted.
    inner.store.put_job(&job)?;
    let JobKind::Reindex { scope, parameters } = &job.kind;
    let progress = Progress::new(inner.store.clone(), channel.clone());
    let request = Reindex {
        store: &inner.store,
        limits: &inner.options.limits,
        share: Share {
            bytes: inner.options.memory_bytes,
            threads: inner.options.indexing_threads.max(1),
        },
        cancel,
        progress: &progress,
        scope,
        parameters: parameters.as_ref(),
    };
    let outcome = inner.pool.install(|| reindex(&request, &inner.live))?;
    match inner.store.collect_garbage() {
        Ok(garbage) => tracing::debug!(?garbage, "collected"),
        Err(error) => tracing::warn!(%error, "garbage was not collected"),
    }
    Ok(outcome)
}

/// Brings a job to its final state, or back into the queue at shutdown.
fn finish(inner: &Inner, id: JobId, channel: &watch::Sender<Job>, ended: Result<Outcome, ReindexError>) {
    let mut state = inner.state();
    let on_request = state.running.take().is_some_and(|running| running.on_request);
    let mut job = channel.borrow().clone();
    match ended {
        Ok(outcome) => {
            job.state = JobState::Succeeded;
            job.generation = outcome.generation;
            job.result = Some(outcome.report);
        }
        Err(ReindexError::Cancelled) if state.stopping && !on_request => {
            job.state = JobState::Enqueued;
            job.attempts = job.attempts.saturating_sub(1);
            job.steps.clear();
        }
        Err(ReindexError::Cancelled) => job.state = JobState::Cancelled,
        Err(ReindexError::Later(_)) if on_request => job.state = JobState::Cancelled,
        Err(ReindexError::Later(why)) => {
            tracing::warn!(job = %id, why, "a job cannot be done now and is tried again");
            job.state = JobState::Enqueued;
            job.attempts = job.attempts.saturating_sub(1);
            job.steps.clear();
            state.waiting.push_front(id);
            state.not_before = Some(Instant::now() + TRY_AGAIN_AFTER);
        }
        Err(ReindexError::Failed(failure)) => {
            tracing::warn!(job = %id, code = failure.code, detail = failure.detail, "a job failed");
            job.state = JobState::Failed;
            job.failure = Some(failure);
        }
    }
    if job.state.is_finished() {
        job.finished_at = Some(Timestamp::now());
        super::metrics::count(&job);
        state.channels.remove(&id);
    }
    if let Err(error) = inner
        .store
        .put_job(&job)
        .and_then(|()| inner.store.forget_old_jobs())
    {
        tracing::error!(%error, job = %id, "the end of a job was not written");
        if job.state.is_finished() {
            state.unwritten.push(job.clone());
        }
    }
    channel.send_replace(job);
    inner.count(&state);
    inner.changed.notify_all();
}
