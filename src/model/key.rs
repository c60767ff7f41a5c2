//! An API key: who may do what, and how much of it.

use super::KeyId;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// What every secret begins with, so that scanners find one that leaked.
pub const SECRET_PREFIX: &str = "slx_";
/// The longest name of a key, in characters.
pub const MAX_KEY_NAME_CHARS: usize = 64;
/// The key derivation's context. Changing it makes every key useless.
const HASH_CONTEXT: &str = "shapelex 2026-11 api key secret";

/// What a key allows. Each scope includes the ones before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    /// Querying, listing, showing, downloading.
    Read,
    /// Classes, shapes, reindexing, cancelling jobs.
    Write,
    /// Keys and snapshots.
    Admin,
}

impl Scope {
    /// The scope's name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Write => "write",
            Self::Admin => "admin",
        }
    }
}

/// A text is no key name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a key's name has 1 to {MAX_KEY_NAME_CHARS} characters out of letters, digits, '.', '_' and '-'")]
pub struct KeyNameError;

/// What people call a key: 1 to 64 ASCII letters, digits, `.`, `_` and `-`, so that it can stand in a log line as it
/// is. Names are unique within a store.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct KeyName(String);

impl KeyName {
    /// Checks a name.
    ///
    /// # Errors
    /// [`KeyNameError`].
    pub fn new(text: &str) -> Result<Self, KeyNameError> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
        if (1..=MAX_KEY_NAME_CHARS).contains(&text.chars().count()) && text.chars().all(allowed) {
            Ok(Self(text.to_owned()))
        } else {
            Err(KeyNameError)
        }
    }

    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for KeyName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl TryFrom<String> for KeyName {
    type Error = KeyNameError;

    fn try_from(text: String) -> Result<Self, KeyNameError> {
        Self::new(&text)
    }
}

impl From<KeyName> for String {
    fn from(name: KeyName) -> Self {
        name.0
    }
}

/// The BLAKE3 hash (key derivation mode) of a secret: all that is kept of it. A secret has 256 random bits, so a slow
/// hash would add nothing.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct KeyHash([u8; 32]);

impl KeyHash {
    /// The hash of a secret.
    pub fn of(secret: &str) -> Self {
        Self(blake3::derive_key(HASH_CONTEXT, secret.as_bytes()))
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

impl fmt::Debug for KeyHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("KeyHash(…)")
    }
}

impl FromStr for KeyHash {
    type Err = KeyHashError;

    fn from_str(text: &str) -> Result<Self, KeyHashError> {
        let hash = blake3::Hash::from_hex(text).map_err(|_| KeyHashError)?;
        Ok(Self(*hash.as_bytes()))
    }
}

/// A text is no hash of a secret.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a secret's hash is 64 hexadecimal digits")]
pub struct KeyHashError;

impl TryFrom<String> for KeyHash {
    type Error = KeyHashError;

    fn try_from(text: String) -> Result<Self, KeyHashError> {
        text.parse()
    }
}

impl From<KeyHash> for String {
    fn from(hash: KeyHash) -> Self {
        blake3::Hash::from_bytes(hash.0).to_hex().to_string()
    }
}

/// How much a key may do; what is `None` is as the service's settings say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct KeyLimits {
    /// Queried meshes per minute.
    pub queries_per_minute: Option<u32>,
    /// Bytes of the files of the shapes that were uploaded with it.
    pub stored_bytes: Option<u64>,
    /// Classes that were made with it.
    pub classes: Option<u64>,
}

/// An API key. The secret itself is nowhere kept.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ApiKey {
    /// Never changes.
    pub id: KeyId,
    /// Unique within the store.
    pub name: KeyName,
    /// What it allows.
    pub scope: Scope,
    /// The hash of its secret.
    pub hash: KeyHash,
    /// How much it may do.
    #[serde(default)]
    pub limits: KeyLimits,
    /// When it was made.
    pub created_at: Timestamp,
    /// When it stops working; `None` for never.
    pub expires_at: Option<Timestamp>,
}

impl ApiKey {
    /// Whether it works no more.
    pub fn is_expired(&self, now: Timestamp) -> bool {
        self.expires_at.is_some_and(|end| end <= now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scopes_include_the_smaller_ones() {
        assert!(Scope::Admin > Scope::Write && Scope::Write > Scope::Read);
    }

    #[test]
    fn names_can_stand_in_a_log_line() {
        assert!(KeyName::new("ci-runner_2.eu").is_ok());
        for bad in ["", "two words", "a\nb", "schlüssel", &"x".repeat(65)] {
            assert_eq!(KeyName::new(bad), Err(KeyNameError), "{bad:?}");
        }
    }

    #[test]
    fn a_hash_survives_text_and_does_not_show_itself() {
        let hash = KeyHash::of("slx_secret");
        assert_ne!(hash, KeyHash::of("slx_Secret"));
        let json = serde_json::to_string(&hash).unwrap();
        assert_eq!(serde_json::from_str::<KeyHash>(&json).unwrap(), hash);
        assert_eq!(format!("{hash:?}"), "KeyHash(…)");
        // What is on people's disks must go on opening their doors.
        assert_eq!(json.len(), 66);
    }
}
