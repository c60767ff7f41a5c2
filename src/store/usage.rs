//! What was made with which API key, for quotas.
//!
//! A record per class and shape, under the key that made it. It is written in the same batch as the class or shape it is
//! about, and removed when a count finds that gone. The catalogue log names the key too, so a change that is replayed
//! counts as well.

use super::entry::{get, put};
use super::payload::{Number, OwnerLink};
use super::quota::Quota;
use super::{Batch, Store, StoreError, Writer, keys, record};
use crate::model::{ClassId, KeyId, KeyLimits, Shape, ShapeId};

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

/// The API key something is made with, and how much may be made with it in all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Maker {
    /// The key.
    pub key: KeyId,
    /// Its limits; what is `None` has none.
    pub limits: KeyLimits,
}

/// Notes that a class was made with a key.
pub(super) fn note_class(batch: &mut Batch, key: Option<KeyId>, class: ClassId) -> Result<(), StoreError> {
    match key {
        Some(key) => put(batch, keys::used_class(key, class), &Number(0)),
        None => Ok(()),
    }
}

/// Notes that a shape was made with a key.
pub(super) fn note_shape(batch: &mut Batch, key: Option<KeyId>, shape: &Shape) -> Result<(), StoreError> {
    match key {
        Some(key) => put(batch, keys::used_shape(key, shape.id), &Number(shape.bytes)),
        None => Ok(()),
    }
}

impl Store {
    /// Whether `classes` more classes and `shapes` may be made with a key. The writer's lock is held from here to the
    /// change, so no other change comes in between.
    ///
    /// # Errors
    /// [`StoreError::QuotaExceeded`]; what keeps the records from being read.
    pub(super) fn require_quota(
        &self,
        _: &Writer,
        maker: Option<&Maker>,
        classes: u64,
        shapes: &[Shape],
    ) -> Result<(), StoreError> {
        let Some(maker) = maker else { return Ok(()) };
        let most = maker.limits;
        if most.classes.is_none() && most.stored_bytes.is_none() {
            return Ok(());
        }
        let used = self.usage(maker.key)?;
        let bytes = shapes.iter().map(|shape| shape.bytes).sum();
        let checks = [
            (Quota::Classes, most.classes, used.classes, classes),
            (Quota::StoredBytes, most.stored_bytes, used.bytes, bytes),
        ];
        for (quota, limit, used, more) in checks {
            if let Some(limit) = limit
                && more > 0
                && used.saturating_add(more) > limit
            {
                return Err(StoreError::QuotaExceeded {
                    quota,
                    limit,
                    used,
                    more,
                });
            }
        }
        Ok(())
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
