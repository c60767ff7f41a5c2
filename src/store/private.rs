//! The data directory is its owner's alone: 0700 for directories, 0600 for files, whatever the umask is and whatever an
//! earlier version or an operator left.

use super::StoreError;
use std::path::Path;

/// Closes the data directory to others. Where it was open, everything in it is closed too, which the log says; else only
/// what other libraries may have made since: the key-value store's files, and those at the top.
///
/// What belongs to another user cannot be changed and is named in the log: a directory of a container's volume may belong
/// to the system's administrator and still be writable.
#[cfg(unix)]
pub(super) fn close_to_others(data: &Path) -> Result<(), StoreError> {
    use std::os::unix::fs::PermissionsExt;

    let metadata = std::fs::metadata(data)
        .map_err(|e| StoreError::io(format!("open the data directory {}", data.display()), &e))?;
    let was_open = metadata.permissions().mode() & OTHERS != 0;
    let mut closed = 0;
    let mut failed = None;
    close(data, &mut closed, &mut failed);
    let deep = if was_open { usize::MAX } else { 1 };
    walk(data, deep, &mut closed, &mut failed);
    walk(&data.join("sled"), usize::MAX, &mut closed, &mut failed);
    if let Some((path, error)) = failed {
        tracing::warn!(path, %error, "others may read a part of the data directory, and that was not changed");
    }
    if was_open && closed > 0 {
        tracing::warn!(data = %data.display(), closed, "the data directory was open to other users; it is its owner's alone now");
    }
    Ok(())
}

/// Left to the system's access lists.
#[cfg(not(unix))]
pub(super) fn close_to_others(_: &Path) -> Result<(), StoreError> {
    Ok(())
}

/// The bits of the group and of everybody else.
#[cfg(unix)]
const OTHERS: u32 = 0o077;

#[cfg(unix)]
type Failed = Option<(String, std::io::Error)>;

#[cfg(unix)]
fn walk(directory: &Path, depth: usize, closed: &mut usize, failed: &mut Failed) {
    let Ok(entries) = std::fs::read_dir(directory) else {
        return;
    };
    for entry in entries.flatten() {
        // A link leads out of the directory; what it leads to is not ours to change.
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_symlink() {
            continue;
        }
        close(&entry.path(), closed, failed);
        if kind.is_dir() && depth > 1 {
            walk(&entry.path(), depth - 1, closed, failed);
        }
    }
}

#[cfg(unix)]
fn close(path: &Path, closed: &mut usize, failed: &mut Failed) {
    use std::os::unix::fs::PermissionsExt;

    // Gone in between: nothing to close.
    let Ok(metadata) = std::fs::metadata(path) else {
        return;
    };
    let mode = metadata.permissions().mode();
    if mode & OTHERS == 0 {
        return;
    }
    match std::fs::set_permissions(path, PermissionsExt::from_mode(mode & 0o7777 & !OTHERS)) {
        Ok(()) => *closed += 1,
        Err(error) => *failed = Some((path.display().to_string(), error)),
    }
}
