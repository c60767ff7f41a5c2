//! How much work one file may cause, and the look at the stop flag while it is done.
//!
//! A glTF file refers to its parts by number, so a small file can ask for products: every node × every joint, every
//! morph target × every vertex, every channel × every pose. Each loop here announces its steps before it takes them.

use crate::cancel::Cancel;
use crate::mesh::MeshError;
use std::cell::Cell;

/// Most steps of one reading; a step takes about a nanosecond. The largest mesh the limits allow takes a tenth of it;
/// 64 poses of a skinned mesh of 125 000 vertices, with four joints each, take a quarter.
const MAX_STEPS: u64 = 2_000_000_000;

/// Elements that a loop handles between two calls of [`Work::spend`].
pub(super) const BLOCK: usize = 4096;

/// Counts the steps of one reading.
pub(super) struct Work<'c> {
    cancel: &'c Cancel,
    spent: Cell<u64>,
}

impl<'c> Work<'c> {
    pub fn new(cancel: &'c Cancel) -> Self {
        Self {
            cancel,
            spent: Cell::new(0),
        }
    }

    /// Announces `count` times `each` steps; call it at least every few milliseconds of work.
    ///
    /// Errors: [`MeshError::Cancelled`], and [`MeshError::TooLarge`] with `what`, once all steps together are more than
    /// [`MAX_STEPS`].
    pub fn spend(&self, count: usize, each: u64, what: &'static str) -> Result<(), MeshError> {
        self.cancel.check()?;
        let steps = (count as u64).saturating_mul(each);
        let spent = self.spent.get().saturating_add(steps);
        self.spent.set(spent);
        if spent > MAX_STEPS {
            return Err(MeshError::TooLarge {
                what,
                found: usize::try_from(spent).unwrap_or(usize::MAX),
                limit: MAX_STEPS as usize,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_add_up_and_a_stop_is_seen() {
        let cancel = Cancel::new();
        let work = Work::new(&cancel);
        assert_eq!(work.spend(1_000_000, 1000, "steps"), Ok(()));
        assert_eq!(work.spend(1_000_000, 1000, "steps"), Ok(()));
        let error = work.spend(1, 1, "steps").expect_err("more than the limit");
        assert_eq!(
            error,
            MeshError::TooLarge {
                what: "steps",
                found: 2_000_000_001,
                limit: 2_000_000_000
            }
        );
        cancel.cancel();
        assert!(matches!(
            Work::new(&cancel).spend(0, 0, "steps"),
            Err(MeshError::Cancelled(_))
        ));
    }
}
