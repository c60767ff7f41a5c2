//! Gives memory back that loading an index leaves behind.

use crate::model::Generation;
use crate::store::{Store, StoreError};

/// Dictionaries of more bytes than this are worth it.
const WORTHWHILE: u64 = 32 << 20;

/// After a large index was loaded: drops what the store's engine cached of its records, and returns freed memory to the
/// system. The engine counts a large record as its place on the disk, so its cache holds each one that was read, whatever
/// its limit.
pub(super) fn after_loading(store: &Store, generation: &Generation) -> Result<(), StoreError> {
    let bytes: u64 = generation.classes.iter().map(|class| class.bytes).sum();
    if bytes > WORTHWHILE {
        store.drop_cache()?;
        trim();
    }
    Ok(())
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn trim() {
    // SAFETY: malloc_trim may be called at any time, from any thread; it touches free memory only.
    unsafe { libc::malloc_trim(0) };
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn trim() {}
