//! Records in memory, in the order of their keys.

use super::backend::{Batch, Entry, prefix_end};
use std::collections::BTreeMap;
use std::ops::Bound;

/// An ordered map of byte strings, read the way [`Backend`](super::Backend) reads.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct OrderedMap(pub BTreeMap<Vec<u8>, Vec<u8>>);

impl OrderedMap {
    pub fn get(&self, key: &[u8]) -> Option<Vec<u8>> {
        self.0.get(key).cloned()
    }

    /// Up to `limit` entries whose key starts with `prefix`, ascending, those after `after` only.
    pub fn scan(&self, prefix: &[u8], after: Option<&[u8]>, limit: usize) -> Vec<Entry> {
        let end = prefix_end(prefix);
        let high = end.as_deref().map_or(Bound::Unbounded, Bound::Excluded);
        let low = match after {
            Some(key) if key >= prefix => Bound::Excluded(key),
            _ => Bound::Included(prefix),
        };
        self.range(low, high).take(limit).collect()
    }

    /// Up to `limit` entries whose key starts with `prefix`, descending, those before `before` only.
    pub fn scan_back(&self, prefix: &[u8], before: Option<&[u8]>, limit: usize) -> Vec<Entry> {
        let end = prefix_end(prefix);
        let high = match (before, end.as_deref()) {
            (Some(key), Some(end)) => Bound::Excluded(key.min(end)),
            (Some(key), None) | (None, Some(key)) => Bound::Excluded(key),
            (None, None) => Bound::Unbounded,
        };
        self.range(Bound::Included(prefix), high)
            .rev()
            .take(limit)
            .collect()
    }

    fn range(&self, low: Bound<&[u8]>, high: Bound<&[u8]>) -> impl DoubleEndedIterator<Item = Entry> {
        let empty = match (low, high) {
            (Bound::Included(l) | Bound::Excluded(l), Bound::Excluded(h)) => l >= h,
            _ => false,
        };
        let bounds = if empty {
            (Bound::Included(&[][..]), Bound::Excluded(&[][..]))
        } else {
            (low, high)
        };
        self.0
            .range::<[u8], _>(bounds)
            .map(|(k, v)| (k.clone(), v.clone()))
    }

    pub fn apply(&mut self, batch: &Batch) {
        for (key, value) in &batch.writes {
            match value {
                Some(value) => self.0.insert(key.clone(), value.clone()),
                None => self.0.remove(key),
            };
        }
    }
}
