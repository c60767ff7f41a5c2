//! Inputs that could not be used: said at once on stderr, collected for the answer.

use super::output::note_line;
use serde::Serialize;
use std::path::Path;

/// A file that could not be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Refused {
    /// Its path.
    pub file: String,
    /// One sentence.
    pub reason: String,
}

impl Refused {
    /// A refusal; a reason that begins with the path loses it.
    pub fn new(path: &Path, reason: impl std::fmt::Display) -> Self {
        let file = path.display().to_string();
        let reason = reason.to_string();
        Self {
            reason: reason
                .strip_prefix(&format!("{file}: "))
                .unwrap_or(&reason)
                .to_owned(),
            file,
        }
    }

    /// Says so on stderr.
    pub fn warn(&self) {
        note_line!("shapelex: {}: {}", self.file, self.reason);
    }
}
