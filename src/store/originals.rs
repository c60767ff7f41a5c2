//! Uploaded files, as they came, under the name of their contents: `originals/ab/abcd….`
//!
//! The name is the BLAKE3 hash of the contents, so every reader can tell whether a file is what was uploaded, and every
//! reader does.

use super::layout::ORIGINALS;
use super::{OriginalDamage, Store, StoreError, files, keys};
use crate::model::ContentHash;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::PoisonError;

/// Bytes read between two looks at whether to go on.
const PIECE: usize = 256 << 10;

/// A stored file whose contents were checked, open at its beginning.
#[derive(Debug)]
pub struct CheckedFile {
    /// The file.
    pub file: File,
    /// Its length in bytes.
    pub length: u64,
}

impl Store {
    /// Where a stored file lies. It may be missing.
    pub fn original_path(&self, content: ContentHash) -> PathBuf {
        let name = content.to_string();
        self.inner.path.join(ORIGINALS).join(&name[..2]).join(name)
    }

    /// A stored file in memory.
    ///
    /// # Errors
    /// [`StoreError::Original`] where it is missing or its contents are not those it is named after;
    /// [`StoreError::Denied`].
    pub fn original(&self, content: ContentHash) -> Result<Vec<u8>, StoreError> {
        let read = std::fs::read(self.original_path(content))
            .map_err(|error| self.unreadable(content, &error))
            .and_then(|bytes| match ContentHash::of(&bytes) == content {
                true => Ok(bytes),
                false => Err(changed(content)),
            });
        self.note_original(content, &read);
        read
    }

    /// Opens a stored file for reading it as a stream, after all of it was read and found to be what was uploaded.
    /// Memory does not grow with the file. Later changes of the directory do not change what is read.
    ///
    /// # Errors
    /// As [`Store::original`].
    pub fn open_original(&self, content: ContentHash) -> Result<CheckedFile, StoreError> {
        let opened = self
            .hash_original(content, &mut |_| ControlFlow::Continue(()))
            .and_then(|(mut file, hash, length)| {
                if hash != content {
                    return Err(changed(content));
                }
                file.rewind().map_err(|error| self.unreadable(content, &error))?;
                Ok(CheckedFile { file, length })
            });
        self.note_original(content, &opened);
        opened
    }

    /// Checks a stored file, telling `pace` how many bytes were read, which may break the check off. A file that is
    /// gone is not damaged where nothing refers to it any more. Returns the bytes read.
    ///
    /// # Errors
    /// As [`Store::original`].
    pub(super) fn check_original(
        &self,
        content: ContentHash,
        pace: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<u64, StoreError> {
        let mut stopped = false;
        let mut watched = |bytes| {
            let go_on = pace(bytes);
            stopped |= go_on.is_break();
            go_on
        };
        let mut found = self.hash_original(content, &mut watched);
        if stopped {
            return Ok(0);
        }
        if matches!(&found, Err(StoreError::Original { .. })) {
            // Files come and go with their references under this gate.
            let _gate = self.inner.files.read().unwrap_or_else(PoisonError::into_inner);
            if !self.is_referenced(content)? {
                self.forget_original(content);
                return Ok(0);
            }
            found = self.hash_original(content, &mut |_| ControlFlow::Continue(()));
        }
        let checked = found.and_then(|(_, hash, length)| match hash == content {
            true => Ok(length),
            false => Err(changed(content)),
        });
        self.note_original(content, &checked);
        checked
    }

    fn hash_original(
        &self,
        content: ContentHash,
        pace: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<(File, ContentHash, u64), StoreError> {
        let fail = |error: std::io::Error| self.unreadable(content, &error);
        let mut file = File::open(self.original_path(content)).map_err(fail)?;
        let (mut hasher, mut length) = (blake3::Hasher::new(), 0);
        let mut piece = vec![0; PIECE];
        loop {
            let read = match file.read(&mut piece) {
                Ok(0) => break,
                Ok(read) => read,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(fail(error)),
            };
            hasher.update(&piece[..read]);
            length += read as u64;
            if pace(read as u64).is_break() {
                break;
            }
        }
        let hash = ContentHash::from_bytes(*hasher.finalize().as_bytes());
        Ok((file, hash, length))
    }

    fn unreadable(&self, content: ContentHash, error: &std::io::Error) -> StoreError {
        let damage = match error.kind() {
            ErrorKind::NotFound => OriginalDamage::Missing,
            ErrorKind::PermissionDenied | ErrorKind::OutOfMemory => {
                return StoreError::io(format!("read {}", self.original_path(content).display()), error);
            }
            // EIO of a bad sector, mostly; too many open files is no damage.
            _ if error.raw_os_error().is_some_and(is_shortage) => {
                return StoreError::io(format!("read {}", self.original_path(content).display()), error);
            }
            _ => OriginalDamage::Unreadable,
        };
        tracing::warn!(%content, %error, "a stored file cannot be read");
        StoreError::Original { content, damage }
    }

    /// Keeps a file. One that is there with the same contents is left alone; one that has changed is written anew.
    pub(super) fn write_original(&self, content: ContentHash, bytes: &[u8]) -> Result<(), StoreError> {
        let path = self.original_path(content);
        let there = std::fs::metadata(&path).is_ok_and(|m| m.len() == bytes.len() as u64)
            && std::fs::read(&path).is_ok_and(|old| old == bytes);
        if !there {
            files::write_durably(&path, bytes)?;
        }
        self.forget_original(content);
        Ok(())
    }

    pub(super) fn remove_original(&self, content: ContentHash) -> Result<(), StoreError> {
        self.forget_original(content);
        files::remove(&self.original_path(content))
    }

    pub(super) fn is_referenced(&self, content: ContentHash) -> Result<bool, StoreError> {
        let found = self.inner.backend.scan(&keys::references_of(content), None, 1)?;
        Ok(!found.is_empty())
    }
}

fn changed(content: ContentHash) -> StoreError {
    StoreError::Original {
        content,
        damage: OriginalDamage::Changed,
    }
}

/// `EMFILE` and `ENFILE`.
fn is_shortage(code: i32) -> bool {
    [23, 24].contains(&code)
}
