//! The switch from the old state to a restored one, by renames, in an order that can be taken up again anywhere.
//!
//! `restore.unpacking` becomes `restore.ready` once everything in it is checked and on the disk. From that rename on
//! the restored state is the one that counts: whoever finds `restore.ready`, moves its parts into place and those they
//! replace to `restore.replaced`, which goes at the end.

use super::super::layout::{LOG, ORIGINALS, RECORDS};
use super::super::{StoreError, files};
use std::path::{Path, PathBuf};

pub(super) const UNPACKING: &str = "restore.unpacking";
const READY: &str = "restore.ready";
const REPLACED: &str = "restore.replaced";

/// What is switched. The cached signatures stay: they are named by what they were computed from.
const PARTS: [&str; 3] = [RECORDS, LOG, ORIGINALS];

/// Makes the checked state the one that counts.
pub(super) fn declare_ready(data: &Path) -> Result<(), StoreError> {
    remove(&data.join(REPLACED))?;
    rename(&data.join(UNPACKING), &data.join(READY))?;
    files::sync_directory(data)
}

/// Goes on with a switch that was declared, from wherever it stopped; removes what one that was not declared left.
/// Nothing of the data directory may be open but its lock.
pub(in super::super) fn finish_restore(data: &Path) -> Result<(), StoreError> {
    remove(&data.join(UNPACKING))?;
    go_on(data)?;
    super::tidy(data)
}

/// The catalogue log of the state that counts, also in the middle of a switch.
pub(in super::super) fn log_in_force(data: &Path) -> PathBuf {
    let restored = data.join(READY).join(LOG);
    if restored.exists() {
        restored
    } else {
        data.join(LOG)
    }
}

/// Goes on with a switch that was declared, and leaves everything else alone.
pub(in super::super) fn go_on(data: &Path) -> Result<(), StoreError> {
    let (ready, replaced) = (data.join(READY), data.join(REPLACED));
    if ready.exists() {
        tracing::info!("switching to the restored state");
        files::create_directory(&replaced)
            .map_err(|e| StoreError::io(format!("make {}", replaced.display()), &e))?;
        for part in PARTS {
            let (new, place) = (ready.join(part), data.join(part));
            if !new.exists() {
                continue;
            }
            if place.exists() {
                rename(&place, &replaced.join(part))?;
            }
            rename(&new, &place)?;
            files::sync_directory(data)?;
        }
        remove(&ready)?;
        files::sync_directory(data)?;
    }
    remove(&replaced)
}

fn rename(from: &Path, to: &Path) -> Result<(), StoreError> {
    std::fs::rename(from, to).map_err(|e| StoreError::io(format!("rename {}", from.display()), &e))
}

pub(super) fn remove(directory: &Path) -> Result<(), StoreError> {
    match std::fs::remove_dir_all(directory) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(StoreError::io(format!("remove {}", directory.display()), &error)),
    }
}
