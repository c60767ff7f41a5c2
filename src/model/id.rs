//! Identifiers: UUIDs of version 7, so that sorting by identifier is sorting by creation.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use uuid::Uuid;

/// A text is no identifier.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{text}' is not an identifier; expected a UUID such as 01890a5d-ac96-774b-bcce-b302099a8057")]
pub struct IdError {
    /// The text, cut to 64 characters.
    pub text: String,
}

macro_rules! identifier {
    ($name:ident, $what:literal) => {
        #[doc = concat!("Identifies ", $what, ": a UUID of version 7, ordered by creation.")]
        #[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(try_from = "String", into = "String")]
        pub struct $name(Uuid);

        impl $name {
            /// A new identifier, greater than every one this process made before.
            #[allow(
                clippy::new_without_default,
                reason = "a default that differs each time would surprise"
            )]
            pub fn new() -> Self {
                Self(Uuid::now_v7())
            }

            /// The sixteen bytes, most significant first: their order is the identifiers' order.
            pub fn to_bytes(self) -> [u8; 16] {
                self.0.into_bytes()
            }

            /// The identifier of these bytes.
            pub fn from_bytes(bytes: [u8; 16]) -> Self {
                Self(Uuid::from_bytes(bytes))
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.hyphenated().fmt(f)
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!(stringify!($name), "({})"), self.0.hyphenated())
            }
        }

        impl FromStr for $name {
            type Err = IdError;

            fn from_str(text: &str) -> Result<Self, IdError> {
                Uuid::try_parse(text).map(Self).map_err(|_| IdError {
                    text: text.chars().take(64).collect(),
                })
            }
        }

        impl TryFrom<String> for $name {
            type Error = IdError;

            fn try_from(text: String) -> Result<Self, IdError> {
                text.parse()
            }
        }

        impl From<$name> for String {
            fn from(id: $name) -> Self {
                id.to_string()
            }
        }
    };
}

identifier!(ClassId, "a class");
identifier!(ShapeId, "a training shape");
identifier!(JobId, "a job");
identifier!(KeyId, "an API key");
identifier!(SnapshotId, "a snapshot");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_ordered_by_creation_and_survive_text_and_bytes() {
        let ids: Vec<ClassId> = (0..1000).map(|_| ClassId::new()).collect();
        assert!(
            ids.windows(2)
                .all(|w| w[0] < w[1] && w[0].to_bytes() < w[1].to_bytes())
        );
        assert_eq!(ids[7].to_string().parse(), Ok(ids[7]));
        assert_eq!(ClassId::from_bytes(ids[7].to_bytes()), ids[7]);
        let json = serde_json::to_string(&ids[7]).unwrap();
        assert_eq!(json, format!("\"{}\"", ids[7]));
        assert_eq!(serde_json::from_str::<ClassId>(&json).unwrap(), ids[7]);
    }

    #[test]
    fn other_text_is_refused() {
        assert!("cat".parse::<JobId>().is_err());
        assert_eq!("x".repeat(500).parse::<JobId>().unwrap_err().text.len(), 64);
    }
}
