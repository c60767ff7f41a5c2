//! Mesh files on disk: a folder per class, and a file with the buffers it refers to.

use super::CliError;
use crate::mesh::{Companion, Source};
use std::path::{Path, PathBuf};

/// Extensions of the formats we read.
const EXTENSIONS: [&str; 6] = ["obj", "gltf", "glb", "ply", "stl", "off"];

/// A file that belongs to a class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelledFile {
    /// The class: the folder's name.
    pub class: String,
    /// The file.
    pub path: PathBuf,
}

/// The last part of a path, for people.
pub fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(
        || path.display().to_string(),
        |n| n.to_string_lossy().into_owned(),
    )
}

/// The mesh files of a folder per class, ordered by class and name. A mesh file that lies in `dir` itself is a class
/// of its own, named after it: an animated file gives all its poses.
///
/// Files with other extensions and hidden ones are passed over: folders of meshes hold textures and notes.
///
/// # Errors
/// [`CliError::Usage`] where there is no mesh; [`CliError::Failed`] where a folder cannot be listed.
pub fn labelled_files(dir: &Path) -> Result<Vec<LabelledFile>, CliError> {
    let mut files = Vec::new();
    for path in entries(dir)? {
        if path.is_dir() {
            let class = file_name(&path);
            let members = entries(&path)?.into_iter().filter(|p| p.is_file() && is_mesh(p));
            files.extend(members.map(|path| LabelledFile {
                class: class.clone(),
                path,
            }));
        } else if is_mesh(&path) {
            let class = path
                .file_stem()
                .map(|s| s.to_string_lossy().into_owned())
                .unwrap_or_default();
            files.push(LabelledFile { class, path });
        }
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

fn entries(dir: &Path) -> Result<Vec<PathBuf>, CliError> {
    let mut paths = std::fs::read_dir(dir)
        .and_then(|entries| {
            entries
                .map(|e| e.map(|e| e.path()))
                .collect::<Result<Vec<_>, _>>()
        })
        .map_err(|error| CliError::at(dir, error))?;
    paths.retain(|p| !file_name(p).starts_with('.'));
    paths.sort();
    Ok(paths)
}

fn is_mesh(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| EXTENSIONS.contains(&e.to_ascii_lowercase().as_str()))
}

/// A mesh file in memory, with the buffers it refers to.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// Its name.
    pub name: String,
    /// Its contents.
    pub bytes: Vec<u8>,
    /// Files a glTF refers to, as far as they lie beside it.
    pub companions: Vec<Companion>,
}

impl MeshFile {
    /// Loads a file and, for a glTF, the buffers beside it.
    ///
    /// # Errors
    /// [`CliError::Failed`] where the file cannot be read, or is longer than `max_bytes`. A missing buffer is left to
    /// the reader, which knows whether it is needed.
    pub fn load(path: &Path, max_bytes: usize) -> Result<Self, CliError> {
        let length = std::fs::metadata(path)
            .map_err(|error| CliError::at(path, error))?
            .len();
        if length > max_bytes as u64 {
            return Err(CliError::at(
                path,
                format!("the file has {length} bytes, more than the limit of {max_bytes}"),
            ));
        }
        let bytes = std::fs::read(path).map_err(|error| CliError::at(path, error))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let companions = buffer_uris(&bytes)
            .into_iter()
            .filter_map(|name| {
                let bytes = std::fs::read(folder.join(&name)).ok()?;
                Some(Companion { name, bytes })
            })
            .collect();
        Ok(Self {
            name: file_name(path),
            bytes,
            companions,
        })
    }

    /// The file as the readers want it.
    pub fn source(&self) -> Source<'_> {
        Source {
            bytes: &self.bytes,
            name: Some(&self.name),
            media_type: None,
            companions: &self.companions,
        }
    }
}

/// The buffers a glTF in JSON refers to by a plain relative path. Absolute paths and those that climb out of the
/// folder are left out: a model that came from elsewhere has no business with them.
fn buffer_uris(bytes: &[u8]) -> Vec<String> {
    if bytes.iter().find(|b| !b.is_ascii_whitespace()) != Some(&b'{') {
        return Vec::new();
    }
    #[derive(serde::Deserialize)]
    struct Document {
        #[serde(default)]
        buffers: Vec<Buffer>,
    }
    #[derive(serde::Deserialize)]
    struct Buffer {
        uri: Option<String>,
    }
    let Ok(document) = serde_json::from_slice::<Document>(bytes) else {
        return Vec::new();
    };
    document
        .buffers
        .into_iter()
        .filter_map(|b| b.uri)
        .filter(|uri| !uri.starts_with("data:"))
        .filter(|uri| {
            Path::new(uri)
                .components()
                .all(|c| matches!(c, std::path::Component::Normal(_)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_classes_and_loose_files_classes_of_their_own() {
        let dir = tempfile::tempdir().unwrap();
        for file in [
            "cat/b.obj",
            "cat/a.OBJ",
            "cat/notes.txt",
            "dog/a.off",
            "Fox.gltf",
            ".git/x.obj",
        ] {
            let path = dir.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let found: Vec<(String, String)> = labelled_files(dir.path())
            .unwrap()
            .into_iter()
            .map(|f| (f.class, file_name(&f.path)))
            .collect();
        let expected = [
            ("Fox", "Fox.gltf"),
            ("cat", "a.OBJ"),
            ("cat", "b.obj"),
            ("dog", "a.off"),
        ];
        assert_eq!(found, expected.map(|(c, n)| (c.to_owned(), n.to_owned())));
        let empty = tempfile::tempdir().unwrap();
        assert!(matches!(labelled_files(empty.path()), Err(CliError::Usage(_))));
    }

    #[test]
    fn only_buffers_below_the_file_are_read() {
        let gltf = br#"{"buffers":[{"uri":"a.bin"},{"uri":"data:;base64,AA=="},{"uri":"../../secret"},{"uri":"/etc/passwd"},{}]}"#;
        assert_eq!(buffer_uris(gltf), ["a.bin"]);
        assert!(buffer_uris(b"v 0 0 0").is_empty());
    }
}
