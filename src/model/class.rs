//! A class of shapes.

use super::ClassId;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The longest class name, in characters.
pub const MAX_NAME_CHARS: usize = 100;

/// A text is no class name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ClassNameError {
    /// Nothing is left after trimming.
    #[error("a class name must have at least one character that is not white space")]
    Empty,
    /// More than [`MAX_NAME_CHARS`] characters.
    #[error("a class name has at most {MAX_NAME_CHARS} characters, this one has {found}")]
    TooLong {
        /// How many it has.
        found: usize,
    },
    /// A control character, such as a line break.
    #[error("a class name must not contain control characters (found U+{code:04X})")]
    Control {
        /// The character's code point.
        code: u32,
    },
}

/// What people call a class: 1 to 100 characters, no white space around it, no control characters. Names are unique
/// within a store and case counts.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ClassName(String);

impl ClassName {
    /// Trims and checks a name.
    ///
    /// # Errors
    /// [`ClassNameError`] where nothing is left, it is too long, or a control character is inside.
    pub fn new(text: &str) -> Result<Self, ClassNameError> {
        let text = text.trim();
        if text.is_empty() {
            return Err(ClassNameError::Empty);
        }
        let found = text.chars().count();
        if found > MAX_NAME_CHARS {
            return Err(ClassNameError::TooLong { found });
        }
        if let Some(c) = text.chars().find(|c| c.is_control()) {
            return Err(ClassNameError::Control { code: c.into() });
        }
        Ok(Self(text.to_owned()))
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for ClassName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for ClassName {
    type Err = ClassNameError;

    fn from_str(text: &str) -> Result<Self, ClassNameError> {
        Self::new(text)
    }
}

impl TryFrom<String> for ClassName {
    type Error = ClassNameError;

    fn try_from(text: String) -> Result<Self, ClassNameError> {
        Self::new(&text)
    }
}

impl From<ClassName> for String {
    fn from(name: ClassName) -> Self {
        name.0
    }
}

/// A class of shapes: what a query is recognised as.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Class {
    /// Never changes, also when the class is renamed.
    pub id: ClassId,
    /// Unique within the store.
    pub name: ClassName,
    /// Starts at 0 and grows by one whenever shapes are added or deleted. A generation remembers which revision it
    /// learnt, so that a class is stale exactly where the two differ.
    pub revision: u64,
    /// Training shapes in it.
    pub shapes: u64,
    /// Bytes of the files those shapes came from; a file that gave several poses counts for each.
    pub bytes: u64,
    /// When it was made.
    pub created_at: Timestamp,
    /// When its name or its shapes last changed.
    pub updated_at: Timestamp,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_trimmed_and_checked() {
        assert_eq!(ClassName::new("  cat ").unwrap().as_str(), "cat");
        assert_eq!(ClassName::new(" \t\n"), Err(ClassNameError::Empty));
        assert_eq!(ClassName::new("a\nb"), Err(ClassNameError::Control { code: 10 }));
        assert!(ClassName::new(&"ä".repeat(100)).is_ok());
        assert_eq!(
            ClassName::new(&"ä".repeat(101)),
            Err(ClassNameError::TooLong { found: 101 })
        );
        assert_ne!(ClassName::new("Cat").unwrap(), ClassName::new("cat").unwrap());
        assert!(serde_json::from_str::<ClassName>("\"\"").is_err());
    }
}
