//! Snapshots on the wire.

use super::time;
use crate::model::{Restored, Snapshot, SnapshotOrigin};
use serde::Serialize;
use utoipa::ToSchema;

/// Who asked for a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SnapshotOriginDto {
    /// Somebody. It is kept until somebody deletes it.
    Requested,
    /// The schedule. It goes once there are enough newer ones.
    Scheduled,
}

/// A snapshot: everything the service held at one moment, as one file.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SnapshotDto {
    /// Never changes.
    pub id: String,
    /// Who asked for it.
    pub origin: SnapshotOriginDto,
    /// The moment it shows; RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// Version of the service that made it.
    pub shapelex: String,
    /// Format of the data in it.
    pub data_format: u32,
    /// The file's length.
    pub bytes: u64,
    /// BLAKE3 of the file, 64 hexadecimal digits.
    pub hash: String,
    /// Bytes it takes once unpacked.
    pub unpacked_bytes: u64,
    /// Classes in it.
    pub classes: u64,
    /// Training shapes in it.
    pub shapes: u64,
    /// Uploaded files in it.
    pub originals: u64,
    /// The generation of the index in it; `null` where there was none.
    pub generation: Option<u64>,
    /// Uploaded files that were missing or damaged already when it was made.
    pub missing: u64,
    /// Where it can be downloaded.
    pub file: String,
}

impl From<Snapshot> for SnapshotDto {
    fn from(snapshot: Snapshot) -> Self {
        Self {
            id: snapshot.id.to_string(),
            origin: match snapshot.origin {
                SnapshotOrigin::Requested => SnapshotOriginDto::Requested,
                SnapshotOrigin::Scheduled => SnapshotOriginDto::Scheduled,
            },
            created_at: time(snapshot.created_at),
            shapelex: snapshot.shapelex,
            data_format: snapshot.data_format,
            bytes: snapshot.bytes,
            hash: snapshot.hash.to_string(),
            unpacked_bytes: snapshot.unpacked_bytes,
            classes: snapshot.classes,
            shapes: snapshot.shapes,
            originals: snapshot.originals,
            generation: snapshot.generation,
            missing: snapshot.missing,
            file: format!("/v1/snapshots/{}/file", snapshot.id),
        }
    }
}

/// What restoring led to. The service holds this, and nothing else, from now on.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct RestoredDto {
    /// The snapshot's own id.
    pub snapshot: String,
    /// The moment it shows; RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// Classes there are now.
    pub classes: u64,
    /// Training shapes there are now.
    pub shapes: u64,
    /// The generation of the index there is now; `null` where there is none.
    pub generation: Option<u64>,
    /// Uploaded files the snapshot was made without; their shapes fail alone in the next reindex.
    pub missing: u64,
}

impl From<Restored> for RestoredDto {
    fn from(restored: Restored) -> Self {
        Self {
            snapshot: restored.id.to_string(),
            created_at: time(restored.created_at),
            classes: restored.classes,
            shapes: restored.shapes,
            generation: restored.generation,
            missing: restored.missing,
        }
    }
}
