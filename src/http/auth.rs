//! Who asks, and whether they may: API keys and their scopes.

use super::access::Access;
use super::caller::Caller;
use super::config::ServiceConfig;
use super::problem::{Code, Problem};
use super::state::Parts;
use crate::model::ApiKey;
use axum::http::{HeaderMap, HeaderName, header};
use jiff::Timestamp;
use std::sync::Arc;

/// The other header a key may come in.
pub const API_KEY: HeaderName = HeaderName::from_static("x-api-key");

/// Whether requests need a key: there is one, there was one since the start, or the address is not loopback and
/// nobody allowed anonymous callers.
pub fn keys_are_on(parts: &Parts) -> bool {
    needs_a_key_to_start(&parts.config) || (parts.config.check_keys && parts.keys.has_seen_a_key())
}

/// Whether a service with these settings serves nobody without a key.
pub fn needs_a_key_to_start(config: &ServiceConfig) -> bool {
    config.check_keys && !config.listen.ip().is_loopback() && !config.allow_anonymous
}

/// Finds out who asks, and whether they may ask for the operation: `unauthorized` or `insufficient_scope` where they may not.
pub fn authorize(parts: &Parts, headers: &HeaderMap, access: Access) -> (Caller, Result<(), Problem>) {
    let Some(scope) = access.scope() else {
        return (Caller::default(), Ok(()));
    };
    if !keys_are_on(parts) {
        let allowed = !parts.config.check_keys
            || access != Access::Owner
            || presented(headers).is_some_and(|token| parts.local_token.is(token));
        let refused = || Err(Problem::new(Code::Unauthorized, NEEDS_TOKEN));
        return (Caller::default(), if allowed { Ok(()) } else { refused() });
    }
    let key = match identify(parts, headers) {
        Ok(key) => key,
        Err(detail) => return (Caller::default(), Err(Problem::new(Code::Unauthorized, detail))),
    };
    let (has, needs) = (key.scope, scope.name());
    let detail = format!(
        "this needs a key of scope '{needs}', '{}' has '{}'",
        key.name,
        has.name()
    );
    let caller = Caller { key: Some(key) };
    if has >= scope {
        return (caller, Ok(()));
    }
    let problem = Problem::new(Code::InsufficientScope, detail)
        .with("scope", has.name())
        .with("needed", needs);
    (caller, Err(problem))
}

const NEEDS_TOKEN: &str = "there is no API key yet, so this needs the token in the file local-access.json of the data \
directory; `shapelex keys` and `shapelex snapshot` send it by themselves where --data names that directory";

fn identify(parts: &Parts, headers: &HeaderMap) -> Result<Arc<ApiKey>, &'static str> {
    let secret = presented(headers).ok_or(
        "send an API key, as 'Authorization: Bearer slx_…' or 'X-API-Key: slx_…'; `shapelex keys create` makes one",
    )?;
    if parts.local_token.is(secret) {
        return Err("there is an API key, so the local token opens nothing; send a key of scope 'admin'");
    }
    let key = parts
        .keys
        .find(secret)
        .ok_or("the API key is not one of this service's; it may have been revoked")?;
    if key.is_expired(Timestamp::now()) {
        return Err("the API key has expired");
    }
    Ok(key)
}

/// The secret a request brings. What is not visible ASCII is no secret.
fn presented(headers: &HeaderMap) -> Option<&str> {
    let bearer = headers.get(header::AUTHORIZATION).and_then(|value| {
        let (scheme, secret) = value.to_str().ok()?.split_once(' ')?;
        scheme.eq_ignore_ascii_case("bearer").then(|| secret.trim())
    });
    bearer.or_else(|| headers.get(API_KEY)?.to_str().ok().map(str::trim))
}
