//! The clock of a query that names its own time limit.

use super::problem::{Code, Problem};
use shapelex_core::cancel::Cancel;
use std::time::Duration;

/// The end of a query's time. Dropping it is the end too, so that the work stops where the client goes away.
pub struct TimeLimit {
    view: TimeView,
    timer: tokio::task::JoinHandle<()>,
}

/// What the work looks at.
#[derive(Clone)]
pub struct TimeView {
    /// Set at the end.
    pub over: Cancel,
    /// What was asked for.
    pub limit: Duration,
}

impl TimeLimit {
    /// Starts the clock. Needs the runtime.
    pub fn start(limit: Duration) -> Self {
        let over = Cancel::new();
        let flag = over.clone();
        let timer = tokio::spawn(async move {
            tokio::time::sleep(limit).await;
            flag.cancel();
        });
        let view = TimeView { over, limit };
        Self { view, timer }
    }

    /// What the work looks at, without what ends it.
    pub fn view(&self) -> TimeView {
        self.view.clone()
    }
}

impl TimeView {
    /// The problem of a query whose time was over before any class was scored.
    pub fn nothing_scored(&self) -> Problem {
        let seconds = self.limit.as_secs_f64();
        Problem::new(
            Code::DeadlineExceeded,
            format!("no class was scored within the {seconds:.3} s the query asked for"),
        )
        .with("limit_seconds", seconds)
    }
}

impl Drop for TimeLimit {
    fn drop(&mut self) {
        self.view.over.cancel();
        self.timer.abort();
    }
}
