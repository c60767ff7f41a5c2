//! The durable, bounded job queue, the worker that learns the index, and the live index queries run against.
//!
//! Jobs run one at a time, in the order they were asked for, each on a pool of a few threads. A job that was running
//! when the process died is queued again at the next start; one that was running at shutdown goes back to the queue.

mod baselines;
mod behind;
mod context;
mod describe;
pub mod error;
mod exclusive;
mod failure;
mod live;
pub mod metrics;
mod plan;
mod priority;
mod progress;
mod reindex;
mod share;
mod trim;
mod worker;

pub use error::JobError;
pub use live::LiveIndex;

use crate::model::{ContentHash, Job, JobId, JobKind, JobState};
use crate::store::page::Page;
use crate::store::{Store, StoreError};
use jiff::Timestamp;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::Limits;
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// How jobs are run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobOptions {
    /// Threads of the indexing pool.
    pub indexing_threads: usize,
    /// Jobs that may wait.
    pub queue_limit: usize,
    /// What reading a shape's file may build.
    pub limits: Limits,
    /// Bytes of memory a reindex may take, the index that is served included.
    pub memory_bytes: u64,
}

impl Default for JobOptions {
    /// One thread less than there are cores, at least one; 1000 waiting jobs; the default limits; 512 MiB.
    fn default() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            indexing_threads: cores.saturating_sub(1).max(1),
            queue_limit: 1000,
            limits: Limits::default(),
            memory_bytes: 512 << 20,
        }
    }
}

/// The job queue with its worker and the live index. Cheap to clone; every clone is the same queue. The worker stops
/// when the last clone is dropped.
#[derive(Clone)]
pub struct Jobs {
    inner: Arc<Inner>,
    _last: Arc<StopOnDrop>,
}

struct Inner {
    store: Store,
    options: JobOptions,
    live: live::Publisher,
    pool: rayon::ThreadPool,
    state: Mutex<State>,
    /// Told of every change of `state` the worker or a shutdown waits for.
    changed: Condvar,
    depth: AtomicUsize,
    worker: Mutex<Option<JoinHandle<()>>>,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<JobId>,
    running: Option<Running>,
    /// One per job that is not finished.
    channels: HashMap<JobId, watch::Sender<Job>>,
    /// Jobs that have ended without the store taking it.
    unwritten: Vec<Job>,
    /// What a start could not do because the disk was full.
    behind: behind::Behind,
    /// Whether jobs are refused because the store as a whole is being changed.
    paused: bool,
    /// No job is begun before this moment.
    not_before: Option<Instant>,
    stopping: bool,
    stopped: bool,
}

impl State {
    /// A job the store does not have, or not as it is.
    fn in_memory(&self, id: JobId) -> Option<Job> {
        let unfinished = self.channels.get(&id).map(|channel| channel.borrow().clone());
        unfinished.or_else(|| self.unwritten.iter().find(|job| job.id == id).cloned())
    }
}

struct Running {
    id: JobId,
    cancel: Cancel,
    /// Whether somebody asked for the cancellation; else a shutdown did.
    on_request: bool,
}

struct StopOnDrop(Arc<Inner>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.stop();
        self.0.wait_stopped(Duration::from_secs(10));
    }
}

impl Inner {
    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing below panics while it holds the lock half-way through a change.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn stop(&self) {
        let mut state = self.state();
        state.stopping = true;
        if let Some(running) = &state.running {
            running.cancel.cancel();
        }
        self.changed.notify_all();
    }

    fn wait_stopped(&self, deadline: Duration) -> bool {
        let end = Instant::now() + deadline;
        let mut state = self.state();
        while !state.stopped {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            state = self
                .changed
                .wait_timeout(state, left)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
        drop(state);
        // It has nothing left to do but to let go of the store, which must be free when this returns.
        let worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(worker) = worker
            && worker.join().is_err()
        {
            tracing::error!("the worker thread panicked");
        }
        true
    }

    fn count(&self, state: &State) {
        let depth = state.waiting.len() + usize::from(state.running.is_some());
        self.depth.store(depth, Ordering::Relaxed);
    }
}

impl Jobs {
    /// Loads the live index, queues interrupted jobs again and starts the worker. An index that was lost, or cannot be
    /// loaded, is queued to be learnt again; queries find it empty until then. In recovery mode nothing is loaded and
    /// nothing runs. What a full disk keeps from being done, [`Jobs::catch_up`] does later.
    ///
    /// # Errors
    /// [`JobError::Store`] where the jobs cannot be read, [`JobError::NoWorker`] where no thread can be started.
    pub fn start(store: Store, options: JobOptions) -> Result<Self, JobError> {
        let no_worker = |detail: String| JobError::NoWorker { detail };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.indexing_threads.max(1))
            .thread_name(|i| format!("indexing-{i}"))
            .start_handler(|_| priority::give_way())
            .build()
            .map_err(|e| no_worker(e.to_string()))?;
        let idle = store.recovery_mode().is_some();
        let inner = Arc::new(Inner {
            live: live::Publisher::new(&store),
            store,
            options,
            pool,
            state: Mutex::default(),
            changed: Condvar::new(),
            depth: AtomicUsize::new(0),
            worker: Mutex::default(),
        });
        if !idle {
            inner.read_or_put_off()?;
        }
        let for_worker = Arc::clone(&inner);
        let worker = std::thread::Builder::new()
            .name("jobs".to_owned())
            .spawn(move || worker::run(&for_worker))
            .map_err(|e| no_worker(e.to_string()))?;
        *inner.worker.lock().unwrap_or_else(PoisonError::into_inner) = Some(worker);
        let jobs = Self {
            _last: Arc::new(StopOnDrop(Arc::clone(&inner))),
            inner,
        };
        jobs.relearn_where_lost()?;
        Ok(jobs)
    }

    /// Queues a job. It is durable when this returns.
    ///
    /// # Errors
    /// [`JobError::Parameter`]; [`JobError::QueueFull`]; [`JobError::ShuttingDown`]; [`JobError::Store`].
    pub fn enqueue(&self, kind: JobKind) -> Result<Job, JobError> {
        self.enqueue_answering(kind, None)
    }

    /// As [`enqueue`](Self::enqueue); remembers in the same write which request, under which key, the job answers.
    ///
    /// # Errors
    /// As [`enqueue`](Self::enqueue).
    pub fn enqueue_answering(
        &self,
        kind: JobKind,
        answers: Option<(ContentHash, ContentHash)>,
    ) -> Result<Job, JobError> {
        let JobKind::Reindex { parameters, .. } = &kind;
        if let Some(parameters) = parameters {
            parameters.validate()?;
        }
        let limit = self.inner.options.queue_limit;
        let mut state = self.inner.state();
        if state.stopping {
            return Err(JobError::ShuttingDown);
        }
        if state.paused {
            return Err(JobError::Paused);
        }
        state.behind.require_read()?;
        if state.waiting.len() >= limit {
            return Err(JobError::QueueFull { limit });
        }
        let job = Job::new(kind, Timestamp::now());
        self.inner.store.put_new_job(&job, answers)?;
        state.waiting.push_back(job.id);
        state.channels.insert(job.id, watch::Sender::new(job.clone()));
        self.inner.count(&state);
        self.inner.changed.notify_all();
        Ok(job)
    }

    /// A job as it stands now.
    ///
    /// # Errors
    /// [`JobError::NoJob`]; [`JobError::Store`].
    pub fn job(&self, id: JobId) -> Result<Job, JobError> {
        match self.inner.state().in_memory(id) {
            Some(job) => Ok(job),
            None => Ok(self.inner.store.job(id)?),
        }
    }

    /// Up to `limit` jobs, newest first, those older than `before` only, as
    /// [`Store::page_of_jobs`](crate::store::Store::page_of_jobs) has them.
    ///
    /// # Errors
    /// Those of the store and of `take`.
    pub fn page<E: From<StoreError>>(
        &self,
        before: Option<JobId>,
        limit: usize,
        take: impl FnMut(usize) -> Result<(), E>,
    ) -> Result<Page<Job>, E> {
        let mut page = self.inner.store.page_of_jobs(before, limit, take)?;
        let state = self.inner.state();
        for job in &mut page.items {
            if let Some(latest) = state.in_memory(job.id) {
                *job = latest;
            }
        }
        Ok(page)
    }

    /// Cancels a job: at once where it waits; where it runs, at its next look, so it may still be `processing` in the
    /// answer, and may even succeed if it was at its end.
    ///
    /// # Errors
    /// [`JobError::NoJob`]; [`JobError::Finished`]; [`JobError::Store`].
    pub fn cancel(&self, id: JobId) -> Result<Job, JobError> {
        let mut state = self.inner.state();
        let Some(mut job) = state.channels.get(&id).map(|channel| channel.borrow().clone()) else {
            drop(state);
            let job = self.inner.store.job(id)?;
            return Err(JobError::Finished { id, state: job.state });
        };
        if let Some(running) = &mut state.running
            && running.id == id
        {
            running.on_request = true;
            running.cancel.cancel();
            return Ok(job);
        }
        job.state = JobState::Cancelled;
        job.finished_at = Some(Timestamp::now());
        self.inner.store.put_job(&job)?;
        metrics::count(&job);
        state.waiting.retain(|waiting| *waiting != id);
        if let Some(channel) = state.channels.remove(&id) {
            channel.send_replace(job.clone());
        }
        self.inner.count(&state);
        Ok(job)
    }

    /// Follows a job. The channel holds its latest state, and closes after the final one; a job that is finished
    /// already gives a channel that is closed and holds it.
    ///
    /// # Errors
    /// [`JobError::NoJob`]; [`JobError::Store`].
    pub fn subscribe(&self, id: JobId) -> Result<watch::Receiver<Job>, JobError> {
        if let Some(channel) = self.inner.state().channels.get(&id) {
            return Ok(channel.subscribe());
        }
        Ok(watch::Sender::new(self.job(id)?).subscribe())
    }

    /// The index queries run against. Never blocks; hold it for as long as a query runs, and it stays what it is.
    pub fn live_index(&self) -> Arc<LiveIndex> {
        self.inner.live.current()
    }

    /// Lets queries see that classes were renamed or deleted.
    ///
    /// # Errors
    /// [`JobError::Store`] where the catalogue cannot be read.
    pub fn follow_catalogue(&self) -> Result<(), JobError> {
        Ok(self.inner.live.follow_catalogue(&self.inner.store)?)
    }

    /// Jobs waiting or being worked on. Never blocks.
    pub fn queue_depth(&self) -> usize {
        self.inner.depth.load(Ordering::Relaxed)
    }

    /// Whether the worker takes jobs; readiness asks.
    pub fn is_running(&self) -> bool {
        let state = self.inner.state();
        !state.stopping && !state.stopped
    }

    /// Stops the worker; a running job goes back to the queue, for the next start. Waits up to the deadline and says
    /// whether the worker has ended by then.
    pub fn shutdown(&self, deadline: Duration) -> bool {
        self.inner.stop();
        self.inner.wait_stopped(deadline)
    }
}
