//! What is limited per API key.

use std::fmt;

/// What an API key may have a limited amount of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quota {
    /// Classes.
    Classes,
    /// Bytes of the shapes' files.
    StoredBytes,
}

impl Quota {
    /// Its name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Classes => "classes",
            Self::StoredBytes => "stored_bytes",
        }
    }
}

impl fmt::Display for Quota {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Classes => "classes",
            Self::StoredBytes => "bytes of shapes",
        })
    }
}
