//! Files that are there whole or not at all.

use super::StoreError;
use std::fs::{DirBuilder, File, OpenOptions};
use std::io::Write;
use std::path::Path;

/// Makes a directory of the data directory, with those above it, for its owner only.
pub(super) fn create_directory(path: &Path) -> std::io::Result<()> {
    let mut builder = DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(path)
}

/// How files of the data directory are opened: what is made is for its owner only.
pub(super) fn options() -> OpenOptions {
    #[cfg_attr(not(unix), allow(unused_mut))]
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// Waits until a directory's entries are on the disk.
pub(super) fn sync_directory(path: &Path) -> Result<(), StoreError> {
    File::open(path)
        .and_then(|directory| directory.sync_all())
        .map_err(|e| StoreError::io(format!("sync the directory {}", path.display()), &e))
}

/// Writes a file under a temporary name, syncs it, renames it and syncs its directory.
pub(super) fn write_durably(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    write(path, bytes, true)
}

/// Like [`write_durably`] without waiting for the disk: after a crash the file may be missing or cut, so only for
/// what is checksummed and can be made again.
pub(super) fn write_lazily(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    write(path, bytes, false)
}

fn write(path: &Path, bytes: &[u8], durable: bool) -> Result<(), StoreError> {
    let fail = |e: std::io::Error| StoreError::io(format!("write {}", path.display()), &e);
    let directory = path.parent().unwrap_or(Path::new("."));
    if !directory.exists() {
        create_directory(directory).map_err(fail)?;
        if durable && let Some(parent) = directory.parent() {
            sync_directory(parent)?;
        }
    }
    // Dropping the temporary file removes it, so a failure leaves nothing behind.
    let mut file = tempfile::Builder::new()
        .prefix(".writing-")
        .tempfile_in(directory)
        .map_err(fail)?;
    file.write_all(bytes).map_err(fail)?;
    if durable {
        file.as_file().sync_all().map_err(fail)?;
    }
    file.persist(path).map_err(|e| fail(e.error))?;
    if durable {
        sync_directory(directory)?;
    }
    Ok(())
}

/// Removes a file that may be gone already.
pub(super) fn remove(path: &Path) -> Result<(), StoreError> {
    match std::fs::remove_file(path) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(StoreError::io(format!("remove {}", path.display()), &error)),
    }
}

/// The files of a two-level directory (`ab/abcd…`), with their names.
pub(super) fn walk(
    root: &Path,
    mut each: impl FnMut(&Path, &str) -> Result<(), StoreError>,
) -> Result<(), StoreError> {
    let list = |path: &Path| match std::fs::read_dir(path) {
        Ok(entries) => Ok(entries.flatten().map(|e| e.path()).collect()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(StoreError::io(format!("list {}", path.display()), &error)),
    };
    let directories: Vec<_> = list(root)?;
    for directory in directories.iter().filter(|d| d.is_dir()) {
        let files: Vec<_> = list(directory)?;
        for file in files {
            if let Some(name) = file.file_name().and_then(|n| n.to_str()) {
                each(&file, name)?;
            }
        }
    }
    Ok(())
}
