//! The API keys in force, in memory: every request is compared with all of them, each in constant time.

use crate::model::{ApiKey, KeyHash};
use arc_swap::ArcSwap;
use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use rand::TryRngCore;
use rand::rand_core::OsError;
use rand::rngs::OsRng;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use subtle::{Choice, ConditionallySelectable, ConstantTimeEq};

/// Random bytes in a secret.
const SECRET_BYTES: usize = 32;

/// The keys a service knows.
pub struct Keyring {
    keys: ArcSwap<Vec<Arc<ApiKey>>>,
    /// Once a key has been seen, requests need one until the process ends: revoking the last key must not open the
    /// doors.
    seen: AtomicBool,
}

impl Keyring {
    /// A ring of these keys.
    pub fn new(keys: Vec<ApiKey>) -> Self {
        let ring = Self {
            keys: ArcSwap::default(),
            seen: AtomicBool::new(false),
        };
        ring.replace(keys);
        ring
    }

    /// Puts these keys in force, in place of those before.
    pub fn replace(&self, keys: Vec<ApiKey>) {
        if !keys.is_empty() {
            self.seen.store(true, Ordering::SeqCst);
        }
        self.keys
            .store(Arc::new(keys.into_iter().map(Arc::new).collect()));
    }

    /// Whether any key is or was in force.
    pub fn has_seen_a_key(&self) -> bool {
        self.seen.load(Ordering::SeqCst)
    }

    /// Keys in force, also expired ones.
    pub fn len(&self) -> usize {
        self.keys.load().len()
    }

    /// Whether no key is in force.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The key of a secret. Looks at every key and every byte, so that the time taken tells nothing about which came
    /// close.
    pub fn find(&self, secret: &str) -> Option<Arc<ApiKey>> {
        let keys = self.keys.load();
        let wanted = KeyHash::of(secret).to_bytes();
        let (mut found, mut at) = (Choice::from(0), 0_u64);
        for (i, key) in (0_u64..).zip(keys.iter()) {
            let same = key.hash.to_bytes().ct_eq(&wanted);
            at = u64::conditional_select(&at, &i, same);
            found |= same;
        }
        bool::from(found)
            .then(|| usize::try_from(at).ok().and_then(|at| keys.get(at).cloned()))
            .flatten()
    }
}

/// A new secret: a prefix and 256 random bits of the operating system, 43 characters.
///
/// # Errors
/// Where the system has no randomness.
pub fn new_secret(prefix: &str) -> Result<String, OsError> {
    let mut bytes = [0; SECRET_BYTES];
    OsRng.try_fill_bytes(&mut bytes)?;
    Ok(format!("{prefix}{}", URL_SAFE_NO_PAD.encode(bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::key::SECRET_PREFIX;
    use crate::model::{KeyId, KeyLimits, KeyName, Scope};

    fn key(name: &str, secret: &str) -> ApiKey {
        ApiKey {
            id: KeyId::new(),
            name: KeyName::new(name).unwrap(),
            scope: Scope::Read,
            hash: KeyHash::of(secret),
            limits: KeyLimits::default(),
            created_at: jiff::Timestamp::UNIX_EPOCH,
            expires_at: None,
        }
    }

    #[test]
    fn secrets_are_long_and_differ() {
        let (a, b) = (
            new_secret(SECRET_PREFIX).unwrap(),
            new_secret(SECRET_PREFIX).unwrap(),
        );
        assert_eq!((a.len(), &a[..4]), (47, "slx_"));
        assert_ne!(a, b);
    }

    #[test]
    fn a_secret_opens_its_own_key_only() {
        let ring = Keyring::new(vec![key("a", "slx_1"), key("b", "slx_2"), key("c", "slx_3")]);
        for (name, secret) in [("a", "slx_1"), ("b", "slx_2"), ("c", "slx_3")] {
            assert_eq!(ring.find(secret).unwrap().name.as_str(), name);
        }
        for wrong in ["", "slx_", "slx_4", "slx_11", "SLX_1"] {
            assert!(ring.find(wrong).is_none(), "{wrong}");
        }
        ring.replace(Vec::new());
        assert!(ring.find("slx_1").is_none() && ring.has_seen_a_key());
    }
}
