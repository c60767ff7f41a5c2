//! The durable store: classes, training shapes with their files, generations of the index, jobs.
//!
//! Small records live in an embedded key-value store behind the narrow [`Backend`] trait; uploaded files lie beside
//! it under the name of their contents; and every change of the catalogue is also a line of an append-only log, from
//! which the records can be rebuilt. `docs/storage.md` describes the data directory key by key.
//!
//! **What is acknowledged is durable**: a method that changes something returns after the disk has confirmed it.
//! After a failed write the store is read-only ([`Store::health`] says why), since nobody knows what a disk holds after
//! a write it refused. Where the disk was only full, [`Store::recover`] makes it writable again once there is space;
//! after any other failure it has to be opened again.

mod api_keys;
pub mod backend;
mod baselines;
mod catalogue;
mod catalogue_log;
mod damage;
mod dataset;
mod dictionaries;
mod entry;
pub mod error;
mod event;
mod failure;
mod files;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzzing;
mod garbage;
mod generations;
mod idempotency;
mod jobs;
mod keys;
mod layout;
pub mod memory_backend;
mod migrate;
mod open;
mod ordered_map;
mod originals;
pub mod page;
mod payload;
mod payload_jobs;
mod private;
mod quota;
mod rebuild;
pub mod record;
mod records;
mod recover;
mod replay;
mod scrub;
mod signatures;
mod sled_backend;
pub mod snapshot;
mod standby;
mod usage;

pub use api_keys::MAX_KEYS;
pub use backend::Backend;
pub use catalogue::AddedShape;
pub use damage::Damage;
pub use dataset::{ClassShapes, FilledClass};
pub use dictionaries::{Dictionaries, PREPARED_BYTES};
pub use error::{OriginalDamage, StoreError};
pub use garbage::Garbage;
pub use idempotency::Remembered;
pub use memory_backend::MemoryBackend;
pub use migrate::FORMAT;
pub use originals::CheckedFile;
pub use quota::Quota;
pub use scrub::ScrubReport;
pub use usage::{Maker, Usage};

use backend::Batch;
use catalogue_log::CatalogueLog;
use event::Event;
use failure::Failure;
use payload::Number;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

/// How a store is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoreOptions {
    /// Page cache of the key-value store, in bytes.
    pub cache_bytes: u64,
}

impl Default for StoreOptions {
    /// 64 MiB.
    fn default() -> Self {
        Self {
            cache_bytes: 64 << 20,
        }
    }
}

/// Whether the store takes writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Health {
    /// It does.
    Ready,
    /// A write failed, so it no longer does.
    ReadOnly {
        /// The failure.
        why: String,
    },
}

/// What the store holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Classes.
    pub classes: u64,
    /// Training shapes.
    pub shapes: u64,
    /// Bytes of the shapes' files; a file several shapes came from counts for each.
    pub bytes: u64,
}

/// The durable store. Cheap to clone; every clone is the same store. All methods block on the disk: an asynchronous
/// caller uses `spawn_blocking`.
#[derive(Clone)]
pub struct Store {
    inner: Arc<Inner>,
}

struct Inner {
    path: PathBuf,
    backend: Arc<dyn Backend>,
    /// Held while the catalogue is read, changed and written.
    writer: Mutex<Writer>,
    /// Held shared while stored files are written and not yet referred to, exclusively while unreferenced ones are
    /// removed.
    files: RwLock<()>,
    /// Counts the snapshots being written, and remembers the files whose removal waits for them.
    pinned: Mutex<snapshot::Pinned>,
    /// Held by whoever makes or restores a snapshot: one at a time.
    snapshots: Mutex<()>,
    /// What was found damaged and is not healed yet.
    damage: Mutex<Damage>,
    last_scrub: Mutex<Option<ScrubReport>>,
    failure: Arc<Failure>,
    recovery: Vec<String>,
    /// Released when the last clone is dropped. `None` where nothing may be written.
    _lock: Option<File>,
}

struct Writer {
    log: CatalogueLog,
    /// The number of the last event.
    sequence: u64,
}

impl Inner {
    fn writer(&self) -> MutexGuard<'_, Writer> {
        // A writer that panicked left at most an event in the log that was never acknowledged.
        self.writer.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn writable(&self) -> Result<(), StoreError> {
        self.failure.writable()
    }

    /// Remembers that a write failed; from now on all are refused.
    fn fail(&self, error: StoreError) -> StoreError {
        self.failure.remember(error)
    }

    /// Applies a batch and waits until it is on the disk.
    fn commit(&self, batch: &Batch) -> Result<(), StoreError> {
        self.commit_lazily(batch)?;
        self.backend.flush().map_err(|e| self.fail(e))?;
        // A read that met a full disk in between has opened the engine anew, maybe without the batch.
        self.writable()
    }

    /// Applies a batch; a crash before the next flush may lose it.
    fn commit_lazily(&self, batch: &Batch) -> Result<(), StoreError> {
        self.writable()?;
        self.backend.apply(batch).map_err(|e| self.fail(e))
    }

    /// Makes an event happen: into the log first, then into the records, with more writes of the caller's in the same
    /// batch.
    fn record(&self, writer: &mut Writer, event: &Event, more: Batch) -> Result<(), StoreError> {
        self.writable()?;
        let sequence = writer.sequence + 1;
        // Staged before the log knows of it: a record that cannot be read must not leave an event behind.
        let mut batch = event::stage(&*self.backend, event)?;
        batch.writes.extend(more.writes);
        entry::put(&mut batch, keys::META_SEQUENCE.to_vec(), &Number(sequence))?;
        let length = writer.log.length();
        if let Err(append) = writer.log.append(sequence, event) {
            return Err(if append.in_doubt {
                self.fail(append.error)
            } else {
                append.error
            });
        }
        if let Err(error) = self.commit(&batch) {
            // A full disk refuses and forgets. Where the records took the change after all, they are believed.
            if matches!(error, StoreError::Full { .. }) && !writer.log.take_back(length) {
                tracing::warn!(
                    "the catalogue log keeps a change that was refused; it happens at the next start"
                );
            }
            return Err(error);
        }
        writer.sequence = sequence;
        self.failure.acknowledge(sequence);
        Ok(())
    }
}

impl Store {
    /// Lets go of what the engine keeps in memory of its records; it is opened anew, and requests wait for that.
    ///
    /// # Errors
    /// [`StoreError::Io`] where it cannot be opened again.
    pub fn drop_cache(&self) -> Result<(), StoreError> {
        // No write is under way while the writer is held.
        let _writer = self.inner.writer();
        self.inner.backend.reopen(&mut || Ok(()))
    }

    /// The data directory.
    pub fn path(&self) -> &Path {
        &self.inner.path
    }

    /// Whether the store takes writes; readiness asks.
    pub fn health(&self) -> Health {
        match self.inner.failure.get() {
            None => Health::Ready,
            Some(why) => Health::ReadOnly { why: why.to_string() },
        }
    }

    /// Takes no writes from now on, so that what is there can be looked at and nothing happens to it.
    pub fn enter_recovery_mode(&self, why: String) {
        tracing::error!(
            why,
            "recovery mode: the catalogue is served, and nothing is changed"
        );
        self.inner.failure.replace(Some(StoreError::RecoveryMode { why }));
    }

    /// Why the store is in recovery mode; `None` where it is not.
    pub fn recovery_mode(&self) -> Option<String> {
        match self.inner.failure.get() {
            Some(StoreError::RecoveryMode { why }) => Some(why),
            _ => None,
        }
    }

    /// Whether the store is read-only because the disk is full, which [`Store::recover`] looks after.
    pub fn waits_for_space(&self) -> bool {
        matches!(self.inner.failure.get(), Some(StoreError::Full { .. }))
    }

    /// Bytes the file system of the data directory has free; `None` where the system does not say.
    pub fn disk_free(&self) -> Option<u64> {
        self.inner.failure.disk_free()
    }

    /// What had to be recovered when the store was opened, a sentence each; empty where nothing had to be.
    pub fn recovery(&self) -> &[String] {
        &self.inner.recovery
    }

    /// Waits until everything written so far is on the disk. Methods that change the catalogue have done so already.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the flush's failure.
    pub fn flush(&self) -> Result<(), StoreError> {
        self.inner.commit(&Batch::default())
    }
}
