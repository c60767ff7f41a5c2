//! A class of shapes.

use super::ClassId;
use super::text::{hidden_class, is_hidden};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use unicode_normalization::UnicodeNormalization;

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
    /// A character that is not seen, such as a line break, a bidi control or a zero-width space.
    #[error(
        "a class name must not contain control, format or other invisible characters (found U+{code:04X}); take it out"
    )]
    Hidden {
        /// The character's code point.
        code: u32,
    },
    /// A slash or a backslash.
    #[error("a class name must not contain '/' or '\\'; it is a part of addresses and the name of a folder")]
    Slash,
    /// `.` or `..`.
    #[error("'.' and '..' are no class names; clients take them out of addresses")]
    Dots,
    /// What could be the identifier of another class.
    #[error("a class name must not be a UUID; classes are also addressed by their identifiers")]
    Identifier,
}

/// What people call a class: 1 to [`MAX_NAME_CHARS`] characters in Unicode normalisation form C, no white space around
/// it, no hidden characters, no slashes, not `.`, `..` or a UUID. Names are unique within a store and case counts.
///
/// A name that was stored by an earlier version may break these rules; see [`ClassName::stored`].
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ClassName(String);

impl ClassName {
    /// Normalises, trims and checks a new name.
    ///
    /// # Errors
    /// [`ClassNameError`] where it breaks a rule. Nothing but white space around it is taken out of a name: a control
    /// character there is an error too.
    pub fn new(text: &str) -> Result<Self, ClassNameError> {
        if let Some(c) = text.chars().find(|&c| is_hidden(c)) {
            return Err(ClassNameError::Hidden { code: c.into() });
        }
        let text: String = text.trim().nfc().collect();
        if text.is_empty() {
            return Err(ClassNameError::Empty);
        }
        let found = text.chars().count();
        if found > MAX_NAME_CHARS {
            return Err(ClassNameError::TooLong { found });
        }
        if text.contains(['/', '\\']) {
            return Err(ClassNameError::Slash);
        }
        if text == "." || text == ".." {
            return Err(ClassNameError::Dots);
        }
        if text.parse::<ClassId>().is_ok() {
            return Err(ClassNameError::Identifier);
        }
        Ok(Self(text))
    }

    /// A name as a store has it. Earlier versions accepted names that [`ClassName::new`] refuses; classes that have one
    /// are still shown, found, renamed and deleted.
    ///
    /// # Errors
    /// [`ClassNameError::Empty`].
    pub fn stored(text: impl Into<String>) -> Result<Self, ClassNameError> {
        let text = text.into();
        if text.is_empty() {
            Err(ClassNameError::Empty)
        } else {
            Ok(Self(text))
        }
    }

    /// What every name [`ClassName::new`] accepts matches, white space around it included: a regular expression without
    /// delimiters, for schemas. It is blind to the limit of the length.
    pub fn pattern() -> String {
        const DOTS: &str = r"\s*\.{1,2}\s*$";
        const IDENTIFIER: &str =
            r"\s*(?:urn:uuid:|\{)?[0-9a-fA-F]{8}-?(?:[0-9a-fA-F]{4}-?){3}[0-9a-fA-F]{12}\}?\s*$";
        let refused = format!(r"/\\{}", hidden_class());
        format!("^(?!{DOTS})(?!{IDENTIFIER})[^{refused}]*[^\\s{refused}][^{refused}]*$")
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

    /// Records are read with this; requests are not.
    fn try_from(text: String) -> Result<Self, ClassNameError> {
        Self::stored(text)
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
        assert_eq!(ClassName::new(" \u{a0}"), Err(ClassNameError::Empty));
        assert!(ClassName::new(&"ä".repeat(100)).is_ok());
        assert_eq!(
            ClassName::new(&"ä".repeat(101)),
            Err(ClassNameError::TooLong { found: 101 })
        );
        assert_ne!(ClassName::new("Cat").unwrap(), ClassName::new("cat").unwrap());
        for fine in [
            "...", ".git", "a.b", "sea lion", "猫", "כלב", "🦊", "a-b_c", "cat (2)",
        ] {
            assert_eq!(ClassName::new(fine).unwrap().as_str(), fine);
        }
    }

    #[test]
    fn a_hidden_character_is_refused_wherever_it_stands() {
        for c in [
            '\r', '\n', '\0', '\u{85}', '\u{200b}', '\u{202e}', '\u{2066}', '\u{2028}', '\u{feff}', '\u{ad}',
        ] {
            let code = c.into();
            for text in [
                format!("{c}abc"),
                format!("abc{c}"),
                format!("a{c}c"),
                format!(" {c} abc"),
            ] {
                assert_eq!(
                    ClassName::new(&text),
                    Err(ClassNameError::Hidden { code }),
                    "{text:?}"
                );
            }
        }
    }

    #[test]
    fn a_name_is_no_path_and_no_identifier() {
        for text in [".", "..", " .. "] {
            assert_eq!(ClassName::new(text), Err(ClassNameError::Dots), "{text:?}");
        }
        for text in ["a/b", "/", "..\\x", "\\"] {
            assert_eq!(ClassName::new(text), Err(ClassNameError::Slash), "{text:?}");
        }
        let id = ClassId::new().to_string();
        let forms = [
            id.clone(),
            id.to_uppercase(),
            id.replace('-', ""),
            format!("{{{id}}}"),
            format!("urn:uuid:{id}"),
        ];
        for text in forms {
            assert_eq!(ClassName::new(&text), Err(ClassNameError::Identifier), "{text:?}");
        }
    }

    #[test]
    fn names_that_look_the_same_are_the_same() {
        assert_eq!(ClassName::new("cafe\u{301}"), ClassName::new("caf\u{e9}"));
    }

    #[test]
    fn what_an_earlier_version_stored_is_still_read() {
        for text in ["a/b", "..", "x\u{200b}", "cafe\u{301}"] {
            let json = serde_json::to_string(text).unwrap();
            assert_eq!(serde_json::from_str::<ClassName>(&json).unwrap().as_str(), text);
        }
        assert!(serde_json::from_str::<ClassName>("\"\"").is_err());
    }
}
