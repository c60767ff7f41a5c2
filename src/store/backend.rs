//! What the store needs of a key-value engine, and nothing more: so narrow that a test can put its own in place.

use super::StoreError;

/// A key with its value.
pub type Entry = (Vec<u8>, Vec<u8>);

/// Writes that happen together or not at all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Batch {
    /// Keys with their new value, `None` to delete; a later entry of the same key wins.
    pub writes: Vec<(Vec<u8>, Option<Vec<u8>>)>,
}

impl Batch {
    /// Sets a key.
    pub fn put(&mut self, key: Vec<u8>, value: Vec<u8>) {
        self.writes.push((key, Some(value)));
    }

    /// Removes a key, if it is there.
    pub fn delete(&mut self, key: Vec<u8>) {
        self.writes.push((key, None));
    }

    /// Whether nothing is to be written.
    pub fn is_empty(&self) -> bool {
        self.writes.is_empty()
    }
}

/// An ordered map of byte strings that survives the process.
pub trait Backend: Send + Sync {
    /// The value of a key.
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, StoreError>;

    /// Up to `limit` entries whose key starts with `prefix`, ascending, those after `after` only.
    fn scan(&self, prefix: &[u8], after: Option<&[u8]>, limit: usize) -> Result<Vec<Entry>, StoreError>;

    /// Up to `limit` entries whose key starts with `prefix`, descending, those before `before` only.
    fn scan_back(&self, prefix: &[u8], before: Option<&[u8]>, limit: usize)
    -> Result<Vec<Entry>, StoreError>;

    /// Applies a batch atomically. It may be lost in a crash until [`flush`](Backend::flush) has returned, but never
    /// in part.
    fn apply(&self, batch: &Batch) -> Result<(), StoreError>;

    /// Makes everything applied before durable.
    fn flush(&self) -> Result<(), StoreError>;

    /// Lets go of everything in memory, does `meanwhile` while nothing is open, and opens what the disk holds then.
    /// Reads wait for it. Opens also where `meanwhile` fails, and returns its failure.
    fn reopen(&self, meanwhile: &mut dyn FnMut() -> Result<(), StoreError>) -> Result<(), StoreError>;
}

/// The smallest key greater than every key that starts with `prefix`; `None` where there is none.
pub(super) fn prefix_end(prefix: &[u8]) -> Option<Vec<u8>> {
    let last = prefix.iter().rposition(|&byte| byte != 0xff)?;
    let mut end = prefix[..=last].to_vec();
    end[last] += 1;
    Some(end)
}
