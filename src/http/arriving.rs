//! Bytes that arrive piece by piece, reserved before they are kept.

use bytes::Bytes;
use shapelex_core::memory::{MemoryError, Reservation};

/// Least and most bytes that are reserved ahead of what has arrived.
const LEAST_AHEAD: usize = 4 << 10;
const MOST_AHEAD: usize = 1 << 20;
/// Up to this many bytes are moved to a larger buffer; from then on room for all that can still arrive is asked for
/// at once. Pages that nothing is written to cost nothing, a second copy of a large body would.
const MOVED: usize = 1 << 20;

/// A body, a part of it or a file that is unpacked from it, as far as it has arrived.
///
/// It counts as what has been written, not as what was declared: otherwise a few clients that declare much and send
/// nothing would keep all others out.
#[derive(Debug)]
pub struct Arriving<'a> {
    bytes: Vec<u8>,
    reserved: usize,
    most: usize,
    memory: &'a Reservation,
}

impl<'a> Arriving<'a> {
    /// Nothing yet, of at most `most` bytes.
    pub fn new(most: usize, memory: &'a Reservation) -> Self {
        Self {
            bytes: Vec::new(),
            reserved: 0,
            most,
            memory,
        }
    }

    /// Bytes that have arrived.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Whether nothing has.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Keeps a piece. The caller has checked that it is not more than can arrive.
    ///
    /// # Errors
    /// [`MemoryError`] where there is no memory for it.
    pub fn push(&mut self, piece: &[u8]) -> Result<(), MemoryError> {
        let needed = self.bytes.len() + piece.len();
        if needed > self.reserved {
            let ahead = (needed / 8).clamp(LEAST_AHEAD, MOST_AHEAD);
            let target = (needed + ahead).min(self.most.max(needed));
            self.memory.grow_body((target - self.reserved) as u64)?;
            self.reserved = target;
        }
        if needed > self.bytes.capacity() {
            self.enlarge(needed)?;
        }
        self.bytes.extend_from_slice(piece);
        Ok(())
    }

    fn enlarge(&mut self, needed: usize) -> Result<(), MemoryError> {
        let all = self.most.max(needed);
        let wanted = if needed > MOVED { all } else { all.min(2 * needed) };
        let length = self.bytes.len();
        // A system that gives no more than it has refuses the large request, and may still grant the small one.
        self.bytes
            .try_reserve_exact(wanted - length)
            .or_else(|_| self.bytes.try_reserve_exact(needed - length))
            .map_err(|_| MemoryError::NotNow {
                needed: needed as u64,
                used: self.memory.bytes(),
                limit: self.memory.bytes(),
            })
    }

    /// What arrived. It stays reserved.
    pub fn finish(mut self) -> Vec<u8> {
        if self.bytes.capacity() - self.bytes.len() > MOVED {
            self.bytes.shrink_to_fit();
        }
        self.memory.shrink_body((self.reserved - self.bytes.len()) as u64);
        self.bytes
    }

    /// As [`finish`](Self::finish), to be shared.
    pub fn into_bytes(self) -> Bytes {
        self.finish().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shapelex_core::memory::MemoryBudget;

    #[test]
    fn what_has_arrived_is_reserved_and_little_more() {
        const MIB: usize = 1 << 20;
        let budget = MemoryBudget::new(40 * MIB as u64);
        let memory = budget.reservation();
        let mut arriving = Arriving::new(128 * MIB, &memory);
        let piece = vec![7; 10_000];
        for _ in 0..1000 {
            arriving.push(&piece).expect("fits");
            let (there, reserved) = (arriving.len() as u64, memory.bytes());
            assert!(
                (there..=there + there / 8 + 4096).contains(&reserved),
                "{there} {reserved}"
            );
        }
        let refused = (0..2000).find_map(|_| arriving.push(&piece).err());
        assert!(matches!(refused, Some(MemoryError::NeverFits { limit, .. }) if limit == 20 * MIB as u64));
        let bytes = arriving.finish();
        assert!(bytes.capacity() < bytes.len() + 2 * MIB);
        assert_eq!(memory.bytes(), bytes.len() as u64);
    }
}
