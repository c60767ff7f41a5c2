//! What was found damaged: uploaded files that are gone or changed, records that fail their checksum.
//!
//! Kept in memory, so that readiness and metrics can tell. A file leaves the list when it is written again, removed, or
//! found whole.

use super::{OriginalDamage, Store, StoreError};
use crate::model::ContentHash;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{MutexGuard, PoisonError};

/// Files listed at most; more are as bad.
const MAX_LISTED: usize = 10_000;

/// What is damaged, as far as it was looked at.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Uploaded files that are gone, changed or unreadable.
    pub originals: BTreeMap<ContentHash, OriginalDamage>,
    /// Records, and lines of the catalogue log, that fail their checksum.
    pub records: BTreeSet<String>,
}

impl Damage {
    /// Whether nothing is damaged.
    pub fn is_empty(&self) -> bool {
        self.originals.is_empty() && self.records.is_empty()
    }
}

impl Store {
    /// What was found damaged and is not healed yet.
    pub fn damage(&self) -> Damage {
        self.damage_list().clone()
    }

    fn damage_list(&self) -> MutexGuard<'_, Damage> {
        // Changed in single steps, each of which leaves it whole.
        self.inner.damage.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Remembers how a look at a stored file ended.
    pub(super) fn note_original<T>(&self, content: ContentHash, found: &Result<T, StoreError>) {
        let mut list = self.damage_list();
        match found {
            Ok(_) => {
                if list.originals.remove(&content).is_some() {
                    tracing::info!(%content, "a damaged stored file is whole again");
                }
            }
            Err(StoreError::Original { damage, .. }) if list.originals.len() < MAX_LISTED => {
                if list.originals.insert(content, *damage) != Some(*damage) {
                    tracing::error!(%content, %damage, "a stored file is damaged; uploading it again heals it");
                }
            }
            // Not being able to look says nothing about the file.
            Err(_) => {}
        }
    }

    /// A stored file was written again, or is not needed any more.
    pub(super) fn forget_original(&self, content: ContentHash) {
        self.damage_list().originals.remove(&content);
    }

    /// Replaces the damaged records by those a look at all of them found.
    pub(super) fn note_records(&self, found: BTreeSet<String>) {
        self.damage_list().records = found;
    }

    /// Everything was replaced by what was checked, as by a restore.
    pub(super) fn forget_damage(&self) {
        *self.damage_list() = Damage::default();
    }
}
