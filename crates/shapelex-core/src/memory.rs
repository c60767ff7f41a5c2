//! A budget for memory: bytes are counted before they are taken.
//!
//! One [`MemoryBudget`] covers everything that requests hold at the same time. Each request has one [`Reservation`]
//! of it, which grows by what the request is about to allocate and is given back as a whole when it is dropped.
//! Growing never waits: a request that holds memory and waits for more could block every other one.
//!
//! Bodies, and what is unpacked of them, are held for as long as a client likes. They count twice: against the budget,
//! and against a share of it, so that memory to compute with is always left. Within that share the last eighth is kept
//! for small bodies, so that large ones which arrive slowly do not keep them out.

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

/// Of the budget, one part in this many may be bodies.
const BODIES: u64 = 2;
/// Of the share of bodies, one part in this many is kept for small ones.
const KEPT_FOR_SMALL: u64 = 8;
/// A body up to this many bytes is small.
const SMALL_BODY: u64 = 1 << 20;

/// Bytes in use.
#[derive(Debug, Default)]
struct Counter(AtomicU64);

impl Counter {
    fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Adds `bytes` where the sum stays within `limit`; else says what is in use.
    fn take(&self, bytes: u64, limit: u64) -> Result<(), u64> {
        let fits = |used: u64| used.checked_add(bytes).filter(|sum| *sum <= limit);
        self.0
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, fits)
            .map(drop)
    }

    fn add(&self, bytes: u64) {
        self.0.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Takes `bytes` off, or all there is, and says how many that were.
    fn give_back(&self, bytes: u64) -> u64 {
        let left = |used: u64| Some(used.saturating_sub(bytes));
        let before = self
            .0
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, left)
            .unwrap_or_else(|used| used);
        before.min(bytes)
    }
}

#[derive(Debug)]
struct Shared {
    limit: u64,
    used: Counter,
    /// The part of `used` that is bodies.
    bodies: Counter,
}

/// A number of bytes that may be reserved at the same time. Clones share the same budget.
#[derive(Clone, Debug)]
pub struct MemoryBudget(Arc<Shared>);

impl MemoryBudget {
    /// A budget of `limit` bytes.
    pub fn new(limit: u64) -> Self {
        Self(Arc::new(Shared {
            limit,
            used: Counter::default(),
            bodies: Counter::default(),
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
        self.0.used.get()
    }

    /// Bytes that bodies may take, all together.
    pub fn body_limit(&self) -> u64 {
        self.0.limit / BODIES
    }

    /// Bytes that bodies take now.
    pub fn bodies(&self) -> u64 {
        self.0.bodies.get()
    }

    /// An empty reservation of this budget.
    pub fn reservation(&self) -> Reservation {
        Reservation {
            budget: self.clone(),
            elsewhere: 0,
            work: Counter::default(),
            body: Counter::default(),
        }
    }

    /// Takes `bytes` for a reservation that holds `held`.
    fn take(&self, bytes: u64, held: u64) -> Result<(), MemoryError> {
        let limit = self.0.limit;
        let needed = held.saturating_add(bytes);
        if needed > limit {
            return Err(MemoryError::NeverFits { needed, limit });
        }
        let not_now = |used| MemoryError::NotNow {
            needed: bytes,
            used,
            limit,
        };
        self.0.used.take(bytes, limit).map_err(not_now)
    }

    /// Takes `bytes` for a reservation whose body has `held`, from the share of bodies alone.
    fn take_for_body(&self, bytes: u64, held: u64) -> Result<(), MemoryError> {
        let share = self.body_limit();
        let needed = held.saturating_add(bytes);
        if needed > share {
            return Err(MemoryError::NeverFits { needed, limit: share });
        }
        // One that is all there is may have the whole share.
        let alone = self.bodies() <= held;
        let limit = match needed {
            0..=SMALL_BODY => share,
            _ if alone => share,
            _ => share - share / KEPT_FOR_SMALL,
        };
        let not_now = |used| MemoryError::NotNow {
            needed: bytes,
            used,
            limit,
        };
        self.0.bodies.take(bytes, limit).map_err(not_now)
    }
}

/// What one request has reserved; given back when dropped.
#[derive(Debug)]
pub struct Reservation {
    budget: MemoryBudget,
    /// What the request holds in another reservation.
    elsewhere: u64,
    work: Counter,
    body: Counter,
}

impl Reservation {
    /// Bytes reserved.
    pub fn bytes(&self) -> u64 {
        self.work.get().saturating_add(self.body.get())
    }

    /// An empty reservation for one step of the same request's work, given back when that step ends. What never fits
    /// beside what this one holds never fits there.
    pub fn step(&self) -> Self {
        let mut step = self.budget.reservation();
        step.elsewhere = self.elsewhere.saturating_add(self.bytes());
        step
    }

    /// Reserves `bytes` more, to be called before they are allocated.
    ///
    /// # Errors
    /// [`MemoryError::NeverFits`] where this request alone would exceed the budget, [`MemoryError::NotNow`] where
    /// all reservations together would.
    pub fn grow(&self, bytes: u64) -> Result<(), MemoryError> {
        let held = self.elsewhere.saturating_add(self.bytes());
        self.budget.take(bytes, held)?;
        self.work.add(bytes);
        Ok(())
    }

    /// Counts `bytes` that have been taken already, whether they fit or not.
    pub fn add(&self, bytes: u64) {
        self.budget.0.used.add(bytes);
        self.work.add(bytes);
    }

    /// Gives `bytes` back, or all where fewer are reserved. What a body takes is not meant.
    pub fn shrink(&self, bytes: u64) {
        let bytes = self.work.give_back(bytes);
        self.budget.0.used.give_back(bytes);
    }

    /// Reserves `bytes` more of a body, or of what is unpacked of it.
    ///
    /// # Errors
    /// As [`grow`](Self::grow); the same for the share of bodies.
    pub fn grow_body(&self, bytes: u64) -> Result<(), MemoryError> {
        self.budget.take_for_body(bytes, self.body.get())?;
        let held = self.elsewhere.saturating_add(self.bytes());
        if let Err(error) = self.budget.take(bytes, held) {
            self.budget.0.bodies.give_back(bytes);
            return Err(error);
        }
        self.body.add(bytes);
        Ok(())
    }

    /// Gives `bytes` of a body back, or all where fewer are reserved.
    pub fn shrink_body(&self, bytes: u64) {
        let bytes = self.body.give_back(bytes);
        self.budget.0.bodies.give_back(bytes);
        self.budget.0.used.give_back(bytes);
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
        self.shrink(u64::MAX);
        self.shrink_body(u64::MAX);
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
    fn bodies_never_take_what_computing_needs_nor_large_ones_what_small_ones_need() {
        const MIB: u64 = 1 << 20;
        let budget = MemoryBudget::new(64 * MIB);
        let (large, other, small) = (budget.reservation(), budget.reservation(), budget.reservation());
        assert_eq!(
            large.grow_body(33 * MIB),
            Err(MemoryError::NeverFits {
                needed: 33 * MIB,
                limit: 32 * MIB
            })
        );
        assert_eq!(large.grow_body(26 * MIB), Ok(()));
        // 28 of the 32 MiB are for large ones.
        assert!(matches!(
            other.grow_body(3 * MIB),
            Err(MemoryError::NotNow { limit, .. }) if limit == 28 * MIB
        ));
        assert_eq!(small.grow_body(MIB), Ok(()));
        assert_eq!((budget.bodies(), budget.used()), (27 * MIB, 27 * MIB));
        assert_eq!(
            small.grow(37 * MIB),
            Ok(()),
            "half of the budget is left to compute"
        );
        assert!(small.grow(MIB).is_err());
        // A step counts what its request holds elsewhere.
        assert_eq!(
            large.step().grow(39 * MIB),
            Err(MemoryError::NeverFits {
                needed: 65 * MIB,
                limit: 64 * MIB
            })
        );
        large.shrink_body(6 * MIB);
        large.shrink(u64::MAX);
        assert_eq!((large.bytes(), budget.bodies()), (20 * MIB, 21 * MIB));
        drop((large, other, small));
        assert_eq!((budget.bodies(), budget.used()), (0, 0));
    }

    #[test]
    fn what_was_taken_anyway_is_missing_to_the_others() {
        let budget = MemoryBudget::new(100);
        let answer = budget.reservation();
        answer.add(150);
        assert!(budget.reservation().grow(1).is_err());
        drop(answer);
        assert_eq!(budget.used(), 0);
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
