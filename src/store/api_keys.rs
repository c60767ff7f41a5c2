//! API keys: records like any other, made and revoked through the catalogue log.

use super::event::Event;
use super::payload::{instant, only, pack, unpack};
use super::record::{Family, Record};
use super::{Batch, Store, StoreError, keys, record};
use crate::model::{ApiKey, KeyHash, KeyId, KeyLimits, KeyName, Scope};
use serde::{Deserialize, Serialize};

/// API keys a store holds at most: each request compares its own with all of them.
pub const MAX_KEYS: usize = 1000;

#[derive(Serialize, Deserialize)]
struct ApiKeyV1 {
    id: [u8; 16],
    name: String,
    scope: u8,
    hash: [u8; 32],
    queries_per_minute: Option<u32>,
    stored_bytes: Option<u64>,
    classes: Option<u64>,
    created_at: i128,
    expires_at: Option<i128>,
}

/// The number of a scope in records. Numbers are never given twice.
const SCOPES: [(u8, Scope); 3] = [(1, Scope::Read), (2, Scope::Write), (3, Scope::Admin)];

impl Record for ApiKey {
    const FAMILY: Family = Family::ApiKey;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        let scope = SCOPES
            .iter()
            .find(|(_, scope)| *scope == self.scope)
            .ok_or_else(|| format!("scope {} has no number", self.scope.name()))?;
        pack(&ApiKeyV1 {
            id: self.id.to_bytes(),
            name: self.name.as_str().to_owned(),
            scope: scope.0,
            hash: self.hash.to_bytes(),
            queries_per_minute: self.limits.queries_per_minute,
            stored_bytes: self.limits.stored_bytes,
            classes: self.limits.classes,
            created_at: self.created_at.as_nanosecond(),
            expires_at: self.expires_at.map(|t| t.as_nanosecond()),
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let v: ApiKeyV1 = unpack(payload)?;
        let scope = SCOPES
            .iter()
            .find(|(number, _)| *number == v.scope)
            .ok_or_else(|| format!("unknown scope {}", v.scope))?;
        Ok(Self {
            id: KeyId::from_bytes(v.id),
            name: KeyName::new(&v.name).map_err(|e| e.to_string())?,
            scope: scope.1,
            hash: KeyHash::from_bytes(v.hash),
            limits: KeyLimits {
                queries_per_minute: v.queries_per_minute,
                stored_bytes: v.stored_bytes,
                classes: v.classes,
            },
            created_at: instant(v.created_at)?,
            expires_at: v.expires_at.map(instant).transpose()?,
        })
    }
}

impl Store {
    /// Keeps a new API key. It is durable when this returns.
    ///
    /// # Errors
    /// [`StoreError::KeyNameTaken`]; [`StoreError::TooManyKeys`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn create_key(&self, key: ApiKey) -> Result<(), StoreError> {
        let mut writer = self.inner.writer();
        let known = self.api_keys()?;
        if let Some(other) = known.iter().find(|k| k.name == key.name) {
            return Err(StoreError::KeyNameTaken {
                name: key.name,
                id: other.id,
            });
        }
        if known.len() >= MAX_KEYS {
            return Err(StoreError::TooManyKeys { limit: MAX_KEYS });
        }
        self.happen(&mut writer, &Event::KeyCreated { key })
    }

    /// All API keys, in the order they were made.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn api_keys(&self) -> Result<Vec<ApiKey>, StoreError> {
        self.inner
            .backend
            .scan(keys::API_KEY, None, usize::MAX)?
            .iter()
            .map(|(key, value)| record::unseal(key, value))
            .collect()
    }

    /// Forgets an API key for good.
    ///
    /// # Errors
    /// [`StoreError::NoKey`]; [`StoreError::ReadOnly`]; the write's failure.
    pub fn revoke_key(&self, id: KeyId) -> Result<(), StoreError> {
        let mut writer = self.inner.writer();
        if self.inner.backend.get(&keys::api_key(id))?.is_none() {
            return Err(StoreError::NoKey { id });
        }
        let mut more = Batch::default();
        for (used, _) in self.inner.backend.scan(&keys::used_by(id), None, usize::MAX)? {
            more.delete(used);
        }
        self.inner.record(&mut writer, &Event::KeyRevoked { id }, more)
    }
}
