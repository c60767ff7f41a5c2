//! A budget for memory: bytes are counted before they are taken.
//!
//! One [`MemoryBudget`] covers everything that requests hold at the same time. Each request has one [`Reservation`]
//! of it, which grows by what the request is about to allocate and is given back as a whole when it is dropped.
//! Growing never waits: a request that holds memory and waits for more could block every other one.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Why memory was not granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MemoryError {
    /// It is more than the whole budget.
    #[error("about {} MiB of memory are needed, the budget is {} MiB", needed.div_ceil(1 << 20), limit >> 20)]
    NeverFits {
        /// Bytes the request would hold.
        needed: u64,
        /// Bytes of the budget.
        limit: u64,
    },
    /// Other requests hold too much of it at the moment.
    #[error(
        "about {} MiB of memory are needed, and {} of {} MiB are in use", needed.div_ceil(1 << 20), used >> 20, limit >> 20
    )]
    NotNow {
        /// Bytes that were asked for.
        needed: u64,
        /// Bytes in use.
        used: u64,
        /// Bytes of the budget.
        limit: u64,
    },
}

#[derive(Debug)]
struct Counter {
    limit: u64,
    used: AtomicU64,
}

/// A number of bytes that may be reserved at the same time. Clones share the same budget.
#[derive(Clone, Debug)]
pub struct MemoryBudget(Arc<Counter>);

impl MemoryBudget {
    /// A budget of `limit` bytes.
    pub fn new(limit: u64) -> Self {
        Self(Arc::new(Counter {
            limit,
            used: AtomicU64::new(0),
        }))
    }

    /// A budget that grants everything.
    pub fn unlimited() -> Self {
        Self::new(u64::MAX)
    }

    /// Bytes of the budget.
    pub fn limit(&self) -> u64 {
        self.0.limit
    }

    /// Bytes reserved now.
    pub fn used(&self) -> u64 {
        self.0.used.load(Ordering::Relaxed)
    }

    /// An empty reservation of this budget.
    pub fn reservation(&self) -> Reservation {
        Reservation {
            budget: self.clone(),
            bytes: AtomicU64::new(0),
        }
    }

    fn take(&self, bytes: u64, held: u64) -> Result<(), MemoryError> {
        let limit = self.0.limit;
        let needed = held.saturating_add(bytes);
        if needed > limit {
            return Err(MemoryError::NeverFits { needed, limit });
        }
        let taken = self
            .0
            .used
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |used| {
                used.checked_add(bytes).filter(|sum| *sum <= limit)
            });
        match taken {
            Ok(_) => Ok(()),
            Err(used) => Err(MemoryError::NotNow {
                needed: bytes,
                used,
                limit,
            }),
        }
    }

    fn give_back(&self, bytes: u64) {
        self.0.used.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// What one request has reserved; given back when dropped.
#[derive(Debug)]
pub struct Reservation {
    budget: MemoryBudget,
    bytes: AtomicU64,
}

impl Reservation {
    /// Bytes reserved.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Reserves `bytes` more, to be called before they are allocated.
    ///
    /// # Errors
    /// [`MemoryError::NeverFits`] where this reservation alone would exceed the budget, [`MemoryError::NotNow`] where
    /// all reservations together would.
    pub fn grow(&self, bytes: u64) -> Result<(), MemoryError> {
        self.budget.take(bytes, self.bytes())?;
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
        Ok(())
    }

    /// Gives `bytes` back, or all where fewer are reserved.
    pub fn shrink(&self, bytes: u64) {
        let before = self
            .bytes
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |held| {
                Some(held.saturating_sub(bytes))
            })
            .unwrap_or_else(|held| held);
        self.budget.give_back(before.min(bytes));
    }

    /// Reserves `bytes` until the guard is dropped, for memory that is freed before the request ends.
    ///
    /// # Errors
    /// As [`grow`](Self::grow).
    pub fn hold(&self, bytes: u64) -> Result<Held<'_>, MemoryError> {
        self.grow(bytes)?;
        Ok(Held {
            reservation: self,
            bytes,
        })
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.budget.give_back(self.bytes());
    }
}

/// Memory of a [`Reservation`] that is given back when dropped.
#[derive(Debug)]
pub struct Held<'a> {
    reservation: &'a Reservation,
    bytes: u64,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.reservation.shrink(self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_refuses_what_never_fits_and_what_does_not_fit_now() {
        let budget = MemoryBudget::new(100);
        let first = budget.reservation();
        assert_eq!(
            first.grow(101),
            Err(MemoryError::NeverFits {
                needed: 101,
                limit: 100
            })
        );
        assert_eq!(first.grow(60), Ok(()));
        // What it holds already counts towards what can never fit.
        assert_eq!(
            first.grow(41),
            Err(MemoryError::NeverFits {
                needed: 101,
                limit: 100
            })
        );
        let second = budget.reservation();
        assert_eq!(
            second.grow(41),
            Err(MemoryError::NotNow {
                needed: 41,
                used: 60,
                limit: 100
            })
        );
        assert_eq!(second.grow(40), Ok(()));
        drop(first);
        assert_eq!(budget.used(), 40);
        {
            let held = second.hold(60).expect("fits");
            assert_eq!((budget.used(), second.bytes()), (100, 100));
            drop(held);
        }
        second.shrink(1000);
        assert_eq!((budget.used(), second.bytes()), (0, 0));
        assert!(second.grow(u64::MAX).is_err());
    }

    #[test]
    fn threads_never_exceed_the_budget_together() {
        let budget = MemoryBudget::new(1000);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    for _ in 0..2000 {
                        let reservation = budget.reservation();
                        let _ = reservation.grow(300);
                        assert!(budget.used() <= 1000);
                    }
                });
            }
        });
        assert_eq!(budget.used(), 0);
    }
}
