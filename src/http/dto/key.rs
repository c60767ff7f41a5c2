//! API keys on the wire.

use super::time;
use crate::http::problem::{Code, Problem};
use crate::model::{ApiKey, KeyLimits, Scope};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a key allows. Each scope includes the ones before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum KeyScope {
    /// Querying, listing, showing, downloading, metrics.
    Read,
    /// Classes, shapes, reindexing, cancelling jobs.
    Write,
    /// Keys and snapshots.
    Admin,
}

impl From<Scope> for KeyScope {
    fn from(scope: Scope) -> Self {
        match scope {
            Scope::Read => Self::Read,
            Scope::Write => Self::Write,
            Scope::Admin => Self::Admin,
        }
    }
}

impl From<KeyScope> for Scope {
    fn from(scope: KeyScope) -> Self {
        match scope {
            KeyScope::Read => Self::Read,
            KeyScope::Write => Self::Write,
            KeyScope::Admin => Self::Admin,
        }
    }
}

/// A key to be made.
#[derive(Clone, Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"name": "scanner", "scope": "read", "queries_per_minute": 120}))]
pub struct CreateKey {
    /// 1 to 64 letters, digits, `.`, `_` and `-`; unique.
    #[schema(min_length = 1, max_length = 64, pattern = "^[A-Za-z0-9._-]+$")]
    pub name: String,
    /// What it allows.
    pub scope: KeyScope,
    /// When it stops working, RFC 3339; never where it is left out.
    #[schema(format = DateTime)]
    pub expires_at: Option<String>,
    /// Meshes it may query per minute; the service's setting where it is left out.
    #[schema(minimum = 1)]
    pub queries_per_minute: Option<u32>,
    /// Bytes of shapes it may have uploaded at a time; the service's setting where it is left out.
    #[schema(minimum = 1)]
    pub max_stored_bytes: Option<u64>,
    /// Classes it may have made at a time; the service's setting where it is left out.
    #[schema(minimum = 1)]
    pub max_classes: Option<u64>,
}

impl CreateKey {
    /// The end of its life.
    ///
    /// # Errors
    /// `invalid_field` where it is no time, or in the past.
    pub fn expires_at(&self, now: Timestamp) -> Result<Option<Timestamp>, Problem> {
        let Some(text) = &self.expires_at else {
            return Ok(None);
        };
        let wrong = |detail: String| Problem::new(Code::InvalidField, detail).with("name", "expires_at");
        let end: Timestamp = text
            .parse()
            .map_err(|_| wrong("expires_at must be a time such as 2027-01-31T12:00:00Z".to_owned()))?;
        if end <= now {
            return Err(wrong(format!("expires_at is in the past: {end}")));
        }
        Ok(Some(end))
    }

    /// How much it may do.
    ///
    /// # Errors
    /// `invalid_field` for a zero, which would refuse everything.
    pub fn limits(&self) -> Result<KeyLimits, Problem> {
        let zeros = [
            ("queries_per_minute", self.queries_per_minute.map(u64::from)),
            ("max_stored_bytes", self.max_stored_bytes),
            ("max_classes", self.max_classes),
        ];
        if let Some((name, _)) = zeros.iter().find(|(_, value)| *value == Some(0)) {
            return Err(
                Problem::new(Code::InvalidField, format!("{name} must be 1 or more, got 0"))
                    .with("name", *name),
            );
        }
        Ok(KeyLimits {
            queries_per_minute: self.queries_per_minute,
            stored_bytes: self.max_stored_bytes,
            classes: self.max_classes,
        })
    }
}

/// An API key, without its secret.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct KeyDto {
    /// Never changes.
    pub id: String,
    /// Unique.
    pub name: String,
    /// What it allows.
    pub scope: KeyScope,
    /// RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// RFC 3339, UTC; `null` where it does not end.
    #[schema(format = DateTime)]
    pub expires_at: Option<String>,
    /// Whether that time has come.
    pub expired: bool,
    /// Meshes it may query per minute; `null` where the service's setting counts.
    pub queries_per_minute: Option<u32>,
    /// Bytes of shapes it may have uploaded at a time; `null` where the service's setting counts.
    pub max_stored_bytes: Option<u64>,
    /// Classes it may have made at a time; `null` where the service's setting counts.
    pub max_classes: Option<u64>,
}

impl KeyDto {
    /// A key as it stands now.
    pub fn new(key: &ApiKey, now: Timestamp) -> Self {
        Self {
            id: key.id.to_string(),
            name: key.name.to_string(),
            scope: key.scope.into(),
            created_at: time(key.created_at),
            expires_at: key.expires_at.map(time),
            expired: key.is_expired(now),
            queries_per_minute: key.limits.queries_per_minute,
            max_stored_bytes: key.limits.stored_bytes,
            max_classes: key.limits.classes,
        }
    }
}

/// A key that was just made.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct CreatedKey {
    /// The key itself. It is kept nowhere and never shown again.
    pub secret: String,
    /// What it is.
    #[serde(flatten)]
    pub key: KeyDto,
}
