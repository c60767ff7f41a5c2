//! One record by its key.

use super::StoreError;
use super::backend::{Backend, Batch};
use super::record::{Record, seal, unseal};

/// The record of a key.
pub(super) fn get<R: Record>(backend: &dyn Backend, key: &[u8]) -> Result<Option<R>, StoreError> {
    backend.get(key)?.map(|bytes| unseal(key, &bytes)).transpose()
}

/// Adds a record to a batch.
pub(super) fn put<R: Record>(batch: &mut Batch, key: Vec<u8>, record: &R) -> Result<(), StoreError> {
    let bytes = seal(&key, record)?;
    batch.put(key, bytes);
    Ok(())
}
