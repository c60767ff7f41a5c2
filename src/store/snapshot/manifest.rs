//! What a snapshot says about itself.

use super::super::StoreError;
use crate::model::{ContentHash, Snapshot, SnapshotId, SnapshotOrigin};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// The arrangement of the archive this build writes, and the newest it reads.
pub(super) const ARRANGEMENT: u32 = 1;
/// Longest manifest that is read: more than half a million files.
pub(super) const MAX_BYTES: u64 = 64 << 20;

pub(super) const MANIFEST: &str = "manifest.json";
pub(super) const CHECKSUM: &str = "manifest.blake3";
pub(super) const RECORDS: &str = "records";

/// A member's length and contents.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Member {
    /// BLAKE3 of its bytes; an uploaded file is named by it.
    pub hash: ContentHash,
    /// Bytes.
    pub bytes: u64,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    /// The arrangement of the archive.
    pub arrangement: u32,
    /// Version of the program that made it.
    pub shapelex: String,
    pub id: SnapshotId,
    pub origin: SnapshotOrigin,
    pub created_at: Timestamp,
    /// Format of the records.
    pub data_format: u32,
    pub classes: u64,
    pub shapes: u64,
    pub generation: Option<u64>,
    pub records: Member,
    /// Ascending by hash.
    pub originals: Vec<Member>,
    /// Uploaded files that were missing or damaged when it was made.
    pub missing: Vec<ContentHash>,
}

#[derive(Deserialize)]
struct Arrangement {
    arrangement: u32,
}

impl Manifest {
    /// Bytes of everything it lists.
    pub fn unpacked_bytes(&self) -> u64 {
        let originals = self.originals.iter().map(|m| m.bytes);
        originals.fold(self.records.bytes, u64::saturating_add)
    }

    /// The description of the file that holds it.
    pub fn describe(self, bytes: u64, hash: ContentHash) -> Snapshot {
        Snapshot {
            id: self.id,
            origin: self.origin,
            created_at: self.created_at,
            data_format: self.data_format,
            bytes,
            hash,
            classes: self.classes,
            shapes: self.shapes,
            originals: self.originals.len() as u64,
            unpacked_bytes: self.unpacked_bytes(),
            generation: self.generation,
            missing: self.missing.len() as u64,
            shapelex: self.shapelex,
        }
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// [`StoreError::BadSnapshot`] where it is none, or one this build does not know.
    pub fn parse(text: &[u8]) -> Result<Self, StoreError> {
        let bad = |e: serde_json::Error| StoreError::bad_snapshot(format!("its manifest: {e}"));
        let Arrangement { arrangement } = serde_json::from_slice(text).map_err(bad)?;
        if arrangement > ARRANGEMENT {
            return Err(StoreError::bad_snapshot(format!(
                "it is arranged as format {arrangement}, this shapelex reads up to {ARRANGEMENT}; use a newer shapelex"
            )));
        }
        let manifest: Self = serde_json::from_slice(text).map_err(bad)?;
        if !manifest.originals.is_sorted_by(|a, b| a.hash < b.hash) {
            return Err(StoreError::bad_snapshot("its manifest lists files out of order"));
        }
        Ok(manifest)
    }
}
