//! Numbered migrations, run in order when a store is opened. The number of the last one is the format of the data
//! directory.

use super::backend::{Backend, Batch};
use super::entry::{get, put};
use super::payload::Number;
use super::record::seal;
use super::{StoreError, files, keys, payload};
use std::path::Path;

#[path = "../../migrations/0001_initial.rs"]
mod m0001_initial;

type Migration = fn(&dyn Backend) -> Result<(), StoreError>;

/// All migrations, the first one first.
const MIGRATIONS: [Migration; 1] = [m0001_initial::up];

/// The format of the data directory this build writes, and the newest it reads.
pub const FORMAT: u32 = MIGRATIONS.len() as u32;

/// Runs the migrations the records have not had. Each is durable before it is counted as done.
pub(super) fn run(backend: &dyn Backend) -> Result<(), StoreError> {
    let done: Number = get(backend, keys::META_MIGRATION)?.unwrap_or(Number(0));
    refuse_newer(u32::try_from(done.0).unwrap_or(u32::MAX))?;
    for (number, migration) in (1_u64..).zip(MIGRATIONS) {
        if number <= done.0 {
            continue;
        }
        migration(backend)?;
        backend.flush()?;
        let mut batch = Batch::default();
        put(&mut batch, keys::META_MIGRATION.to_vec(), &Number(number))?;
        backend.apply(&batch)?;
        backend.flush()?;
    }
    Ok(())
}

/// Refuses a format this build does not know.
fn refuse_newer(found: u32) -> Result<(), StoreError> {
    if found > FORMAT {
        return Err(StoreError::NewerFormat {
            found,
            supported: FORMAT,
            hint: "use a newer shapelex, or another data directory",
        });
    }
    Ok(())
}

/// What `DATA/format` says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// The format of this build.
    Current,
    /// An older one.
    Older,
    /// Nothing: the directory is new, or the file was lost or cut off. The records know their own format.
    Unknown,
}

/// Reads `DATA/format`. A file that holds no number, as a power cut may leave it, is as good as none.
pub(super) fn check_format(data: &Path) -> Result<Format, StoreError> {
    let path = data.join("format");
    let text = match std::fs::read(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Format::Unknown),
        Err(error) => return Err(StoreError::io(format!("read {}", path.display()), &error)),
    };
    let Some(found) = std::str::from_utf8(&text)
        .ok()
        .and_then(|t| t.trim().parse().ok())
    else {
        tracing::warn!(
            file = %path.display(),
            "the file holds no format number and is written anew; the records know their format"
        );
        return Ok(Format::Unknown);
    };
    refuse_newer(found)?;
    Ok(if found == FORMAT {
        Format::Current
    } else {
        Format::Older
    })
}

/// Writes `DATA/format`, before any migration of that format changes a record.
pub(super) fn write_format(data: &Path) -> Result<(), StoreError> {
    files::write_durably(&data.join("format"), format!("{FORMAT}\n").as_bytes())
}
