//! What is queried: files, the files of folders, and standard input.

use super::CliError;
use super::files::MeshFile;
use super::folders::found_files;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The name of standard input on the command line.
pub const STDIN: &str = "-";

/// Where a mesh to be queried is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In a file or on standard input.
    File,
    /// In the index: the path is a shape's id, or `CLASS/ID`.
    Stored,
}

/// A mesh to be queried.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Where it is.
    pub place: Place,
    /// The file, or `-`, or the stored shape.
    pub path: PathBuf,
    /// The class it belongs to, where it came from a subfolder of a folder.
    pub class: Option<String>,
    /// What it is called instead of its file's name.
    pub name: Option<String>,
}

/// Everything that was named, folders taken apart: their own files and those below each subfolder, which names the
/// class. `name` is what standard input is called.
///
/// # Errors
/// [`CliError::Usage`] where a folder has no mesh, standard input is named twice, or is called something without being
/// named.
pub fn gather(paths: &[PathBuf], name: Option<&str>) -> Result<Vec<Input>, CliError> {
    let standard = paths.iter().filter(|path| *path == Path::new(STDIN)).count();
    if standard > 1 {
        return Err(CliError::Usage(
            "- is standard input and can be read once".to_owned(),
        ));
    }
    if name.is_some() && standard == 0 {
        return Err(CliError::Usage(
            "--name is what standard input is called; name it as -".to_owned(),
        ));
    }
    let mut inputs = Vec::new();
    for path in paths {
        let given = (path == Path::new(STDIN))
            .then(|| name.map(str::to_owned))
            .flatten();
        if path != Path::new(STDIN) && path.is_dir() {
            inputs.extend(found_files(path)?.into_iter().map(|file| Input {
                place: Place::File,
                path: file.path,
                class: file.class,
                name: None,
            }));
        } else {
            inputs.push(Input {
                place: Place::File,
                path: path.clone(),
                class: None,
                name: given,
            });
        }
    }
    Ok(inputs)
}

impl Input {
    /// A stored shape, by its id or as `CLASS/ID`.
    pub fn stored(shape: &str) -> Self {
        Self {
            place: Place::Stored,
            path: PathBuf::from(shape),
            class: None,
            name: None,
        }
    }

    /// The mesh's bytes.
    ///
    /// # Errors
    /// As [`MeshFile::load`].
    pub fn load(&self, max_bytes: usize) -> Result<MeshFile, CliError> {
        if self.path != Path::new(STDIN) {
            return MeshFile::load(&self.path, max_bytes);
        }
        let mut bytes = Vec::new();
        let limit = max_bytes as u64;
        std::io::stdin().lock().take(limit + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > limit {
            return Err(CliError::at(
                &self.path,
                format!("standard input has more bytes than the limit of {max_bytes}"),
            ));
        }
        Ok(MeshFile {
            name: self.name.clone().unwrap_or_else(|| "standard input".to_owned()),
            bytes,
            companions: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_taken_apart_and_their_subfolders_name_classes() {
        let dir = tempfile::tempdir().unwrap();
        for file in ["loose.off", "cat/a.obj", "cat/young/b.obj"] {
            let path = dir.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let found = gather(&[dir.path().to_owned(), PathBuf::from("-")], Some("x.obj")).unwrap();
        let classes: Vec<Option<&str>> = found.iter().map(|i| i.class.as_deref()).collect();
        assert_eq!(classes, [Some("cat"), Some("cat"), None, None]);
        assert_eq!(found[3].name.as_deref(), Some("x.obj"));
        assert!(gather(&[PathBuf::from("-"), PathBuf::from("-")], None).is_err());
        assert!(gather(&[PathBuf::from("a.obj")], Some("x")).is_err());
    }
}
