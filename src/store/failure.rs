//! What keeps a store from taking writes, and the space it has to go on reading.
//!
//! A reserve file holds a few megabytes of the disk. It is given up when the disk turns out to be full, since the engine
//! may have to write in order to read: it finishes the splits of its pages, and closes and opens in good order, only if
//! there is space. Taking the reserve again is how a store finds out that there is space.

use super::{StoreError, files};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

const RESERVE: &str = "reserve";
/// More than the engine and the log take at once.
const RESERVE_BYTES: usize = 4 << 20;
/// What has to be free beside the reserve: without it, giving the reserve up would look like space to take it again.
const MARGIN_BYTES: u64 = 2 << 20;

/// The first failure of a write, or of a read that met a full disk. Shared by the store and its engine.
pub(super) struct Failure {
    reserve: PathBuf,
    first: Mutex<Option<StoreError>>,
    /// Held while the reserve is being taken, which fills the disk for a moment, and by reads that need the space.
    space: Mutex<()>,
    /// The number of the last change of the catalogue that was acknowledged.
    acknowledged: AtomicU64,
}

impl Failure {
    /// None yet, of a store in this data directory.
    pub fn none(data: &Path) -> Self {
        Self {
            reserve: data.join(RESERVE),
            first: Mutex::new(None),
            space: Mutex::new(()),
            acknowledged: AtomicU64::new(0),
        }
    }

    /// The number of the last change of the catalogue that was acknowledged.
    pub fn acknowledged(&self) -> u64 {
        self.acknowledged.load(Ordering::Acquire)
    }

    /// A change of the catalogue is in the log and in the records.
    pub fn acknowledge(&self, sequence: u64) {
        self.acknowledged.store(sequence, Ordering::Release);
    }

    fn lock(&self) -> MutexGuard<'_, Option<StoreError>> {
        // Assigned whole, never half.
        self.first.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The failure, if there was one.
    pub fn get(&self) -> Option<StoreError> {
        self.lock().clone()
    }

    /// # Errors
    /// The failure, as the answer to a write.
    pub fn writable(&self) -> Result<(), StoreError> {
        match self.get() {
            None => Ok(()),
            Some(known @ (StoreError::Full { .. } | StoreError::RecoveryMode { .. })) => Err(known),
            Some(other) => Err(StoreError::ReadOnly {
                why: other.to_string(),
            }),
        }
    }

    /// Remembers a failure, where it is the first, and gives it back; from now on all writes are refused. A full disk
    /// costs the reserve.
    pub fn remember(&self, error: StoreError) -> StoreError {
        if matches!(error, StoreError::Full { .. }) {
            self.give_up_reserve();
        }
        let mut first = self.lock();
        if first.is_none() {
            tracing::error!(%error, "the store is read-only now");
            *first = Some(error.clone());
        }
        error
    }

    /// Puts another failure in the place of whatever was there.
    pub fn replace(&self, error: Option<StoreError>) {
        *self.lock() = error;
    }

    /// Keeps the reserve from being taken until the guard is dropped.
    pub fn hold_space(&self) -> MutexGuard<'_, ()> {
        self.space.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the reserve, where it is not there already.
    ///
    /// # Errors
    /// [`StoreError::Full`] where there is no space for it and a margin; a failure of the file system.
    pub fn take_reserve(&self) -> Result<(), StoreError> {
        let _space = self.hold_space();
        if self.has_reserve() {
            return Ok(());
        }
        require_space(self.directory(), "take the reserve of disk space")?;
        // Not zeros, which a file system may keep without taking space.
        files::write_durably(&self.reserve, &vec![0x5a; RESERVE_BYTES])
    }

    fn directory(&self) -> &Path {
        self.reserve.parent().unwrap_or(Path::new("."))
    }

    /// Bytes the file system of the data directory has free for this process; `None` where the system does not say.
    pub fn disk_free(&self) -> Option<u64> {
        free_bytes(self.directory())
    }

    /// Whether the disk has so little space that the engine's failure to open may come from that.
    pub fn is_disk_full(&self) -> bool {
        self.disk_free().is_some_and(|free| free < MARGIN_BYTES)
    }

    /// Whether the reserve is there whole.
    pub fn has_reserve(&self) -> bool {
        std::fs::metadata(&self.reserve).is_ok_and(|file| file.len() == RESERVE_BYTES as u64)
    }

    /// Gives the reserve up.
    pub fn give_up_reserve(&self) {
        if let Err(error) = files::remove(&self.reserve) {
            tracing::error!(%error, "the reserve of disk space was not given up");
        }
    }
}

/// Refuses where a directory's file system has no space for the reserve and a margin.
pub(super) fn require_space(directory: &Path, what: &str) -> Result<(), StoreError> {
    let needed = RESERVE_BYTES as u64 + MARGIN_BYTES;
    match free_bytes(directory) {
        Some(free) if free < needed => Err(StoreError::Full {
            detail: format!("{what}: {} KiB are free, {} are needed", free >> 10, needed >> 10),
        }),
        _ => Ok(()),
    }
}

/// What the file system of a directory has free for this process. A quota may leave less.
#[cfg(target_os = "linux")]
fn free_bytes(directory: &Path) -> Option<u64> {
    let system = rustix::fs::statvfs(directory).ok()?;
    Some(system.f_bavail.saturating_mul(system.f_frsize))
}

/// Not asked elsewhere; writing the reserve tells.
#[cfg(not(target_os = "linux"))]
fn free_bytes(_: &Path) -> Option<u64> {
    None
}
