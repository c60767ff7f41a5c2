//! A ceiling for the memory of everything requests compute at the same time.
//!
//! Memory is reserved by estimate before it is taken: for reading, by the file's length; for the spectrum, by the
//! number of vertices and eigenpairs. What can never fit is refused for good, what does not fit now for now, so that
//! one enormous mesh ends in a problem and not in the end of the process.

use super::problem::{Code, Problem};
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes reading, cleaning and simplifying take per byte of the file, at most. A triangle of a binary STL has 50 bytes
/// in the file; in memory it is three vertices of 24 bytes and three indices before welding, once more while it is
/// welded, and edges and quadrics while it is simplified.
const READING_FACTOR: u64 = 10;
/// Seconds a client is asked to wait where the memory is only taken for now.
const RETRY_AFTER: u64 = 2;

/// The ceiling and what is reserved of it, in bytes.
pub struct MemoryBudget {
    limit: u64,
    reserved: AtomicU64,
}

/// Reserved memory; given back when dropped.
pub struct Reserved<'a> {
    budget: &'a MemoryBudget,
    bytes: u64,
}

impl Drop for Reserved<'_> {
    fn drop(&mut self) {
        self.budget.reserved.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

impl MemoryBudget {
    /// A budget of so many bytes.
    pub fn new(limit: u64) -> Self {
        Self {
            limit,
            reserved: AtomicU64::new(0),
        }
    }

    /// Bytes reserved now.
    pub fn reserved(&self) -> u64 {
        self.reserved.load(Ordering::Relaxed)
    }

    /// Reserves what reading and preparing a file of this length takes.
    ///
    /// # Errors
    /// As [`MemoryBudget::reserve`].
    pub fn reserve_reading(&self, file_bytes: usize) -> Result<Reserved<'_>, Problem> {
        self.reserve((file_bytes as u64).saturating_mul(READING_FACTOR))
    }

    /// Reserves memory.
    ///
    /// # Errors
    /// `mesh_too_large` where it is more than the whole budget, `overloaded` where too much is taken now.
    pub fn reserve(&self, bytes: u64) -> Result<Reserved<'_>, Problem> {
        if bytes > self.limit {
            let detail = format!(
                "this mesh would take about {} MiB of memory, the budget is {} MiB",
                bytes >> 20,
                self.limit >> 20
            );
            return Err(Problem::new(Code::MeshTooLarge, detail)
                .with("what", "bytes of memory")
                .with("found", bytes)
                .with("limit", self.limit));
        }
        let taken = self
            .reserved
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |reserved| {
                reserved.checked_add(bytes).filter(|sum| *sum <= self.limit)
            });
        match taken {
            Ok(_) => Ok(Reserved { budget: self, bytes }),
            Err(reserved) => Err(Problem::new(
                Code::Overloaded,
                format!(
                    "about {} MiB of memory are needed, and {} of {} MiB are in use",
                    bytes >> 20,
                    reserved >> 20,
                    self.limit >> 20
                ),
            )
            .with("retry_after_seconds", RETRY_AFTER)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_never_fits_what_does_not_fit_now_and_what_fits() {
        let budget = MemoryBudget::new(100);
        let code = |outcome: Result<Reserved<'_>, Problem>| outcome.err().map(|problem| problem.code);
        assert_eq!(code(budget.reserve(101)), Some(Code::MeshTooLarge));
        assert_eq!(code(budget.reserve_reading(11)), Some(Code::MeshTooLarge));
        let first = budget.reserve_reading(6).ok();
        assert_eq!(budget.reserved(), 60);
        assert_eq!(code(budget.reserve(41)), Some(Code::Overloaded));
        assert_eq!(code(budget.reserve(u64::MAX)), Some(Code::MeshTooLarge));
        let second = budget.reserve(40).ok();
        assert!(second.is_some());
        drop((first, second));
        assert_eq!(budget.reserved(), 0);
        assert!(budget.reserve(100).is_ok());
    }
}
