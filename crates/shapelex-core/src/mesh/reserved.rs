//! A vector whose memory is reserved before it is allocated.

use crate::memory::{MemoryError, Reservation};

/// First capacity of a vector that grows by itself.
const FIRST: usize = 256;

/// A vector that takes its memory from a [`Reservation`] and gives it back when dropped.
#[derive(Debug)]
pub(super) struct ReservedVec<'a, T> {
    items: Vec<T>,
    memory: &'a Reservation,
}

impl<'a, T> ReservedVec<'a, T> {
    /// An empty vector.
    pub fn new(memory: &'a Reservation) -> Self {
        Self {
            items: Vec::new(),
            memory,
        }
    }

    fn bytes(capacity: usize) -> u64 {
        (capacity as u64).saturating_mul(size_of::<T>() as u64)
    }

    /// Makes room for exactly `more` further items.
    ///
    /// Errors: [`MemoryError`]. Old and new memory are reserved together while the items move.
    pub fn reserve_exact(&mut self, more: usize) -> Result<(), MemoryError> {
        let before = self.items.capacity();
        let needed = self.items.len().saturating_add(more);
        if needed <= before {
            return Ok(());
        }
        self.memory.grow(Self::bytes(needed))?;
        self.items.reserve_exact(more);
        self.memory.shrink(Self::bytes(before));
        Ok(())
    }

    #[cold]
    fn double(&mut self, more: usize) -> Result<(), MemoryError> {
        self.reserve_exact(self.items.capacity().max(more).max(FIRST))
    }

    /// Appends an item, doubling the capacity where it is used up.
    ///
    /// Errors: [`MemoryError`].
    #[inline]
    pub fn push(&mut self, item: T) -> Result<(), MemoryError> {
        if self.items.len() == self.items.capacity() {
            self.double(1)?;
        }
        self.items.push(item);
        Ok(())
    }

    /// Appends `count` items, doubling the capacity where it is used up.
    ///
    /// Errors: [`MemoryError`].
    #[inline]
    pub fn extend(&mut self, count: usize, items: impl Iterator<Item = T>) -> Result<(), MemoryError> {
        if self.items.capacity() - self.items.len() < count {
            self.double(count)?;
        }
        self.items.extend(items.take(count));
        Ok(())
    }

    /// Removes all items and keeps the memory.
    pub fn clear(&mut self) {
        self.items.clear();
    }

    /// The last item.
    pub fn last_mut(&mut self) -> Option<&mut T> {
        self.items.last_mut()
    }

    /// The vector itself, whose memory stays reserved.
    pub fn into_inner(mut self) -> Vec<T> {
        // Dropping an empty vector gives nothing back.
        std::mem::take(&mut self.items)
    }
}

impl<T> std::ops::Deref for ReservedVec<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.items
    }
}

impl<T> Drop for ReservedVec<'_, T> {
    fn drop(&mut self) {
        self.memory.shrink(Self::bytes(self.items.capacity()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::MemoryBudget;

    #[test]
    fn memory_is_reserved_before_and_given_back_after() {
        let memory = MemoryBudget::new(10_000).reservation();
        let mut items: ReservedVec<'_, u64> = ReservedVec::new(&memory);
        let mut pushed = 0u64;
        // 256, then 512 items: 4096 bytes beside the 2048 that are copied. The next step does not fit.
        while items.push(pushed).is_ok() {
            pushed += 1;
        }
        assert_eq!((pushed, memory.bytes()), (512, 4096));
        assert!(items.reserve_exact(1_000_000).is_err());
        assert!(items.iter().copied().eq(0..512));
        let kept = items.into_inner();
        assert_eq!((kept.len(), memory.bytes()), (512, 4096));
        memory.shrink(4096);
        let mut items: ReservedVec<'_, u32> = ReservedVec::new(&memory);
        items.extend(3, [1, 2, 3, 4].into_iter()).expect("fits");
        assert_eq!((&items[..], memory.bytes()), (&[1, 2, 3][..], 1024));
        drop(items);
        assert_eq!(memory.bytes(), 0);
    }
}
