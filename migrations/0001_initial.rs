//! 0001: the first format. Marks the records as begun, with no event applied yet.
//!
//! A migration may be killed at any point and is then run again from its beginning, so it must come out the same
//! however much of it was done before.

use super::{Backend, Batch, StoreError, keys, payload::Number, seal};

/// Brings records of format 0 (nothing) to format 1.
pub fn up(backend: &dyn Backend) -> Result<(), StoreError> {
    if backend.get(keys::META_SEQUENCE)?.is_none() {
        let mut batch = Batch::default();
        batch.put(
            keys::META_SEQUENCE.to_vec(),
            seal(keys::META_SEQUENCE, &Number(0))?,
        );
        backend.apply(&batch)?;
    }
    Ok(())
}
