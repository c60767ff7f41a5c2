//! Mesh files on disk, with the buffers they refer to.

use super::CliError;
use shapelex_core::memory::MemoryBudget;
use shapelex_core::mesh::gltf::external_buffers;
use shapelex_core::mesh::{Companion, Source};
use std::io::Read;
use std::path::Path;

/// The last part of a path, for people.
pub fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(
        || path.display().to_string(),
        |n| n.to_string_lossy().into_owned(),
    )
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
        let found = std::fs::metadata(path).map_err(|error| CliError::at(path, error))?;
        if found.is_dir() {
            return Err(CliError::at(path, "this is a folder; expected a mesh file"));
        }
        let length = found.len();
        if length > max_bytes as u64 {
            return Err(CliError::at(
                path,
                format!("the file has {length} bytes, more than the limit of {max_bytes}"),
            ));
        }
        let bytes = std::fs::read(path).map_err(|error| CliError::at(path, error))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut left = max_bytes.saturating_sub(bytes.len());
        let mut companions = Vec::new();
        let memory = MemoryBudget::unlimited().reservation();
        let buffers = external_buffers(&bytes, &memory).map_err(|error| CliError::at(path, error))?;
        for uri in buffers {
            let Some(beside) = uri.candidates().map(|p| folder.join(p)).find(|p| p.is_file()) else {
                continue;
            };
            let contents = std::fs::File::open(&beside)
                .and_then(|file| {
                    let mut contents = Vec::new();
                    file.take(left as u64 + 1).read_to_end(&mut contents)?;
                    Ok(contents)
                })
                .map_err(|error| CliError::at(&beside, error))?;
            left = left.checked_sub(contents.len()).ok_or_else(|| {
                CliError::at(
                    &beside,
                    format!("with its buffers the file has more bytes than the limit of {max_bytes}"),
                )
            })?;
            companions.push(Companion::new(uri.path(), contents));
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_buffers_below_the_file_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("model");
        std::fs::create_dir_all(folder.join("parts")).unwrap();
        std::fs::write(dir.path().join("secret.bin"), "secret").unwrap();
        std::fs::write(folder.join("a b.bin"), "a").unwrap();
        std::fs::write(folder.join("parts/b.bin"), "b").unwrap();
        let secret = dir.path().join("secret.bin");
        let gltf = serde_json::json!({"buffers": [
            {"uri": "a%20b.bin"}, {"uri": "./a b.bin"}, {"uri": "parts\\b.bin"}, {"uri": "data:;base64,AA=="},
            {"uri": "../secret.bin"}, {"uri": secret}, {"uri": "..%2Fsecret.bin"}, {"uri": "missing.bin"}, {}
        ]});
        let path = folder.join("m.gltf");
        std::fs::write(&path, gltf.to_string()).unwrap();
        let file = MeshFile::load(&path, 1 << 20).unwrap();
        let mut found: Vec<(&str, &[u8])> = file
            .companions
            .iter()
            .map(|c| (c.name.as_str(), c.bytes()))
            .collect();
        found.sort();
        let expected: [(&str, &[u8]); 2] = [("a b.bin", b"a"), ("parts/b.bin", b"b")];
        assert_eq!(found, expected);
        let size = file.bytes.len();
        assert!(MeshFile::load(&path, size + 2).is_ok());
        assert!(MeshFile::load(&path, size + 1).is_err());
    }
}
