//! Large buffers kept from one solve to the next.
//!
//! A solve of a small mesh works on a few megabytes; given back to the system and asked for anew, their page faults
//! cost as much as the arithmetic of re-orthogonalisation. So each thread keeps the last few, within a limit; nothing
//! is ever read that the present solve has not written.

use std::cell::RefCell;
use std::ops::{Deref, DerefMut};

/// Buffers a thread keeps, and the most doubles one of them may hold (16 MB).
const KEPT: usize = 4;
const LARGEST_KEPT: usize = 2 << 20;

thread_local! {
    static POOL: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// A buffer of doubles that goes back to its thread's pool when dropped.
#[derive(Debug, Default)]
pub struct Scratch(Vec<f64>);

impl Scratch {
    /// `length` doubles of any value.
    pub fn new(length: usize) -> Self {
        let kept = POOL.with_borrow_mut(|pool| {
            let fits = (0..pool.len()).filter(|&i| pool[i].capacity() >= length);
            fits.min_by_key(|&i| pool[i].capacity())
                .map(|at| pool.swap_remove(at))
        });
        let mut buffer = match kept {
            Some(buffer) => buffer,
            None => vec![0.0; length],
        };
        buffer.resize(length, 0.0);
        Self(buffer)
    }

    /// Keeps the first `length` doubles; the memory of the others is given back to the system where it is much.
    pub fn shrink_to(&mut self, length: usize) {
        self.0.truncate(length);
        if self.0.capacity() > LARGEST_KEPT {
            self.0.shrink_to_fit();
        }
    }
}

impl From<Vec<f64>> for Scratch {
    fn from(buffer: Vec<f64>) -> Self {
        Self(buffer)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let buffer = std::mem::take(&mut self.0);
        if buffer.capacity() == 0 || buffer.capacity() > LARGEST_KEPT {
            return;
        }
        // A thread that is ending has no pool any more; the buffer is then simply freed.
        let _ = POOL.try_with(|pool| {
            let mut pool = pool.borrow_mut();
            pool.push(buffer);
            if pool.len() > KEPT {
                let smallest = (0..pool.len()).min_by_key(|&i| pool[i].capacity());
                smallest.map(|at| pool.swap_remove(at));
            }
        });
    }
}

impl Deref for Scratch {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.0
    }
}

impl DerefMut for Scratch {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_serves_again_and_a_huge_one_does_not() {
        let first = Scratch::new(1000);
        let place = first.as_ptr();
        drop(first);
        let second = Scratch::new(900);
        assert_eq!((second.as_ptr(), second.len()), (place, 900));
        drop((second, Scratch::new(LARGEST_KEPT + 1)));
        assert!(POOL.with_borrow(|pool| pool.len() == 1 && pool[0].capacity() >= 1000));
    }
}
