//! A training shape and the file it came from.

use super::{ClassId, ShapeId};
use bytes::Bytes;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use shapelex_core::mesh::{Companion, Format, PrepareReport};
use std::fmt;
use std::str::FromStr;

/// A text is no content hash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a content hash is 64 hexadecimal digits")]
pub struct ContentHashError;

/// The BLAKE3 hash of a file's bytes, which is also its name in the store.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ContentHash([u8; 32]);

impl ContentHash {
    /// The hash of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// The 32 bytes of the hash.
    pub fn to_bytes(self) -> [u8; 32] {
        self.0
    }

    /// A hash from its 32 bytes.
    pub fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }
}

impl fmt::Display for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ContentHash({self})")
    }
}

impl FromStr for ContentHash {
    type Err = ContentHashError;

    fn from_str(text: &str) -> Result<Self, ContentHashError> {
        let hash = blake3::Hash::from_hex(text).map_err(|_| ContentHashError)?;
        Ok(Self(*hash.as_bytes()))
    }
}

impl TryFrom<String> for ContentHash {
    type Error = ContentHashError;

    fn try_from(text: String) -> Result<Self, ContentHashError> {
        text.parse()
    }
}

impl From<ContentHash> for String {
    fn from(hash: ContentHash) -> Self {
        hash.to_string()
    }
}

/// Which pose of an animated file a shape is.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ShapePose {
    /// Clip and moment, for people: `Gallop@0.50`.
    pub label: String,
    /// Which of the sampled poses, from 0.
    pub index: usize,
    /// How many poses were sampled from the file.
    pub of: usize,
}

/// A file the shape's own file refers to, such as a glTF's `.bin`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompanionFile {
    /// The name it was sent under.
    pub name: String,
    /// Its contents, stored like the shape's own file.
    pub content: ContentHash,
}

/// A training shape of a class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// Never changes.
    pub id: ShapeId,
    /// The class it belongs to.
    pub class: ClassId,
    /// The name its file was sent under.
    pub name: Option<String>,
    /// The file's contents.
    pub content: ContentHash,
    /// Files sent with it that it refers to.
    pub companions: Vec<CompanionFile>,
    /// The file's format.
    pub format: Format,
    /// The file's length in bytes, companions included.
    pub bytes: u64,
    /// Which pose of the file, where it is animated and poses were asked for.
    pub pose: Option<ShapePose>,
    /// What preparing did when it was uploaded.
    pub report: PrepareReport,
    /// When it was added.
    pub created_at: Timestamp,
}

impl Shape {
    /// What makes this shape the same as another one: the contents of its file and companions and its pose. Names
    /// and the moment of the upload do not count.
    pub fn identity(&self) -> ContentHash {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.content.to_bytes());
        hasher.update(&(self.companions.len() as u64).to_le_bytes());
        for companion in &self.companions {
            // The name decides which URI the companion answers to, so it is part of what the file means.
            hasher.update(&(companion.name.len() as u64).to_le_bytes());
            hasher.update(companion.name.as_bytes());
            hasher.update(&companion.content.to_bytes());
        }
        if let Some(pose) = &self.pose {
            hasher.update(&(pose.index as u64).to_le_bytes());
            hasher.update(&(pose.of as u64).to_le_bytes());
        }
        ContentHash(*hasher.finalize().as_bytes())
    }
}

/// A shape about to be added. The caller has read and prepared it already; the store keeps what it was told.
#[derive(Clone, Debug)]
pub struct NewShape {
    /// The name its file was sent under.
    pub name: Option<String>,
    /// The file. Several poses of one file share it at no cost.
    pub bytes: Bytes,
    /// Files sent with it that it refers to; leave out those it does not.
    pub companions: Vec<Companion>,
    /// The file's format.
    pub format: Format,
    /// Which pose of the file.
    pub pose: Option<ShapePose>,
    /// What preparing did.
    pub report: PrepareReport,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_survive_text_and_refuse_other_text() {
        let hash = ContentHash::of(b"mesh");
        assert_eq!(hash.to_string().len(), 64);
        assert_eq!(hash.to_string().parse(), Ok(hash));
        assert!("abc".parse::<ContentHash>().is_err());
        assert!("g".repeat(64).parse::<ContentHash>().is_err());
    }
}
