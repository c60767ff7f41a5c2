//! Paths inside archives.

use super::problem::{Code, Problem};

/// Longest path of a member, in bytes; no file system takes a longer one.
const MAX_PATH: usize = 4096;

/// The path with forward slashes and without `.` parts. Absolute paths, drive letters, `..`, control characters and
/// endless names are refused: no honest archive of meshes has them.
pub fn safe_path(path: &str) -> Result<String, Problem> {
    let unsafe_path = || {
        Problem::new(
            Code::UnsafeArchivePath,
            format!(
                "'{}' is not a path inside the archive",
                path.chars().take(200).collect::<String>().escape_debug()
            ),
        )
    };
    if path.len() > MAX_PATH {
        return Err(unsafe_path());
    }
    let path = path.replace('\\', "/");
    let drive = path.as_bytes().get(1) == Some(&b':') && path.as_bytes()[0].is_ascii_alphabetic();
    if path.starts_with('/') || drive || path.chars().any(char::is_control) {
        return Err(unsafe_path());
    }
    let mut parts = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => return Err(unsafe_path()),
            other => parts.push(other),
        }
    }
    if parts.is_empty() {
        return Err(unsafe_path());
    }
    Ok(parts.join("/"))
}

/// Whether a file is hidden or was added by a system for itself.
pub fn is_clutter(path: &str) -> bool {
    path.split('/')
        .any(|part| part.starts_with('.') || part == "__MACOSX" || part == "Thumbs.db")
}
