//! When a query stops before it is done, and what it answers then.

use crate::cancel::Cancel;

/// What a query answers that is stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AtDeadline {
    /// An error.
    #[default]
    Fail,
    /// The ranking of the classes that were scored by then; an error where there is none.
    BestSoFar,
}

/// The end of a query's time. The core reads no clock: the caller sets the flag.
#[derive(Clone, Debug, Default)]
pub struct Deadline {
    /// Set at the deadline, and when the client has left.
    pub passed: Cancel,
    /// What is answered then.
    pub then: AtDeadline,
}

impl Deadline {
    /// A query that fails when `cancel` is set.
    pub fn fail_at(cancel: &Cancel) -> Self {
        Self {
            passed: cancel.clone(),
            then: AtDeadline::Fail,
        }
    }

    /// A query that answers with the best ranking there is when `passed` is set.
    pub fn best_so_far_at(passed: &Cancel) -> Self {
        Self {
            passed: passed.clone(),
            then: AtDeadline::BestSoFar,
        }
    }
}
