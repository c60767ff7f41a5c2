//! Names in the data directory, and looks at what is there.

use std::path::Path;

/// The catalogue log.
pub(super) const LOG: &str = "catalogue.log";
/// The records.
pub(super) const RECORDS: &str = "sled";
/// Records that were rebuilt and are not in their place yet.
pub(super) const REBUILT: &str = "sled.rebuilt";
/// The directory of all uploaded files.
pub(super) const ORIGINALS: &str = "originals";

/// Whether there are records, whole or not.
pub(super) fn has_records(data: &Path) -> bool {
    [RECORDS, REBUILT].iter().any(|name| data.join(name).exists())
}

/// Whether there are uploaded files.
pub(super) fn has_originals(data: &Path) -> bool {
    std::fs::read_dir(data.join(ORIGINALS)).is_ok_and(|mut d| d.next().is_some())
}

/// Whether a file is missing or has no contents.
pub(super) fn is_empty(file: &Path) -> bool {
    std::fs::metadata(file).map_or(true, |file| file.len() == 0)
}
