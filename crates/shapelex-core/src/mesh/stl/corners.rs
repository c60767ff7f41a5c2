//! Equal corners of triangles → one vertex.

use super::super::builder::SoupBuilder;
use super::super::precision::Decimal;
use super::super::{MeshError, ReadContext};
use foldhash::fast::RandomState;
use hashbrown::HashTable;
use std::hash::BuildHasher;

/// The vertices of a soup by their coordinates. The hash has a seed of its process, so that a file cannot be made to
/// have many equal ones; which index a vertex gets does not depend on it.
pub(super) struct Corners<'a> {
    context: &'a ReadContext,
    table: HashTable<u32>,
    hasher: RandomState,
    /// Bytes reserved for the table.
    held: u64,
}

fn key(point: &[f64; 3]) -> [u64; 3] {
    // 0 and −0 are the same place.
    point.map(|x| (x + 0.0).to_bits())
}

impl<'a> Corners<'a> {
    /// No vertices.
    pub fn new(context: &'a ReadContext) -> Self {
        Self {
            context,
            table: HashTable::new(),
            hasher: RandomState::default(),
            held: 0,
        }
    }

    /// The index of a corner's vertex, which is appended to the soup if there is none at its place.
    ///
    /// Errors: those of [`SoupBuilder::push_vertex`].
    #[inline]
    pub fn index(&mut self, corner: [Decimal; 3], soup: &mut SoupBuilder<'_>) -> Result<u32, MeshError> {
        if self.table.len() == self.table.capacity() {
            self.grow(soup.vertices())?;
        }
        let wanted = key(&corner.map(|x| x.value));
        let hash = self.hasher.hash_one(wanted);
        let vertices = soup.vertices();
        if let Some(&index) = self.table.find(hash, |&k| key(&vertices[k as usize]) == wanted) {
            return Ok(index);
        }
        let index = vertices.len() as u32;
        soup.push_vertex(corner)?;
        let vertices = soup.vertices();
        let hasher = |&k: &u32| self.hasher.hash_one(key(&vertices[k as usize]));
        self.table.insert_unique(hash, index, hasher);
        Ok(index)
    }

    #[cold]
    fn grow(&mut self, vertices: &[[f64; 3]]) -> Result<(), MeshError> {
        let wanted = (2 * self.table.len()).max(1024);
        // A power of two of buckets, at most 7/8 full, with a byte beside each index.
        let after = ((wanted * 8 / 7 + 1).next_power_of_two() * (size_of::<u32>() + 1) + 32) as u64;
        self.context.memory.grow(after)?;
        let more = wanted - self.table.len();
        self.table
            .reserve(more, |&k| self.hasher.hash_one(key(&vertices[k as usize])));
        self.context.memory.shrink(self.held);
        self.held = after;
        debug_assert!(self.table.allocation_size() as u64 <= after);
        Ok(())
    }
}

impl Drop for Corners<'_> {
    fn drop(&mut self) {
        self.context.memory.shrink(self.held);
    }
}
