//! A dataset in an archive: which class each of its files belongs to.
//!
//! The top folders are the classes. Where all files lie in one top folder and none directly in it, that is the folder the
//! dataset was packed in, and the folders in it are the classes.

use super::problem::{Code, Problem};
use crate::model::ClassName;

/// A file of a dataset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Placed {
    /// The folder that names its class.
    pub(super) folder: String,
    /// Its path below that.
    pub(super) name: String,
}

/// The place of each file by its path in the archive; `None` for one that came out of no archive.
///
/// # Errors
/// `file_without_class` for each file that lies in no folder.
pub(super) fn places(paths: &[Option<&str>]) -> Vec<Result<Placed, Problem>> {
    let root = root_of(paths);
    paths
        .iter()
        .map(|path| {
            let below = path.and_then(|path| path.strip_prefix(&root));
            let (folder, name) = below
                .and_then(|below| below.split_once('/'))
                .ok_or_else(without_class)?;
            Ok(Placed {
                folder: folder.to_owned(),
                name: name.to_owned(),
            })
        })
        .collect()
}

/// The folder the dataset was packed in, with its slash; empty where there is none.
fn root_of(paths: &[Option<&str>]) -> String {
    let first = paths.iter().flatten().find_map(|path| path.split_once('/'));
    let Some((root, _)) = first else {
        return String::new();
    };
    let root = format!("{root}/");
    let is_inside = |path: &Option<&str>| {
        path.and_then(|path| path.strip_prefix(&root))
            .is_some_and(|below| below.contains('/'))
    };
    match paths.iter().all(is_inside) {
        true => root,
        false => String::new(),
    }
}

fn without_class() -> Problem {
    Problem::new(
        Code::FileWithoutClass,
        "the file lies in no folder; in an archive of a dataset each file lies in a folder that names its class",
    )
}

/// The class that a folder names: one that exists and is called exactly so, or a name that a new class may have.
///
/// # Errors
/// `invalid_name`, with the folder.
pub(super) fn class_name(
    folder: &str,
    exists: impl FnOnce(&ClassName) -> Result<bool, Problem>,
) -> Result<ClassName, Problem> {
    // An earlier version may have stored a name that no new class gets.
    if let Ok(stored) = ClassName::stored(folder)
        && exists(&stored)?
    {
        return Ok(stored);
    }
    ClassName::new(folder).map_err(|error| Problem::from(error).with("folder", folder))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(paths: &[&str]) -> Vec<Option<(String, String)>> {
        let paths: Vec<Option<&str>> = paths.iter().map(|path| Some(*path)).collect();
        let found = places(&paths).into_iter();
        found
            .map(|place| place.ok().map(|p| (p.folder, p.name)))
            .collect()
    }

    fn at(folder: &str, name: &str) -> Option<(String, String)> {
        Some((folder.to_owned(), name.to_owned()))
    }

    #[test]
    fn top_folders_are_classes_and_a_folder_around_all_of_them_is_none() {
        let expected = [at("cat", "a.off"), at("dog", "young/b.off")];
        assert_eq!(placed(&["cat/a.off", "dog/young/b.off"]), expected);
        assert_eq!(placed(&["set/cat/a.off", "set/dog/young/b.off"]), expected);
        // One class, with a file in its folder.
        assert_eq!(
            placed(&["cat/a.off", "cat/young/b.off"]),
            [at("cat", "a.off"), at("cat", "young/b.off")]
        );
        // One class in the folder of the dataset.
        assert_eq!(placed(&["set/cat/a.off"]), [at("cat", "a.off")]);
    }

    #[test]
    fn files_outside_folders_have_no_class() {
        assert_eq!(placed(&["cat/a.off", "b.off"]), [at("cat", "a.off"), None]);
        assert_eq!(
            placed(&["set/cat/a.off", "set/b.off"]),
            [at("set", "cat/a.off"), at("set", "b.off")]
        );
        assert!(places(&[None])[0].is_err());
    }
}
