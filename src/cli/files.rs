//! Mesh files on disk, with the buffers they refer to.

use super::CliError;
use crate::mesh::{Companion, Source};
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
    fn only_buffers_below_the_file_are_read() {
        let gltf = br#"{"buffers":[{"uri":"a.bin"},{"uri":"data:;base64,AA=="},{"uri":"../../secret"},{"uri":"/etc/passwd"},{}]}"#;
        assert_eq!(buffer_uris(gltf), ["a.bin"]);
        assert!(buffer_uris(b"v 0 0 0").is_empty());
    }
}
