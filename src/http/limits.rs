//! How much one API key may do: queries per minute, classes made, bytes uploaded.
//!
//! What a key does not say itself the service's settings say; without either there is no limit. Callers without a key
//! have none: they are told apart by nothing.

use super::caller::Caller;
use super::problem::{Code, Problem};
use crate::model::{KeyId, KeyLimits};
use crate::store::{self, Maker, Store, StoreError};
use axum::http::{HeaderName, HeaderValue};
use axum::response::Response;
use governor::clock::{Clock, DefaultClock};
use governor::middleware::StateInformationMiddleware;
use governor::state::{InMemoryState, NotKeyed};
use governor::{Quota, RateLimiter};
use std::collections::HashMap;
use std::num::NonZeroU32;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

type Limiter = RateLimiter<NotKeyed, InMemoryState, DefaultClock, StateInformationMiddleware>;

/// The service's limits for keys that do not say otherwise, and how far each key has used its own.
#[derive(Default)]
pub struct Limits {
    defaults: KeyLimits,
    queries: Mutex<HashMap<KeyId, (u32, Arc<Limiter>)>>,
}

/// What is left of a rate limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Allowance {
    /// Queries per minute.
    pub limit: u32,
    /// Queries that would be answered at once.
    pub remaining: u32,
    /// Seconds until all of them would be again.
    pub reset: u64,
}

impl Limits {
    /// Nothing used yet.
    pub fn new(defaults: KeyLimits) -> Self {
        Self {
            defaults,
            queries: Mutex::default(),
        }
    }

    /// Takes `meshes` queries off what a key has left. `None` where it has no limit.
    ///
    /// # Errors
    /// `rate_limited`, with the seconds after which they would be granted.
    pub fn take_queries(&self, caller: &Caller, meshes: usize) -> Result<Option<Allowance>, Problem> {
        let Some(key) = &caller.key else { return Ok(None) };
        let per_minute = key.limits.queries_per_minute.or(self.defaults.queries_per_minute);
        let (Some(limit), Some(meshes)) = (
            per_minute.and_then(NonZeroU32::new),
            NonZeroU32::new(u32::try_from(meshes).unwrap_or(u32::MAX)),
        ) else {
            return Ok(None);
        };
        let limiter = self.limiter(key.id, limit);
        let refused = |detail: String, seconds: u64| {
            Problem::new(Code::RateLimited, detail)
                .with("limit", limit.get())
                .with("retry_after_seconds", seconds.max(1))
        };
        match limiter.check_n(meshes) {
            Ok(Ok(left)) => {
                let remaining = left.remaining_burst_capacity();
                let used = u64::from(limit.get().saturating_sub(remaining));
                Ok(Some(Allowance {
                    limit: limit.get(),
                    remaining,
                    reset: (used * 60).div_ceil(u64::from(limit.get())),
                }))
            }
            Ok(Err(not_until)) => {
                let wait = not_until.wait_time_from(DefaultClock::default().now());
                let seconds = (wait + Duration::from_millis(999)).as_secs();
                Err(refused(
                    format!("key '{}' may query {limit} meshes per minute", key.name),
                    seconds,
                ))
            }
            Err(_) => Err(refused(
                format!(
                    "{meshes} meshes are more than the {limit} that key '{}' may query per minute; send fewer at a time",
                    key.name
                ),
                60,
            )),
        }
    }

    fn limiter(&self, key: KeyId, limit: NonZeroU32) -> Arc<Limiter> {
        let mut queries = self.queries.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = || {
            let limiter = RateLimiter::direct(Quota::per_minute(limit));
            Arc::new(limiter.with_middleware::<StateInformationMiddleware>())
        };
        let (known, limiter) = queries.entry(key).or_insert_with(|| (limit.get(), fresh()));
        if *known != limit.get() {
            (*known, *limiter) = (limit.get(), fresh());
        }
        Arc::clone(limiter)
    }

    /// On whose account a caller makes classes and shapes; `None` for callers without a key, who have no quota. The
    /// store holds the quota, in the same transaction as the change.
    pub fn maker(&self, caller: &Caller) -> Option<Maker> {
        let key = caller.key.as_ref()?;
        Some(Maker {
            key: key.id,
            limits: KeyLimits {
                queries_per_minute: None,
                stored_bytes: key.limits.stored_bytes.or(self.defaults.stored_bytes),
                classes: key.limits.classes.or(self.defaults.classes),
            },
        })
    }

    /// Tells a caller that may make nothing more before its body is received. The store decides, in the transaction of
    /// the change.
    ///
    /// # Errors
    /// `quota_exceeded`; what keeps the records from being read.
    pub fn require_room(&self, catalogue: &Store, caller: &Caller, more_classes: u64) -> Result<(), Problem> {
        let Some(maker) = self.maker(caller) else {
            return Ok(());
        };
        if maker.limits.classes.is_none() && maker.limits.stored_bytes.is_none() {
            return Ok(());
        }
        let used = catalogue.usage(maker.key)?;
        let checks = [
            (
                store::Quota::Classes,
                maker.limits.classes,
                used.classes,
                more_classes,
            ),
            (
                store::Quota::StoredBytes,
                maker.limits.stored_bytes,
                used.bytes,
                1,
            ),
        ];
        for (quota, limit, used, more) in checks {
            if let Some(limit) = limit
                && more > 0
                && used.saturating_add(more) > limit
            {
                return Err(StoreError::QuotaExceeded {
                    quota,
                    limit,
                    used,
                    more,
                }
                .into());
            }
        }
        Ok(())
    }
}

impl Allowance {
    /// Says so in the response's headers.
    pub fn tell(self, response: &mut Response) {
        let values = [
            ("ratelimit-limit", u64::from(self.limit)),
            ("ratelimit-remaining", u64::from(self.remaining)),
            ("ratelimit-reset", self.reset),
        ];
        for (name, value) in values {
            response
                .headers_mut()
                .insert(HeaderName::from_static(name), HeaderValue::from(value));
        }
    }
}
