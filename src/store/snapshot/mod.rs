//! Snapshots: everything the store holds at one moment, in one file, made while it is in use and brought back whole
//! or not at all.
//!
//! The file is a tar archive under zstd with these members, in this order:
//!
//! ```text
//! manifest.json           what follows, with lengths and BLAKE3 hashes
//! manifest.blake3         the hash of manifest.json, 64 hexadecimal digits
//! records                 every record: u32 length of the key, u32 length of the value, key, value; little-endian
//! originals/abcd…         every uploaded file, ascending by name
//! ```
//!
//! Jobs are not in it: they are this process's business. Nor are signatures, which are a cache.

mod manifest;
mod read;
mod restore;
mod switch;
mod write;

pub use restore::Staged;
pub(super) use switch::{finish_restore, go_on, log_in_force};

use super::{Store, StoreError, files};
use crate::model::{ContentHash, Snapshot, SnapshotId, SnapshotOrigin};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{MutexGuard, PoisonError, TryLockError};

/// The files a snapshot being written needs: while there is one, nothing is removed from `originals`.
#[derive(Default)]
pub(super) struct Pinned {
    snapshots: usize,
    waiting: BTreeSet<ContentHash>,
}

/// Holds the stored files in place; lets go when dropped.
struct Pin<'a>(&'a Store);

impl Drop for Pin<'_> {
    fn drop(&mut self) {
        let waiting = {
            let mut pinned = self.0.pinned();
            pinned.snapshots -= 1;
            if pinned.snapshots > 0 {
                return;
            }
            std::mem::take(&mut pinned.waiting)
        };
        self.0.remove_unreferenced(waiting.into_iter());
    }
}

impl Store {
    fn pinned(&self) -> MutexGuard<'_, Pinned> {
        // Changed in single steps, each of which leaves it whole.
        self.inner.pinned.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps every stored file from now on, those of changes under way included.
    fn pin(&self) -> Pin<'_> {
        let _no_removal = self.inner.files.write().unwrap_or_else(PoisonError::into_inner);
        self.pinned().snapshots += 1;
        Pin(self)
    }

    /// Whether stored files must stay for now; those that would go are remembered.
    pub(super) fn is_pinned(&self, contents: &BTreeSet<ContentHash>) -> bool {
        let mut pinned = self.pinned();
        let held = pinned.snapshots > 0;
        if held {
            pinned.waiting.extend(contents);
        }
        held
    }

    fn one_at_a_time(&self) -> Result<MutexGuard<'_, ()>, StoreError> {
        match self.inner.snapshots.try_lock() {
            Ok(guard) => Ok(guard),
            Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => Err(StoreError::SnapshotRunning),
        }
    }

    fn snapshot_directory(&self) -> PathBuf {
        self.inner.path.join("snapshots")
    }

    /// Where a snapshot's file lies, for reading it as a stream.
    pub fn snapshot_path(&self, id: SnapshotId) -> PathBuf {
        self.snapshot_directory().join(format!("{id}.tar.zst"))
    }

    fn snapshot_note(&self, id: SnapshotId) -> PathBuf {
        self.snapshot_directory().join(format!("{id}.json"))
    }

    /// A snapshot.
    ///
    /// # Errors
    /// [`StoreError::NoSnapshot`]; [`StoreError::Damaged`]; a failure of the file system.
    pub fn snapshot(&self, id: SnapshotId) -> Result<Snapshot, StoreError> {
        let text = match std::fs::read(self.snapshot_note(id)) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(StoreError::NoSnapshot { id });
            }
            Err(error) => {
                return Err(StoreError::io(
                    format!("read {}", self.snapshot_note(id).display()),
                    &error,
                ));
            }
        };
        serde_json::from_slice(&text)
            .map_err(|e| StoreError::damaged(format!("the description of snapshot {id}"), e.to_string()))
    }

    /// Up to `limit` snapshots, oldest first, those after `after` only.
    ///
    /// # Errors
    /// As [`Store::snapshot`].
    pub fn list_snapshots(
        &self,
        after: Option<SnapshotId>,
        limit: usize,
    ) -> Result<Vec<Snapshot>, StoreError> {
        let mut ids: Vec<SnapshotId> = list(&self.snapshot_directory())?
            .iter()
            .filter_map(|path| path.file_name()?.to_str()?.strip_suffix(".json")?.parse().ok())
            .filter(|id| after.is_none_or(|after| *id > after))
            .collect();
        ids.sort();
        ids.into_iter()
            .take(limit)
            .filter_map(|id| match self.snapshot(id) {
                // Deleted meanwhile.
                Err(StoreError::NoSnapshot { .. }) => None,
                // One description that is damaged does not hide the others.
                Err(error @ StoreError::Damaged { .. }) => {
                    tracing::warn!(%error, "a snapshot is not listed; the next start describes it anew");
                    None
                }
                other => Some(other),
            })
            .collect()
    }

    /// Removes a snapshot.
    ///
    /// # Errors
    /// [`StoreError::NoSnapshot`]; a failure of the file system.
    pub fn delete_snapshot(&self, id: SnapshotId) -> Result<(), StoreError> {
        self.snapshot(id)?;
        // What is not described is not there, so a crash in between leaves nothing half.
        files::remove(&self.snapshot_note(id))?;
        files::sync_directory(&self.snapshot_directory())?;
        files::remove(&self.snapshot_path(id))
    }

    /// Removes the oldest scheduled snapshots beyond the latest `keep`. Returns how many went.
    ///
    /// # Errors
    /// As [`Store::delete_snapshot`].
    pub fn prune_snapshots(&self, keep: usize) -> Result<usize, StoreError> {
        let scheduled: Vec<SnapshotId> = self
            .list_snapshots(None, usize::MAX)?
            .into_iter()
            .filter(|s| s.origin == SnapshotOrigin::Scheduled)
            .map(|s| s.id)
            .collect();
        let surplus = scheduled.len().saturating_sub(keep);
        for id in &scheduled[..surplus] {
            self.delete_snapshot(*id)?;
        }
        Ok(surplus)
    }
}

/// What lies in a directory; nothing where there is none.
fn list(directory: &Path) -> Result<Vec<PathBuf>, StoreError> {
    match std::fs::read_dir(directory) {
        Ok(entries) => Ok(entries.flatten().map(|e| e.path()).collect()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(StoreError::io(format!("list {}", directory.display()), &error)),
    }
}

/// Removes what an interrupted snapshot or deletion left, and describes snapshots anew whose description is damaged.
pub(super) fn tidy(data: &Path) -> Result<(), StoreError> {
    let directory = data.join("snapshots");
    for path in list(&directory)? {
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        if name.starts_with(".writing-") {
            files::remove(&path)?;
        } else if let Some(id) = name.strip_suffix(".tar.zst") {
            let note = directory.join(format!("{id}.json"));
            if !note.exists() {
                files::remove(&path)?;
            } else if !is_readable(&note) {
                describe_anew(&path, &note)?;
            }
        }
    }
    Ok(())
}

fn is_readable(note: &Path) -> bool {
    std::fs::read(note).is_ok_and(|text| serde_json::from_slice::<Snapshot>(&text).is_ok())
}

/// A file that is damaged, too, is left for a person to look at.
fn describe_anew(file: &Path, note: &Path) -> Result<(), StoreError> {
    match read::describe(file) {
        Ok(snapshot) => {
            tracing::warn!(snapshot = %snapshot.id, "the description of a snapshot was damaged and is written anew");
            write::write_note(note, &snapshot)
        }
        Err(error) => {
            tracing::warn!(%error, file = %file.display(), "a snapshot and its description are damaged");
            Ok(())
        }
    }
}
