//! Uploaded files, as they came, under the name of their contents: `originals/ab/abcd….`

use super::{Store, StoreError, files, keys};
use crate::model::ContentHash;
use std::path::PathBuf;

/// The directory of all stored files, inside the data directory.
pub(super) const DIRECTORY: &str = "originals";

impl Store {
    /// Where a stored file lies, for reading it as a stream. It may be missing.
    pub fn original_path(&self, content: ContentHash) -> PathBuf {
        let name = content.to_string();
        self.inner.path.join(DIRECTORY).join(&name[..2]).join(name)
    }

    /// A stored file.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where it is missing or its contents are not those it is named after.
    pub fn original(&self, content: ContentHash) -> Result<Vec<u8>, StoreError> {
        let what = || format!("original {content}");
        let bytes = std::fs::read(self.original_path(content)).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => StoreError::damaged(what(), "the file is missing"),
            _ => StoreError::io(format!("read {}", what()), &error),
        })?;
        if ContentHash::of(&bytes) != content {
            return Err(StoreError::damaged(what(), "its contents have changed"));
        }
        Ok(bytes)
    }

    /// Keeps a file. One that is there with the same contents is left alone; one that has changed is written anew.
    pub(super) fn write_original(&self, content: ContentHash, bytes: &[u8]) -> Result<(), StoreError> {
        let path = self.original_path(content);
        let there = std::fs::metadata(&path).is_ok_and(|m| m.len() == bytes.len() as u64)
            && std::fs::read(&path).is_ok_and(|old| old == bytes);
        if there {
            return Ok(());
        }
        files::write_durably(&path, bytes)
    }

    pub(super) fn remove_original(&self, content: ContentHash) -> Result<(), StoreError> {
        files::remove(&self.original_path(content))
    }

    pub(super) fn is_referenced(&self, content: ContentHash) -> Result<bool, StoreError> {
        let found = self.inner.backend.scan(&keys::references_of(content), None, 1)?;
        Ok(!found.is_empty())
    }
}
