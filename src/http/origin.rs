//! What pages of other sites may ask for: nothing that changes something or costs something, unless the settings name
//! their origin.
//!
//! A browser sends many requests to any address without asking there first. It says where they come from: in `Origin`,
//! and in `Sec-Fetch-Site`, which no page can set. Programs send neither.

use super::config::ServiceConfig;
use super::host::{authority, canonical, is_configured, is_host_and_port};
use super::problem::{Code, Problem};
use super::state::Parts;
use axum::extract::Request;
use axum::http::uri::{Authority, Scheme, Uri};
use axum::http::{HeaderMap, header};

/// Refuses a request of another site's page, unless it only reads.
///
/// # Errors
/// `cross_site_request`.
pub fn check(parts: &Parts, request: &Request) -> Result<(), Problem> {
    let config = &parts.config;
    if !config.check_keys || request.method().is_safe() {
        return Ok(());
    }
    let origins: Vec<&str> = request
        .headers()
        .get_all(header::ORIGIN)
        .iter()
        .map(|origin| origin.to_str().unwrap_or("an unreadable origin"))
        .collect();
    if is_named(config, &origins) {
        return Ok(());
    }
    let foreign = origins.iter().find(|origin| !is_own(config, request, origin));
    match foreign {
        Some(origin) => Err(refused(origin)),
        None if is_from_elsewhere(request.headers()) => Err(refused("another origin")),
        None => Ok(()),
    }
}

/// Whether the settings let the origin's pages call the API.
fn is_named(config: &ServiceConfig, origins: &[&str]) -> bool {
    let any = config.cors_origins.iter().any(|named| named == "*");
    match origins {
        [origin] => any || config.cors_origins.iter().any(|named| named == origin),
        _ => false,
    }
}

/// Whether the browser says that the request comes from another site or origin. `none` is a person at the address bar.
fn is_from_elsewhere(headers: &HeaderMap) -> bool {
    let mut said = headers.get_all("sec-fetch-site").iter();
    said.any(|site| site != "same-origin" && site != "none")
}

/// Whether an origin is the service's own: the name and port the request calls it by, or a configured name with the usual
/// port where a proxy in front calls it by another.
fn is_own(config: &ServiceConfig, request: &Request, origin: &str) -> bool {
    let Ok(origin) = origin.parse::<Uri>() else {
        return false;
    };
    let (Some(scheme), Some(from)) = (origin.scheme(), origin.authority()) else {
        return false;
    };
    let encrypted = *scheme == Scheme::HTTPS;
    let plain = *scheme == Scheme::HTTP && config.tls_cert.is_none();
    if !encrypted && !plain {
        return false;
    }
    let place = |authority: &Authority| {
        let port = authority.port_u16().unwrap_or(if encrypted { 443 } else { 80 });
        (canonical(authority.host()), port)
    };
    let called = authority(request);
    is_host_and_port(from)
        && (called.is_some_and(|called| place(&called) == place(from))
            || is_usual(from) && is_configured(config, &canonical(from.host())))
}

/// Whether an origin has the port a proxy has. What listens on another port of a configured name is another site.
fn is_usual(origin: &Authority) -> bool {
    matches!(origin.port_u16(), None | Some(80 | 443))
}

fn refused(origin: &str) -> Problem {
    let shown: String = origin.chars().take(100).collect();
    Problem::new(
        Code::CrossSiteRequest,
        format!(
            "a page of {shown} may not ask for this; if it should, start the service with --cors-origin and its origin"
        ),
    )
    .with("origin", shown)
}
