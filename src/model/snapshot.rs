//! Snapshots: everything the store holds at one moment, as one file.

use super::{ContentHash, SnapshotId};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// Who asked for a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SnapshotOrigin {
    /// Somebody. It is kept until somebody deletes it.
    Requested,
    /// The schedule. It goes once there are enough newer ones.
    Scheduled,
}

/// A snapshot, without its contents.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Its identifier.
    pub id: SnapshotId,
    /// Who asked for it.
    pub origin: SnapshotOrigin,
    /// The moment it shows.
    pub created_at: Timestamp,
    /// Version of the program that made it.
    pub shapelex: String,
    /// Format of the data in it.
    pub data_format: u32,
    /// Length of the file, in bytes.
    pub bytes: u64,
    /// BLAKE3 of the file.
    pub hash: ContentHash,
    /// Classes in it.
    pub classes: u64,
    /// Training shapes in it.
    pub shapes: u64,
    /// Uploaded files in it.
    pub originals: u64,
    /// Bytes it takes once unpacked.
    pub unpacked_bytes: u64,
    /// The generation of the index in it.
    pub generation: Option<u64>,
    /// Uploaded files that were missing or damaged already when it was made.
    pub missing: u64,
}

/// What restoring a snapshot led to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Restored {
    /// The snapshot, as it names itself.
    pub id: SnapshotId,
    /// The moment it shows.
    pub created_at: Timestamp,
    /// Classes there are now.
    pub classes: u64,
    /// Training shapes there are now.
    pub shapes: u64,
    /// The generation of the index there is now.
    pub generation: Option<u64>,
    /// Uploaded files the snapshot was made without.
    pub missing: u64,
}
