//! What tests of several packages share: where the repository's files are.

use std::path::{Path, PathBuf};

/// A file or folder of the repository, by its path from the repository's root.
pub fn repository(path: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("crates/ lies in the repository");
    root.join(path)
}

/// A handed or generated input below `tests/data`.
pub fn data(path: &str) -> PathBuf {
    repository("tests/data").join(path)
}
