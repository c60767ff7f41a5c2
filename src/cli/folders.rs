//! Folders of mesh files: a folder per class.

use super::CliError;
use super::data_dir::near_name;
use std::path::{Path, PathBuf};
use walkdir::WalkDir;

/// Extensions of the formats we read.
pub const EXTENSIONS: [&str; 6] = ["obj", "gltf", "glb", "ply", "stl", "off"];

/// A file that belongs to a class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelledFile {
    /// The class: the name of the folder in the folder that was named.
    pub class: String,
    /// The file.
    pub path: PathBuf,
    /// Its path below the class's folder, which no other file of the class has.
    pub name: String,
}

/// A mesh file in a folder. Files in its subfolders, at any depth, belong to the class the subfolder is named after.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundFile {
    /// The class, where the file lies in a subfolder.
    pub class: Option<String>,
    /// The file.
    pub path: PathBuf,
    /// Its path below the class's folder.
    pub name: String,
}

/// The mesh files of a folder, ordered by path. Files with other extensions and hidden ones are passed over: folders of
/// meshes hold textures and notes.
///
/// # Errors
/// [`CliError::Usage`] where there is no such folder or no mesh in it; [`CliError::Failed`] where one cannot be listed,
/// also for links that run in a circle.
pub fn found_files(dir: &Path) -> Result<Vec<FoundFile>, CliError> {
    require_folder(dir)?;
    let mut files = Vec::new();
    let walk = WalkDir::new(dir)
        .follow_links(true)
        .sort_by_file_name()
        .min_depth(1);
    for entry in walk.into_iter().filter_entry(|e| !is_hidden(e.file_name())) {
        let entry = entry.map_err(|error| {
            let at = error.path().unwrap_or(dir).to_owned();
            CliError::at(&at, reason(&error))
        })?;
        let path = entry.path();
        if entry.file_type().is_dir() || !is_mesh(path) {
            continue;
        }
        let below = path.strip_prefix(dir).unwrap_or(path);
        let mut parts = below.components();
        let first = parts
            .next()
            .map(|part| part.as_os_str().to_string_lossy().into_owned());
        let rest = parts.as_path();
        let in_subfolder = rest != Path::new("");
        files.push(FoundFile {
            class: first.filter(|_| in_subfolder),
            name: if in_subfolder { rest } else { below }.display().to_string(),
            path: path.to_owned(),
        });
    }
    if files.is_empty() {
        return Err(CliError::Usage(format!(
            "{}: no mesh files; expected a folder per class with {} files in it",
            dir.display(),
            EXTENSIONS.join(", ")
        )));
    }
    Ok(files)
}

/// The mesh files of a folder per class, ordered by class and name. A mesh file that lies in `dir` itself is a class of
/// its own, named after it: an animated file gives all its poses.
///
/// # Errors
/// As [`found_files`].
pub fn labelled_files(dir: &Path) -> Result<Vec<LabelledFile>, CliError> {
    let mut files: Vec<LabelledFile> = found_files(dir)?
        .into_iter()
        .map(|file| LabelledFile {
            class: file.class.unwrap_or_else(|| {
                let stem = file.path.file_stem().unwrap_or_default();
                stem.to_string_lossy().into_owned()
            }),
            path: file.path,
            name: file.name,
        })
        .collect();
    files.sort_by(|a, b| (&a.class, &a.path).cmp(&(&b.class, &b.path)));
    Ok(files)
}

/// Demands a folder.
///
/// # Errors
/// [`CliError::Usage`] with the nearest name there is.
pub fn require_folder(dir: &Path) -> Result<(), CliError> {
    if dir.is_dir() {
        return Ok(());
    }
    let what = if dir.exists() {
        "this is a file; expected a folder".to_owned()
    } else {
        match near_name(dir, Path::is_dir) {
            Some(near) => format!("there is no such folder; did you mean {}?", near.display()),
            None => "there is no such folder".to_owned(),
        }
    };
    Err(CliError::Usage(format!("{}: {what}", dir.display())))
}

fn reason(error: &walkdir::Error) -> String {
    match (error.loop_ancestor(), error.io_error()) {
        (Some(ancestor), _) => format!("the link leads back to {}", ancestor.display()),
        (None, Some(error)) => error.to_string(),
        (None, None) => error.to_string(),
    }
}

fn is_hidden(name: &std::ffi::OsStr) -> bool {
    name.to_string_lossy().starts_with('.')
}

fn is_mesh(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| EXTENSIONS.contains(&e.to_ascii_lowercase().as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for file in files {
            let path = dir.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        dir
    }

    #[test]
    fn folders_are_classes_with_all_below_them_and_loose_files_classes_of_their_own() {
        let dir = folder(&[
            "cat/b.obj",
            "cat/a.OBJ",
            "cat/young/deep/a.obj",
            "cat/.hidden/a.obj",
            "cat/notes.txt",
            "dog/a.off",
            "Fox.gltf",
            ".git/x.obj",
        ]);
        let found: Vec<(String, String)> = labelled_files(dir.path())
            .unwrap()
            .into_iter()
            .map(|f| (f.class, f.name))
            .collect();
        let expected = [
            ("Fox", "Fox.gltf"),
            ("cat", "a.OBJ"),
            ("cat", "b.obj"),
            ("cat", "young/deep/a.obj"),
            ("dog", "a.off"),
        ];
        assert_eq!(found, expected.map(|(c, n)| (c.to_owned(), n.to_owned())));
    }

    #[test]
    fn what_is_no_folder_of_meshes_is_wrong_usage() {
        let dir = folder(&["shapes/a.txt", "file.obj"]);
        for wrong in ["shapes", "file.obj", "nowhere"] {
            let error = labelled_files(&dir.path().join(wrong)).unwrap_err();
            assert!(matches!(error, CliError::Usage(_)), "{wrong}: {error}");
        }
        let typo = labelled_files(&dir.path().join("shaps")).unwrap_err().to_string();
        assert!(typo.contains("did you mean"), "{typo}");
    }

    #[cfg(unix)]
    #[test]
    fn links_that_run_in_a_circle_are_named() {
        let dir = folder(&["cat/a.obj"]);
        std::os::unix::fs::symlink(dir.path().join("cat"), dir.path().join("cat/again")).unwrap();
        let error = labelled_files(dir.path()).unwrap_err().to_string();
        assert!(error.contains("again") && error.contains("leads back"), "{error}");
    }
}
