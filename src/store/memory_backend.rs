//! A backend in memory that fails where a test wants it to and forgets what was never flushed.

use super::StoreError;
use super::backend::{Backend, Batch, Entry, prefix_end};
use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::{Mutex, MutexGuard, PoisonError};

type Map = BTreeMap<Vec<u8>, Vec<u8>>;

#[derive(Default)]
struct State {
    current: Map,
    durable: Map,
    /// Batches applied since the last flush, oldest first.
    pending: Vec<Batch>,
    writes: u64,
    fail_at: Option<u64>,
    failed: bool,
    /// Whether the planned failure is a full disk.
    full: bool,
    /// Batches that were not flushed and are there all the same when the engine is opened again.
    survivors: usize,
}

/// A map that behaves as an engine does on a disk that may fail: what is applied is visible at once and durable after
/// a flush; from the planned write on, every write fails.
#[derive(Default)]
pub struct MemoryBackend(Mutex<State>);

impl MemoryBackend {
    /// An empty one that never fails.
    pub fn new() -> Self {
        Self::default()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panicking test leaves a map that is still whole.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the `n`-th write from now (an apply or a flush, from 0) and all later ones fail.
    pub fn fail_after(&self, n: u64) {
        let mut state = self.state();
        state.fail_at = Some(state.writes + n);
    }

    /// Like [`fail_after`](Self::fail_after), as a full disk does.
    pub fn fill_after(&self, n: u64) {
        self.fail_after(n);
        self.state().full = true;
    }

    /// The disk has space again. When it is opened again, the engine finds everything flushed and the first
    /// `survivors` of the batches that were not.
    pub fn heal(&self, survivors: usize) {
        let mut state = self.state();
        state.fail_at = None;
        state.survivors = survivors;
    }

    /// How many applies and flushes were tried.
    pub fn writes(&self) -> u64 {
        self.state().writes
    }

    /// Whether a write failed by plan.
    pub fn has_failed(&self) -> bool {
        self.state().failed
    }

    /// What a process finds after a crash: everything flushed, and the first `survivors` of the batches that were
    /// not, since an engine may write out early.
    pub fn after_crash(&self, survivors: usize) -> Self {
        let state = self.state();
        let mut map = state.durable.clone();
        for batch in state.pending.iter().take(survivors) {
            apply(&mut map, batch);
        }
        Self(Mutex::new(State {
            current: map.clone(),
            durable: map,
            ..State::default()
        }))
    }

    /// Changes one byte of a key's value, as a disk that rots would.
    pub fn corrupt(&self, key: &[u8], at: usize) {
        let mut state = self.state();
        if let Some(value) = state.current.get_mut(key) {
            let at = at % value.len().max(1);
            value[at] ^= 0x20;
        }
    }

    /// All keys.
    pub fn keys(&self) -> Vec<Vec<u8>> {
        self.state().current.keys().cloned().collect()
    }
}

fn apply(map: &mut Map, batch: &Batch) {
    for (key, value) in &batch.writes {
        match value {
            Some(value) => map.insert(key.clone(), value.clone()),
            None => map.remove(key),
        };
    }
}

impl State {
    fn write(&mut self) -> Result<(), StoreError> {
        let fails = self.fail_at.is_some_and(|at| self.writes >= at);
        self.writes += 1;
        if fails {
            self.failed = true;
            let what = "write records".to_owned();
            return Err(match self.full {
                true => StoreError::Full { detail: what },
                false => StoreError::Io {
                    what,
                    detail: "planned failure".to_owned(),
                },
            });
        }
        Ok(())
    }
}

fn range(map: &Map, low: Bound<&[u8]>, high: Bound<&[u8]>) -> impl DoubleEndedIterator<Item = Entry> {
    let empty = match (low, high) {
        (Bound::Included(l) | Bound::Excluded(l), Bound::Excluded(h)) => l >= h,
        _ => false,
    };
    let bounds = if empty {
        (Bound::Included(&[][..]), Bound::Excluded(&[][..]))
    } else {
        (low, high)
    };
    map.range::<[u8], _>(bounds).map(|(k, v)| (k.clone(), v.clone()))
}

impl Backend for MemoryBackend {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, StoreError> {
        Ok(self.state().current.get(key).cloned())
    }

    fn scan(&self, prefix: &[u8], after: Option<&[u8]>, limit: usize) -> Result<Vec<Entry>, StoreError> {
        let end = prefix_end(prefix);
        let high = end.as_deref().map_or(Bound::Unbounded, Bound::Excluded);
        let low = match after {
            Some(key) if key >= prefix => Bound::Excluded(key),
            _ => Bound::Included(prefix),
        };
        Ok(range(&self.state().current, low, high).take(limit).collect())
    }

    fn scan_back(
        &self,
        prefix: &[u8],
        before: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Entry>, StoreError> {
        let end = prefix_end(prefix);
        let high = match (before, end.as_deref()) {
            (Some(key), Some(end)) => Bound::Excluded(key.min(end)),
            (Some(key), None) | (None, Some(key)) => Bound::Excluded(key),
            (None, None) => Bound::Unbounded,
        };
        Ok(range(&self.state().current, Bound::Included(prefix), high)
            .rev()
            .take(limit)
            .collect())
    }

    fn apply(&self, batch: &Batch) -> Result<(), StoreError> {
        let mut state = self.state();
        state.write()?;
        apply(&mut state.current, batch);
        state.pending.push(batch.clone());
        Ok(())
    }

    fn flush(&self) -> Result<(), StoreError> {
        let mut state = self.state();
        state.write()?;
        state.pending.clear();
        state.durable = state.current.clone();
        Ok(())
    }
    fn reopen(&self, meanwhile: &mut dyn FnMut() -> Result<(), StoreError>) -> Result<(), StoreError> {
        let mut state = self.state();
        let done = meanwhile();
        let survivors = state.survivors;
        let pending = std::mem::take(&mut state.pending);
        let mut map = state.durable.clone();
        for batch in pending.iter().take(survivors) {
            apply(&mut map, batch);
        }
        state.current.clone_from(&map);
        state.durable = map;
        done
    }
}
