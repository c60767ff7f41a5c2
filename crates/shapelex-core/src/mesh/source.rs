//! A mesh file as it arrived, and what a reader may make of it.

use super::TriangleSoup;
use std::fmt;
use std::sync::Arc;

/// A file that came with another one, such as a glTF's `.bin`. Clones share its contents.
#[derive(Clone)]
pub struct Companion {
    /// Its path relative to the file that refers to it.
    pub name: String,
    bytes: Arc<dyn AsRef<[u8]> + Send + Sync>,
}

impl Companion {
    /// A file of this name. `bytes` is kept as it is, so that a reference-counted buffer is not copied.
    pub fn new(name: impl Into<String>, bytes: impl AsRef<[u8]> + Send + Sync + 'static) -> Self {
        Self {
            name: name.into(),
            bytes: Arc::new(bytes),
        }
    }

    /// Its contents.
    pub fn bytes(&self) -> &[u8] {
        (*self.bytes).as_ref()
    }
}

impl fmt::Debug for Companion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Companion")
            .field("name", &self.name)
            .field("bytes", &self.bytes().len())
            .finish()
    }
}

/// A mesh file as it arrived.
#[derive(Clone, Copy, Debug, Default)]
pub struct Source<'a> {
    /// The file's contents.
    pub bytes: &'a [u8],
    /// The file's name, if known: the last resort for telling its format.
    pub name: Option<&'a str>,
    /// The declared media type, if any: asked after the bytes and before the name.
    pub media_type: Option<&'a str>,
    /// Other files of the same upload.
    pub companions: &'a [Companion],
}

/// One pose of an animated file.
#[derive(Clone, Debug)]
pub struct Pose {
    /// Clip and moment, for people: `Gallop@0.50`.
    pub label: String,
    /// The mesh in this pose.
    pub soup: TriangleSoup,
}
