//! What preparing works under: a stop flag, and memory that is granted before it is taken.

use super::MeshError;
use crate::cancel::{Cancel, Cancelled};
use crate::memory::{Held, Reservation};
use std::convert::Infallible;

/// Steps of a loop between two looks at the flag: some milliseconds where each step misses the cache.
const STRIDE: usize = 1 << 15;

/// Asked by a long loop whether to go on, and before it allocates.
pub(super) trait Watch {
    /// Why the work ends early.
    type Error;
    /// Given back when dropped.
    type Held;

    /// To be called at each step of a loop; `Err` once a stop was asked for.
    fn look(&self, step: usize) -> Result<(), Self::Error>;

    /// As [`look`](Self::look), for a loop whose steps differ in length: the work done before and after one.
    fn pass(&self, before: usize, after: usize) -> Result<(), Self::Error> {
        if before / STRIDE == after / STRIDE {
            return Ok(());
        }
        self.look(0)
    }

    /// Reserves `bytes` for each of `count` elements until the guard is dropped.
    fn hold(&self, count: usize, bytes: usize) -> Result<Self::Held, Self::Error>;
}

/// The flag and the reservation of one call of [`prepare_within`](super::prepare_within).
#[derive(Clone, Copy, Debug)]
pub(super) struct Work<'a> {
    pub cancel: &'a Cancel,
    pub memory: &'a Reservation,
}

impl Work<'_> {
    /// `Err` once a stop was asked for.
    pub fn check(self) -> Result<(), Cancelled> {
        self.cancel.check()
    }
}

impl<'a> Watch for Work<'a> {
    type Error = MeshError;
    type Held = Held<'a>;

    fn look(&self, step: usize) -> Result<(), MeshError> {
        if step & (STRIDE - 1) == 0 {
            self.check()?;
        }
        Ok(())
    }

    fn hold(&self, count: usize, bytes: usize) -> Result<Held<'a>, MeshError> {
        Ok(self.memory.hold(count as u64 * bytes as u64)?)
    }
}

/// Work that is never stopped and whose memory is not counted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unwatched;

impl Watch for Unwatched {
    type Error = Infallible;
    type Held = ();

    fn look(&self, _step: usize) -> Result<(), Infallible> {
        Ok(())
    }

    fn hold(&self, _count: usize, _bytes: usize) -> Result<(), Infallible> {
        Ok(())
    }
}
