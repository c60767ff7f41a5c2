//! What a reader works within: limits, a stop flag, and memory that is granted before it is taken.

use super::Limits;
use crate::cancel::Cancel;
use crate::memory::{MemoryBudget, Reservation};
use std::sync::{Arc, Mutex, PoisonError};

/// Passed to every reader. A reader checks [`limits`](Self::limits) against what the file declares, reserves
/// [`memory`](Self::memory) before each large allocation, and looks at [`cancel`](Self::cancel) at least every 20 ms.
#[derive(Clone, Debug)]
pub struct ReadContext {
    /// Largest mesh that is read.
    pub limits: Limits,
    /// Set when the result is no longer wanted.
    pub cancel: Cancel,
    /// The memory of the request the file belongs to.
    pub memory: Arc<Reservation>,
    /// What was left out of the mesh.
    pub warnings: Warnings,
}

/// Sentences about files that were read, though not all of what they hold. Clones collect into the same list.
#[derive(Clone, Debug, Default)]
pub struct Warnings(Arc<Mutex<Vec<String>>>);

impl Warnings {
    /// Adds a sentence, unless it is there already.
    pub fn add(&self, sentence: impl Into<String>) {
        let mut list = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let sentence = sentence.into();
        if !list.contains(&sentence) {
            list.push(sentence);
        }
    }

    /// The sentences so far.
    pub fn list(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl ReadContext {
    /// A context that is never stopped and whose memory is not limited: for tools and tests.
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            cancel: Cancel::new(),
            memory: Arc::new(MemoryBudget::unlimited().reservation()),
            warnings: Warnings::default(),
        }
    }
}

impl From<&Limits> for ReadContext {
    fn from(limits: &Limits) -> Self {
        Self::new(*limits)
    }
}
