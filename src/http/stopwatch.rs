//! How long the stages of a query take.

use shapelex_core::pipeline::{Stage, StageSpan};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Times stages by their beginnings; the times of a stage that begins again, as under a second hypothesis, add up.
#[derive(Default)]
pub(super) struct Stopwatch {
    running: RefCell<Option<(Stage, Instant)>>,
    sums: RefCell<BTreeMap<Stage, Duration>>,
    span: StageSpan,
}

impl Stopwatch {
    /// Ends the stage before and begins this one.
    pub(super) fn begin(&self, stage: Stage) {
        self.span.begin(stage);
        let before = self.running.replace(Some((stage, Instant::now())));
        self.add(before);
    }

    fn add(&self, ended: Option<(Stage, Instant)>) {
        if let Some((stage, began)) = ended {
            *self.sums.borrow_mut().entry(stage).or_default() += began.elapsed();
        }
    }

    /// Ends the last stage.
    pub(super) fn end(self) -> BTreeMap<Stage, Duration> {
        let last = self.running.take();
        self.add(last);
        self.sums.into_inner()
    }
}

/// A duration in milliseconds, to the microsecond, so that logs and answers have no digits without meaning.
pub(super) fn milliseconds(duration: Duration) -> f64 {
    (duration.as_secs_f64() * 1e6).round() / 1e3
}
