//! What was made with which API key, for quotas.
//!
//! A record per class and shape, under the key that made it. It is written after the class or shape it is about, and
//! removed when a count finds that gone, so a count is exact except for what a crash cut off in between.

use super::event::{get, put};
use super::payload::{Number, OwnerLink};
use super::{Batch, Store, StoreError, keys, record};
use crate::model::{ClassId, KeyId, Shape, ShapeId};

/// How much of the catalogue was made with an API key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Classes.
    pub classes: u64,
    /// Shapes.
    pub shapes: u64,
    /// Bytes of the shapes' files.
    pub bytes: u64,
}

impl Store {
    /// Remembers that a class and shapes were made with a key.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the write's failure.
    pub fn note_usage(&self, key: KeyId, class: Option<ClassId>, shapes: &[Shape]) -> Result<(), StoreError> {
        let mut batch = Batch::default();
        if let Some(class) = class {
            put(&mut batch, keys::used_class(key, class), &Number(0))?;
        }
        for shape in shapes {
            put(&mut batch, keys::used_shape(key, shape.id), &Number(shape.bytes))?;
        }
        if batch.is_empty() {
            return Ok(());
        }
        self.inner.commit_lazily(&batch)
    }

    /// What was made with a key and is still there.
    ///
    /// # Errors
    /// [`StoreError::Damaged`]; the failure of a write that forgets what is gone.
    pub fn usage(&self, key: KeyId) -> Result<Usage, StoreError> {
        let backend = &*self.inner.backend;
        let (mut usage, mut gone) = (Usage::default(), Batch::default());
        let prefix = keys::used_classes(key);
        for (at, _) in backend.scan(&prefix, None, usize::MAX)? {
            let there = match at[prefix.len()..].try_into().map(ClassId::from_bytes) {
                Ok(id) => backend.get(&keys::class(id))?.is_some(),
                Err(_) => false,
            };
            if there {
                usage.classes += 1;
            } else {
                gone.delete(at);
            }
        }
        let prefix = keys::used_shapes(key);
        for (at, value) in backend.scan(&prefix, None, usize::MAX)? {
            let there = match at[prefix.len()..].try_into().map(ShapeId::from_bytes) {
                Ok(id) => get::<OwnerLink>(backend, &keys::owner(id))?.is_some(),
                Err(_) => false,
            };
            if there {
                let Number(bytes) = record::unseal(&at, &value)?;
                usage.shapes += 1;
                usage.bytes += bytes;
            } else {
                gone.delete(at);
            }
        }
        if !gone.is_empty() && self.inner.writable().is_ok() {
            self.inner.commit_lazily(&gone)?;
        }
        Ok(usage)
    }
}
