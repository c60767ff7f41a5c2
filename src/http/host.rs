//! By which names the service may be called.
//!
//! A page of another site can give its own name this machine's address (DNS rebinding); the browser then takes the
//! service for a part of that site and lets the page read all answers. The name stays in the request's `Host`, so a name
//! that is not the service's is refused.

use super::access::Access;
use super::auth;
use super::config::ServiceConfig;
use super::problem::{Code, Problem};
use super::state::Parts;
use axum::extract::Request;
use axum::http::uri::Authority;
use axum::http::{Version, header};
use std::net::{IpAddr, SocketAddr};

/// Among the extensions of every request that came in by a socket: whom it came from. Requests of the process itself
/// have none.
#[derive(Clone, Copy, Debug)]
pub struct Peer(pub SocketAddr);

/// Refuses a request that calls the service by a name it does not go by. Probes are answered by any name: a kubelet
/// or a load balancer asks by the address it knows.
///
/// # Errors
/// `misdirected_request`; `invalid_request` where the name is missing or given twice.
pub fn check(parts: &Parts, request: &Request, access: Access) -> Result<(), Problem> {
    if !parts.config.check_keys || access == Access::Probe {
        return Ok(());
    }
    let by_socket = request.extensions().get::<Peer>().is_some();
    let mut hosts = request.headers().get_all(header::HOST).iter();
    let first = hosts.next();
    if hosts.next().is_some() {
        return Err(Problem::new(Code::InvalidRequest, "send the header Host once"));
    }
    // HTTP/1.0 has no Host; no browser speaks it.
    if first.is_none() && by_socket && request.version() > Version::HTTP_10 {
        return Err(Problem::new(Code::InvalidRequest, "send the header Host"));
    }
    // A target that is a whole address names the service too, and a server in front may have believed either.
    if let Some(authority) = request.uri().authority() {
        require(parts, authority.as_str())?;
    }
    match first.map(|host| host.to_str()) {
        None => Ok(()),
        Some(Ok(host)) => require(parts, host),
        Some(Err(_)) => Err(misdirected("what is no name")),
    }
}

/// What the request calls the service by: host and port, as it was sent.
pub fn authority(request: &Request) -> Option<Authority> {
    let host = request.headers().get(header::HOST);
    let sent = host.and_then(|host| host.to_str().ok()?.parse().ok());
    request.uri().authority().cloned().or(sent)
}

fn require(parts: &Parts, authority: &str) -> Result<(), Problem> {
    let named = authority.parse::<Authority>().ok();
    // `user@host` is no name of a host.
    let host = named.filter(|named| !authority.contains('@') && is_host_and_port(named));
    let Some(host) = host.map(|authority| canonical(authority.host())) else {
        return Err(misdirected("what is no name"));
    };
    if goes_by(&parts.config, &host) || any_name_will_do(parts) {
        return Ok(());
    }
    let shown: String = host.chars().take(100).collect();
    Err(misdirected(&format!("'{shown}'")).with("host", shown))
}

/// Whether an authority is a host with or without a port. The parser also takes `[::1].example` and `localhost:x`.
pub fn is_host_and_port(authority: &Authority) -> bool {
    match authority.as_str().strip_prefix(authority.host()) {
        Some("") => true,
        Some(rest) => rest.strip_prefix(':').is_some_and(|port| {
            port.is_empty() || (port.bytes().all(|b| b.is_ascii_digit()) && port.parse::<u16>().is_ok())
        }),
        // `user@host`.
        None => false,
    }
}

fn misdirected(host: &str) -> Problem {
    Problem::new(
        Code::MisdirectedRequest,
        format!(
            "the service does not go by {host}; if it should, start it with --host NAME (SHAPELEX_HOST, host in the \
             file)"
        ),
    )
}

/// In lower case, without the brackets of an IPv6 address and the dot at the end of a full name.
pub fn canonical(host: &str) -> String {
    let host = host
        .strip_prefix('[')
        .and_then(|h| h.strip_suffix(']'))
        .unwrap_or(host);
    host.strip_suffix('.').unwrap_or(host).to_ascii_lowercase()
}

/// Whether a canonical name is one of the service's own: of loopback, of the address it listens on, or a configured one.
/// Where it listens on all addresses every address is its own; a page of another site cannot call it by an address,
/// because a page that was loaded from an address is a page of that machine.
pub fn goes_by(config: &ServiceConfig, host: &str) -> bool {
    if host == "localhost" || is_configured(config, host) || config.hosts.iter().any(|name| name == "*") {
        return true;
    }
    let listen = config.listen.ip().to_canonical();
    host.parse::<IpAddr>().is_ok_and(|address| {
        let address = address.to_canonical();
        address.is_loopback() || address == listen || listen.is_unspecified()
    })
}

/// Whether a canonical name is one of the configured ones.
pub fn is_configured(config: &ServiceConfig, host: &str) -> bool {
    config.hosts.iter().any(|name| canonical(name) == host)
}

/// Beyond loopback, a service that asks for keys and was told no names answers to all: a page that calls it by another
/// name has no key.
fn any_name_will_do(parts: &Parts) -> bool {
    let config = &parts.config;
    config.hosts.is_empty() && !config.listen.ip().to_canonical().is_loopback() && auth::keys_are_on(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(listen: &str, hosts: &[&str]) -> ServiceConfig {
        ServiceConfig {
            listen: listen.parse().unwrap(),
            hosts: hosts.iter().map(|&name| name.to_owned()).collect(),
            ..ServiceConfig::default()
        }
    }

    #[test]
    fn what_is_no_host_and_port_is_no_name() {
        let is_one = |text: &str| {
            text.parse::<Authority>()
                .is_ok_and(|named| is_host_and_port(&named))
        };
        for text in ["localhost", "localhost:80", "localhost:", "[::1]", "[::1]:7345"] {
            assert!(is_one(text), "{text}");
        }
        for text in [
            "[::1].evil.test",
            "[::1]evil",
            "localhost:x",
            "localhost:99999",
            "localhost:+80",
            "a@localhost",
            "",
        ] {
            assert!(!is_one(text), "{text}");
        }
    }

    #[test]
    fn names_of_loopback_of_the_address_and_of_the_settings_are_its_own() {
        let own = |config: &ServiceConfig, host: &str| goes_by(config, &canonical(host));
        let local = config("127.0.0.1:7345", &["shapes.example", "[fd00::7]"]);
        for host in [
            "localhost",
            "LocalHost.",
            "127.0.0.1",
            "127.9.9.9",
            "[::1]",
            "[::ffff:127.0.0.1]",
            "Shapes.Example",
            "shapes.example.",
            "[FD00::7]",
        ] {
            assert!(own(&local, host), "{host}");
        }
        for host in [
            "evil.test",
            "localhost.evil.test",
            "127.0.0.1.evil.test",
            "10.0.0.1",
            "0.0.0.0",
            "[::]",
            "",
            "example",
            "x.shapes.example",
            "localhost..",
            "2130706433",
        ] {
            assert!(!own(&local, host), "{host}");
        }
        let lan = config("10.0.0.5:80", &[]);
        assert!(own(&lan, "10.0.0.5") && own(&lan, "127.0.0.1") && !own(&lan, "10.0.0.6"));
        let all = config("0.0.0.0:80", &[]);
        assert!(own(&all, "10.0.0.6") && own(&all, "[fd00::1]") && !own(&all, "evil.test"));
        assert!(own(&config("127.0.0.1:1", &["*"]), "anything.test"));
    }
}
