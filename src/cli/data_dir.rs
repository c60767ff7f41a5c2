//! Whether a data directory is there, before anything is opened or made.
//!
//! Opening makes a directory that does not exist, which is right for `serve`, `index` and `import` and wrong for a
//! mistyped name. So commands that only read ask first, and the others say what they made.

use super::CliError;
use super::output::note_line;
use crate::config::DEFAULT_DATA;
use crate::store::{Store, StoreError};
use std::path::{Path, PathBuf};

/// Files of which a data directory that was used has at least one.
const MARKS: [&str; 4] = ["format", "catalogue.log", "sled", "sled.rebuilt"];
/// A name this much like the one given is meant, 0 to 1 (Jaro and Winkler).
const ALIKE: f64 = 0.85;

/// Whether the place is a data directory that was used.
pub fn exists(path: &Path) -> bool {
    MARKS.iter().any(|mark| path.join(mark).exists())
}

/// The data directory a command works in.
pub fn chosen(data: Option<&Path>) -> PathBuf {
    data.map_or_else(|| PathBuf::from(DEFAULT_DATA), Path::to_owned)
}

/// Demands a data directory that was used.
///
/// # Errors
/// [`CliError::Usage`] with the nearest name there is.
pub fn require(path: &Path) -> Result<(), CliError> {
    if exists(path) {
        return Ok(());
    }
    let what = if path.is_dir() {
        "this folder is no data directory of shapelex"
    } else if path.exists() {
        "this is a file, not a data directory"
    } else {
        "there is no such data directory"
    };
    let next = match nearest(path) {
        Some(near) => format!("did you mean {}?", near.display()),
        None => "`shapelex index DIR` makes one".to_owned(),
    };
    Err(CliError::Usage(format!(
        "{}: {what}; {next} (--data DIR names another, --server URL a running service)",
        path.display()
    )))
}

/// Demands a place where a data directory is or can be made.
///
/// # Errors
/// [`CliError::Usage`] where a file is in the way.
pub fn require_place(path: &Path) -> Result<(), CliError> {
    if path.exists() && !path.is_dir() {
        return Err(CliError::Usage(format!(
            "{}: this is a file, not a data directory",
            path.display()
        )));
    }
    Ok(())
}

/// Says on stderr that a data directory was made.
pub fn say_made(path: &Path) {
    note_line!("shapelex: {}", made(path));
}

/// The same as a sentence.
pub fn made(path: &Path) -> String {
    format!("made a new data directory: {}", path.display())
}

/// Says on stderr what was repaired as a data directory was opened.
pub fn say_repaired(store: &Store) {
    for line in store.recovery() {
        note_line!("shapelex: the data directory was repaired: {line}");
    }
}

/// Why a data directory could not be opened, with the way to a service that runs on it.
pub fn open_error(error: &StoreError) -> CliError {
    match error {
        StoreError::Locked { path } => CliError::Failed(format!(
            "another process uses the data directory {}; where that is a service, use --server URL instead of --data, \
             or stop it",
            path.display()
        )),
        other => CliError::Failed(other.to_string()),
    }
}

/// The data directory beside the place whose name is most like its own.
fn nearest(path: &Path) -> Option<PathBuf> {
    near_name(path, exists)
}

/// What lies beside a place and has a name like its own, of those that `fits`.
pub fn near_name(path: &Path, fits: impl Fn(&Path) -> bool) -> Option<PathBuf> {
    let wanted = path.file_name()?.to_string_lossy().into_owned();
    let folder = match path.parent() {
        Some(parent) if parent != Path::new("") => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    let likeness = |other: &Path| {
        let name = other
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        strsim::jaro_winkler(&wanted, &name)
    };
    std::fs::read_dir(&folder)
        .ok()?
        .flatten()
        .map(|entry| entry.path())
        .filter(|other| other.file_name() != path.file_name() && fits(other))
        .map(|other| (likeness(&other), other))
        .filter(|(likeness, _)| *likeness >= ALIKE)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, near)| path.with_file_name(near.file_name().unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_directory_is_answered_with_the_nearest_and_not_made() {
        let dir = tempfile::tempdir().unwrap();
        let used = dir.path().join("shapelex-data");
        std::fs::create_dir(&used).unwrap();
        std::fs::write(used.join("format"), "").unwrap();
        std::fs::create_dir(dir.path().join("shapelex-date")).unwrap();
        assert!(require(&used).is_ok());
        let typo = dir.path().join("shapelex-dta");
        let said = require(&typo).unwrap_err().to_string();
        assert!(
            said.contains(&format!("did you mean {}?", used.display())),
            "{said}"
        );
        assert!(said.contains("--server"), "{said}");
        assert!(!typo.exists());
        let far = require(&dir.path().join("elsewhere")).unwrap_err().to_string();
        assert!(!far.contains("did you mean"), "{far}");
        let empty = require(&dir.path().join("shapelex-date"))
            .unwrap_err()
            .to_string();
        assert!(empty.contains("no data directory of shapelex"), "{empty}");
    }
}
