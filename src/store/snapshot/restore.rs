//! Bringing a snapshot back: unpacked and checked beside the state in use, then switched to.

use super::super::backend::{Backend, Batch};
use super::super::entry::{get, put};
use super::super::event::files_of;
use super::super::files;
use super::super::open::settle;
use super::super::payload::Number;
use super::super::{Store, StoreError, StoreOptions, keys};
use super::manifest::Manifest;
use super::read::unpack;
use super::switch::{UNPACKING, declare_ready, go_on, remove};
use crate::model::{Restored, SnapshotId};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{MutexGuard, PoisonError};

/// Records copied per scan.
const CHUNK: usize = 256;

/// A snapshot that is unpacked, checked and ready to take over. Dropped, it leaves nothing.
pub struct Staged<'a> {
    store: &'a Store,
    directory: PathBuf,
    restored: Restored,
    _alone: MutexGuard<'a, ()>,
}

impl Drop for Staged<'_> {
    fn drop(&mut self) {
        if let Err(error) = remove(&self.directory) {
            tracing::warn!(%error, "an unpacked snapshot was not removed; the next start does it");
        }
    }
}

impl Store {
    /// Unpacks and checks a snapshot beside the state in use, which goes on meanwhile.
    ///
    /// # Errors
    /// [`StoreError::BadSnapshot`] where anything is not what its manifest says, or would unpack to more than `limit`
    /// bytes; [`StoreError::SnapshotRunning`]; [`StoreError::Full`]; a failure of the file system.
    pub fn stage_snapshot(&self, archive: impl Read, limit: u64) -> Result<Staged<'_>, StoreError> {
        let alone = self.one_at_a_time()?;
        self.inner.writable()?;
        let directory = self.path().join(UNPACKING);
        remove(&directory)?;
        files::create_directory(&directory)
            .map_err(|e| StoreError::io(format!("make {}", directory.display()), &e))?;
        let mut staged = Staged {
            store: self,
            directory,
            restored: Restored {
                id: SnapshotId::from_bytes([0; 16]),
                created_at: jiff::Timestamp::UNIX_EPOCH,
                classes: 0,
                shapes: 0,
                generation: None,
                missing: 0,
            },
            _alone: alone,
        };
        // Only while it is written: the cache is given back with the engine.
        let options = StoreOptions {
            cache_bytes: 16 << 20,
        };
        let manifest = unpack(archive, &staged.directory, limit, &options)?;
        staged.restored = examine(&staged.directory, &options, &manifest)?;
        Ok(staged)
    }

    /// Unpacks and checks a snapshot that was made here.
    ///
    /// # Errors
    /// [`StoreError::NoSnapshot`], and as [`Store::stage_snapshot`].
    pub fn stage_own_snapshot(&self, id: SnapshotId, limit: u64) -> Result<Staged<'_>, StoreError> {
        self.snapshot(id)?;
        let path = self.snapshot_path(id);
        let file = File::open(&path).map_err(|e| StoreError::io(format!("open {}", path.display()), &e))?;
        self.stage_snapshot(file, limit)
    }
}

impl Staged<'_> {
    /// Takes over: from now on the store holds what the snapshot held. The jobs this store knows stay known. No job
    /// may be waiting or running.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`]; a failure of the file system. Where it happens during the switch, the store is
    /// read-only and the next start completes it; before, nothing has changed.
    pub fn switch(self) -> Result<Restored, StoreError> {
        let inner = &self.store.inner;
        inner.writable()?;
        let _files = inner.files.write().unwrap_or_else(PoisonError::into_inner);
        let mut writer = inner.writer();
        carry_over(self.store, &self.directory)?;
        let data = self.store.path();
        declare_ready(data)?;
        let mut notes = Vec::new();
        let switched = inner
            .backend
            .reopen(&mut || go_on(data))
            .and_then(|()| settle(data, &*inner.backend, &mut notes));
        *writer = switched.map_err(|e| inner.fail(e))?;
        inner.failure.acknowledge(writer.sequence);
        self.store.forget_damage();
        for line in notes {
            tracing::info!(line, "restored");
        }
        Ok(self.restored.clone())
    }
}

/// Opens what was unpacked as a store of its own, which migrates it, checks every record and writes its log; then looks
/// at what the records say of each other.
fn examine(directory: &Path, options: &StoreOptions, manifest: &Manifest) -> Result<Restored, StoreError> {
    let of_snapshot = |error: StoreError| match error {
        full @ StoreError::Full { .. } => full,
        other => StoreError::bad_snapshot(other.to_string()),
    };
    let store = Store::open(directory, options).map_err(of_snapshot)?;
    // A full disk opens read-only, with the log not written yet.
    store.inner.writable()?;
    let wrong = |what: String| Err(StoreError::bad_snapshot(what));
    let known = |hash| manifest.missing.contains(&hash) || store.original_path(hash).exists();
    let (mut classes, mut shapes) = (0, 0);
    for class in store.list_classes(None, usize::MAX).map_err(of_snapshot)? {
        classes += 1;
        let found = store
            .list_shapes(class.id, None, usize::MAX)
            .map_err(of_snapshot)?;
        if found.len() as u64 != class.shapes {
            return wrong(format!(
                "class {} counts {} shapes and has {}",
                class.id,
                class.shapes,
                found.len()
            ));
        }
        shapes += class.shapes;
        for shape in &found {
            if let Some(hash) = files_of(shape).find(|hash| !known(*hash)) {
                return wrong(format!("the file {hash} of shape {} is not in it", shape.id));
            }
        }
    }
    if (classes, shapes) != (manifest.classes, manifest.shapes) {
        return wrong(format!(
            "it holds {classes} classes and {shapes} shapes, not the {} and {} its manifest says",
            manifest.classes, manifest.shapes
        ));
    }
    let generation = store.generation().map_err(of_snapshot)?;
    if let Some(generation) = &generation {
        store.load_index(generation).map_err(of_snapshot)?;
    }
    Ok(Restored {
        id: manifest.id,
        created_at: manifest.created_at,
        classes,
        shapes,
        generation: generation.map(|g| g.number),
        missing: manifest.missing.len() as u64,
    })
}

/// Copies what is this service's own into the unpacked state: its jobs and, where it has any, its API keys in place of
/// those of the snapshot, so that nobody locks himself out and no revoked key works again.
fn carry_over(store: &Store, directory: &Path) -> Result<(), StoreError> {
    let to = Store::open(
        directory,
        &StoreOptions {
            cache_bytes: 16 << 20,
        },
    )?;
    to.inner.writable()?;
    let own = store.api_keys()?;
    if !own.is_empty() {
        for key in to.api_keys()? {
            to.revoke_key(key.id)?;
        }
        for key in own {
            to.create_key(key)?;
        }
    }
    copy_jobs(&*store.inner.backend, &*to.inner.backend)
}

/// Copies the jobs, and sees to it that no number of a generation is used twice.
fn copy_jobs(from: &dyn Backend, to: &dyn Backend) -> Result<(), StoreError> {
    let mut after: Option<Vec<u8>> = None;
    loop {
        let entries = from.scan(keys::JOB, after.as_deref(), CHUNK)?;
        let Some((last, _)) = entries.last() else { break };
        after = Some(last.clone());
        let mut batch = Batch::default();
        for (key, value) in entries {
            batch.put(key, value);
        }
        to.apply(&batch)?;
    }
    let last = |backend: &dyn Backend| get::<Number>(backend, keys::META_LAST_GENERATION);
    if let Some(Number(here)) = last(from)?
        && last(to)?.is_none_or(|Number(there)| there < here)
    {
        let mut batch = Batch::default();
        put(&mut batch, keys::META_LAST_GENERATION.to_vec(), &Number(here))?;
        to.apply(&batch)?;
    }
    to.flush()
}
