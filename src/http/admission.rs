//! The bounded pool that does the numeric work of requests, and who gets in.
//!
//! No request computes on tokio's threads. A request waits a bounded time for one of as many places as there are
//! threads, and is turned away with 503 where it would wait longer or where too many wait already. Its work stops when
//! its deadline passes or its client goes away: both set the flag the numeric loops look at.

use super::metrics;
use super::problem::{Code, Problem};
use shapelex_core::cancel::Cancel;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};
use tracing::{Instrument, info_span};

/// How the pool is sized.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComputeOptions {
    /// What its threads are called.
    pub name: &'static str,
    /// Threads, and pieces of work at the same time.
    pub threads: usize,
    /// Pieces of work that may wait.
    pub queue: usize,
    /// How long one may wait.
    pub wait: Duration,
}

/// How a piece of work waits for its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// As long as the options say, then 503.
    Bounded,
    /// Until there is one: for the lines of a batch, whose request is in already.
    Batch,
}

/// A piece of work's surroundings.
pub struct Work {
    /// Set when the result is no longer wanted.
    pub cancel: Cancel,
    /// How long it waited for its place.
    pub waited: Duration,
}

/// The pool.
pub struct Compute {
    pool: rayon::ThreadPool,
    places: Arc<Semaphore>,
    waiting: AtomicUsize,
    options: ComputeOptions,
}

impl Compute {
    /// Starts the threads.
    ///
    /// # Errors
    /// Where the system gives no threads.
    pub fn new(options: ComputeOptions) -> Result<Self, rayon::ThreadPoolBuildError> {
        let threads = options.threads.max(1);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(move |i| format!("{}-{i}", options.name))
            .build()?;
        Ok(Self {
            pool,
            places: Arc::new(Semaphore::new(threads)),
            waiting: AtomicUsize::new(0),
            options,
        })
    }

    /// Pieces of work that wait for a place.
    pub fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Relaxed)
    }

    /// Pieces of work that are being done.
    pub fn running(&self) -> usize {
        self.options
            .threads
            .max(1)
            .saturating_sub(self.places.available_permits())
    }

    /// Does a piece of work on the pool. Dropping the future cancels the work.
    ///
    /// # Errors
    /// `overloaded`, `deadline_exceeded`, `shutting_down`, `internal` where the work panicked, and its own.
    pub async fn run<T: Send + 'static>(
        &self,
        patience: Patience,
        time_limit: Duration,
        work: impl FnOnce(&Work) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let asked = Instant::now();
        let place = self.place(patience).instrument(info_span!("wait")).await?;
        let cancel = Cancel::new();
        let stop_on_drop = CancelOnDrop(cancel.clone());
        let surroundings = Work {
            cancel,
            waited: asked.elapsed(),
        };
        let (sender, receiver) = oneshot::channel();
        let span = tracing::Span::current();
        self.pool.spawn_fifo(move || {
            let result = span.in_scope(|| {
                std::panic::catch_unwind(AssertUnwindSafe(|| work(&surroundings))).unwrap_or_else(|panic| {
                    metrics::count_panic();
                    Err(Problem::internal(panic_message(&*panic)))
                })
            });
            // The place is free only now, also when nobody waits for the result any more.
            drop(place);
            let _ = sender.send(result);
        });
        let result = match tokio::time::timeout(time_limit, receiver).await {
            Ok(Ok(result)) => result,
            Ok(Err(_)) => Err(Problem::internal("the compute pool dropped a piece of work")),
            Err(_) => Err(Problem::new(
                Code::DeadlineExceeded,
                format!(
                    "no result within {:.1} s; the mesh may be too large, or the machine too busy",
                    time_limit.as_secs_f64()
                ),
            )
            .with("limit_seconds", time_limit.as_secs_f64())),
        };
        drop(stop_on_drop);
        result
    }

    async fn place(&self, patience: Patience) -> Result<OwnedSemaphorePermit, Problem> {
        let places = self.places.clone();
        if let Ok(place) = places.clone().try_acquire_owned() {
            return Ok(place);
        }
        let closed = |_| {
            Problem::new(
                Code::ShuttingDown,
                "the service is shutting down; try again later",
            )
        };
        if patience == Patience::Batch {
            return places.acquire_owned().await.map_err(closed);
        }
        let before = self.waiting.fetch_add(1, Ordering::Relaxed);
        let _leave = Leave(&self.waiting);
        if before >= self.options.queue {
            return Err(self.overloaded(format!("{before} requests wait already, as many as may")));
        }
        match tokio::time::timeout(self.options.wait, places.acquire_owned()).await {
            Ok(place) => place.map_err(closed),
            Err(_) => Err(self.overloaded(format!(
                "no worker became free within {:.1} s",
                self.options.wait.as_secs_f64()
            ))),
        }
    }

    fn overloaded(&self, detail: String) -> Problem {
        let seconds = self.options.wait.as_secs().clamp(1, 30);
        Problem::new(Code::Overloaded, detail).with("retry_after_seconds", seconds)
    }
}

struct CancelOnDrop(Cancel);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

struct Leave<'a>(&'a AtomicUsize);

impl Drop for Leave<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// What a panic said.
pub fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic
        .downcast_ref::<&str>()
        .map(|s| (*s).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned());
    format!("panic: {}", text.unwrap_or_else(|| "without a message".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pool(queue: usize, wait: u64) -> Compute {
        Compute::new(ComputeOptions {
            name: "test",
            threads: 1,
            queue,
            wait: Duration::from_millis(wait),
        })
        .unwrap()
    }

    const LONG: Duration = Duration::from_secs(30);

    /// Works until it is told to stop, and says that it was.
    fn until_cancelled(work: &Work) -> Result<(), Problem> {
        while !work.cancel.is_cancelled() {
            std::thread::sleep(Duration::from_millis(1));
        }
        Err(Problem::new(Code::Cancelled, "stopped"))
    }

    #[tokio::test]
    async fn a_deadline_stops_the_work_and_frees_the_place() {
        let pool = pool(1, 1000);
        let limit = Duration::from_millis(20);
        let problem = pool
            .run(Patience::Bounded, limit, until_cancelled)
            .await
            .unwrap_err();
        assert_eq!(problem.code, Code::DeadlineExceeded);
        let next = pool.run(Patience::Bounded, LONG, |_| Ok(7)).await;
        assert_eq!(next, Ok(7));
    }

    #[tokio::test]
    async fn a_client_that_leaves_stops_the_work() {
        let pool = pool(1, 1000);
        {
            let left = pool.run(Patience::Bounded, LONG, until_cancelled);
            assert!(
                tokio::time::timeout(Duration::from_millis(20), left)
                    .await
                    .is_err()
            );
        }
        assert_eq!(pool.run(Patience::Bounded, LONG, |_| Ok(7)).await, Ok(7));
    }

    #[tokio::test]
    async fn waiting_is_bounded_in_number_and_time() {
        let pool = pool(1, 40);
        let busy = pool.run(Patience::Bounded, Duration::from_millis(300), until_cancelled);
        let others = async {
            tokio::time::sleep(Duration::from_millis(20)).await;
            tokio::join!(
                pool.run(Patience::Bounded, LONG, |_| Ok(())),
                pool.run(Patience::Bounded, LONG, |_| Ok(())),
                pool.run(Patience::Batch, LONG, |_| Ok(())),
            )
        };
        let (_, (timed_out, turned_away, patient)) = tokio::join!(busy, others);
        assert_eq!(timed_out.unwrap_err().code, Code::Overloaded);
        assert_eq!(turned_away.unwrap_err().code, Code::Overloaded);
        assert_eq!(patient, Ok(()));
        assert_eq!(pool.waiting(), 0);
    }

    #[tokio::test]
    async fn a_panic_is_a_problem_and_the_pool_lives_on() {
        let pool = pool(1, 1000);
        let problem = pool
            .run::<()>(Patience::Bounded, LONG, |_| panic!("on purpose"))
            .await
            .unwrap_err();
        assert_eq!(problem.code, Code::Internal);
        assert_eq!(problem.internal.as_deref(), Some("panic: on purpose"));
        assert_eq!(pool.run(Patience::Bounded, LONG, |_| Ok(7)).await, Ok(7));
    }
}
