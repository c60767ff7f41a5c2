//! Why the store could not do what it was asked.

use super::quota::Quota;
use crate::model::{ClassId, ClassName, ContentHash, JobId, KeyId, KeyName, ShapeId, SnapshotId};
use std::fmt;
use std::path::PathBuf;

/// The store's errors. Those up to [`StoreError::BadSnapshot`] are the caller's; the others are the machine's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// There is no such class.
    #[error("there is no class {id}")]
    NoClass {
        /// The identifier asked for.
        id: ClassId,
    },
    /// There is no such shape.
    #[error("there is no shape {id}")]
    NoShape {
        /// The identifier asked for.
        id: ShapeId,
    },
    /// There is no such job.
    #[error("there is no job {id}")]
    NoJob {
        /// The identifier asked for.
        id: JobId,
    },
    /// Another class has this name.
    #[error("there is a class named '{name}' already, {id}")]
    NameTaken {
        /// The name.
        name: ClassName,
        /// The class that has it.
        id: ClassId,
    },
    /// There is no such API key.
    #[error("there is no API key {id}")]
    NoKey {
        /// The identifier asked for.
        id: KeyId,
    },
    /// Another API key has this name.
    #[error("there is an API key named '{name}' already, {id}")]
    KeyNameTaken {
        /// The name.
        name: KeyName,
        /// The key that has it.
        id: KeyId,
    },
    /// There are as many API keys as there may be.
    #[error("there are {limit} API keys, as many as may; revoke those nobody uses")]
    TooManyKeys {
        /// The most there may be.
        limit: usize,
    },
    /// There is no such snapshot.
    #[error("there is no snapshot {id}")]
    NoSnapshot {
        /// The identifier asked for.
        id: SnapshotId,
    },
    /// A snapshot is being made or restored, and there is one at a time.
    #[error("another snapshot is being made or restored; try again when it is done")]
    SnapshotRunning,
    /// A file is no snapshot, or not one that can be restored. Nothing was changed.
    #[error("the snapshot cannot be restored: {detail}")]
    BadSnapshot {
        /// What is wrong with it.
        detail: String,
    },
    /// An API key may have no more of something. Nothing was changed.
    #[error("the API key may have {limit} {quota}; it has {used}, and this would add {more}")]
    QuotaExceeded {
        /// What there may be no more of.
        quota: Quota,
        /// The most there may be.
        limit: u64,
        /// What there is.
        used: u64,
        /// What would be added.
        more: u64,
    },
    /// The process has as many files open as it may. Nothing was changed.
    #[error("no more files can be opened at the moment: {what}")]
    OutOfDescriptors {
        /// What was being done.
        what: String,
    },
    /// The disk is full. Nothing was changed.
    #[error("the disk is full: {detail}")]
    Full {
        /// What was being written.
        detail: String,
    },
    /// An earlier write failed, so nothing more is written. Reading goes on.
    #[error("the store is read-only since a write failed: {why}")]
    ReadOnly {
        /// The failure.
        why: String,
    },
    /// The store is only to be looked at. Nothing is written.
    #[error("recovery mode, nothing is changed: {why}")]
    RecoveryMode {
        /// Why it is.
        why: String,
    },
    /// A record or file is not what was written.
    #[error("{what} is damaged: {detail}")]
    Damaged {
        /// Which record or file.
        what: String,
        /// What is wrong with it.
        detail: String,
    },
    /// A shape's uploaded file is gone or no longer what was uploaded.
    #[error("the stored file {content} {damage}; upload the same file again to heal it")]
    Original {
        /// The hash of the contents it had, and its name.
        content: ContentHash,
        /// What is wrong with it.
        damage: OriginalDamage,
    },
    /// The system refuses this process the right to use a file, or the file system is mounted read-only.
    #[error(
        "{what}: {detail}; give the user that runs shapelex the right to read and write it, and mount it writable"
    )]
    Denied {
        /// What was being done, with the path.
        what: String,
        /// The refusal.
        detail: String,
    },
    /// The data directory is of a format this build does not know.
    #[error("data directory has format {found}, this shapelex reads up to {supported}; {hint}")]
    NewerFormat {
        /// The directory's format.
        found: u32,
        /// The newest format this build reads.
        supported: u32,
        /// What to do.
        hint: &'static str,
    },
    /// Another process uses the data directory.
    #[error(
        "another process uses the data directory {path}; stop it, or give this one a directory of its own"
    )]
    Locked {
        /// The directory.
        path: PathBuf,
    },
    /// The file system or the key-value store failed.
    #[error("{what}: {detail}")]
    Io {
        /// What was being done.
        what: String,
        /// The failure.
        detail: String,
    },
}

impl StoreError {
    /// Wraps a file system error, telling a full disk, a missing right and a want of file descriptors apart.
    pub(crate) fn io(what: impl Into<String>, error: &std::io::Error) -> Self {
        let what = what.into();
        if is_out_of_descriptors(error) {
            return Self::OutOfDescriptors { what };
        }
        match error.kind() {
            std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
                Self::Full { detail: what }
            }
            std::io::ErrorKind::PermissionDenied | std::io::ErrorKind::ReadOnlyFilesystem => Self::Denied {
                what,
                detail: error.to_string(),
            },
            _ => Self::Io {
                what,
                detail: error.to_string(),
            },
        }
    }

    pub(crate) fn bad_snapshot(detail: impl Into<String>) -> Self {
        Self::BadSnapshot {
            detail: detail.into(),
        }
    }

    pub(crate) fn damaged(what: impl Into<String>, detail: impl Into<String>) -> Self {
        Self::Damaged {
            what: what.into(),
            detail: detail.into(),
        }
    }
}

/// What is wrong with a stored file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum OriginalDamage {
    /// It is gone.
    Missing,
    /// Its contents are not those that were uploaded.
    Changed,
    /// The disk fails to read it.
    Unreadable,
}

impl fmt::Display for OriginalDamage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing => "is missing",
            Self::Changed => "does not hold what was uploaded",
            Self::Unreadable => "cannot be read",
        })
    }
}

/// Whether the process (`EMFILE`) or the system (`ENFILE`) has as many files open as it may.
pub(crate) fn is_out_of_descriptors(error: &std::io::Error) -> bool {
    const ENFILE: i32 = 23;
    const EMFILE: i32 = 24;
    let told = match error.raw_os_error() {
        Some(code) => [ENFILE, EMFILE].contains(&code),
        // `tempfile` puts the path around the system's error, whose number is in the text only.
        None => {
            let text = error.to_string();
            [ENFILE, EMFILE]
                .iter()
                .any(|code| text.contains(&format!("(os error {code})")))
        }
    };
    cfg!(unix) && told
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_want_of_descriptors_is_told_apart_also_inside_another_error() {
        for code in [23, 24] {
            let bare = std::io::Error::from_raw_os_error(code);
            let wrapped = std::io::Error::other(format!("{bare} at path \"/x\""));
            for error in [bare, wrapped] {
                let told = StoreError::io("write", &error);
                assert!(matches!(told, StoreError::OutOfDescriptors { .. }), "{error}");
            }
        }
        let other = StoreError::io("write", &std::io::Error::from_raw_os_error(2));
        assert!(matches!(other, StoreError::Io { .. }));
    }
}
