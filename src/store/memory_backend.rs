//! A backend in memory that fails where a test wants it to and forgets what was never flushed.

use super::StoreError;
use super::backend::{Backend, Batch, Entry};
use super::ordered_map::OrderedMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

#[derive(Default)]
struct State {
    current: OrderedMap,
    durable: OrderedMap,
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
            map.apply(batch);
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
        if let Some(value) = state.current.0.get_mut(key) {
            let at = at % value.len().max(1);
            value[at] ^= 0x20;
        }
    }

    /// All keys.
    pub fn keys(&self) -> Vec<Vec<u8>> {
        self.state().current.0.keys().cloned().collect()
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

impl Backend for MemoryBackend {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, StoreError> {
        Ok(self.state().current.get(key))
    }

    fn scan(&self, prefix: &[u8], after: Option<&[u8]>, limit: usize) -> Result<Vec<Entry>, StoreError> {
        Ok(self.state().current.scan(prefix, after, limit))
    }

    fn scan_back(
        &self,
        prefix: &[u8],
        before: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Entry>, StoreError> {
        Ok(self.state().current.scan_back(prefix, before, limit))
    }

    fn apply(&self, batch: &Batch) -> Result<(), StoreError> {
        let mut state = self.state();
        state.write()?;
        state.current.apply(batch);
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
            map.apply(batch);
        }
        state.current.clone_from(&map);
        state.durable = map;
        done
    }
}
