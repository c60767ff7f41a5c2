//! What the service knows about its operations beside their handlers.

use super::access::Access;
use super::problem::Code;
use crate::model::Scope;
use axum::extract::Request;
use axum::http::Method;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is known about an operation beside its handler.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RouteInfo {
    /// The operation's id: the handler's name.
    pub operation: String,
    /// Its method.
    pub method: Method,
    /// Its address, with `{parameters}`.
    pub path: String,
    /// What it demands of its caller.
    pub access: Access,
    /// The problems of its own that it can answer with.
    pub problems: Vec<Code>,
}

/// What is known of all operations, by address.
#[derive(Clone, Debug, Default)]
pub struct Operations(BTreeMap<String, Vec<Arc<RouteInfo>>>);

impl Operations {
    /// A table of these.
    pub fn new(infos: impl IntoIterator<Item = RouteInfo>) -> Self {
        let mut table: BTreeMap<String, Vec<Arc<RouteInfo>>> = BTreeMap::new();
        for info in infos {
            table.entry(info.path.clone()).or_default().push(Arc::new(info));
        }
        Self(table)
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &RouteInfo> {
        self.0.values().flatten().map(AsRef::as_ref)
    }

    /// The methods that an address answers.
    pub fn methods_of(&self, path: &str) -> Vec<&str> {
        let of_path = self.0.get(path).into_iter().flatten();
        of_path.map(|info| info.method.as_str()).collect()
    }

    /// What a request asks for, by its method and the address that matched. `HEAD` is answered by the operation of `GET`.
    pub fn matching(&self, method: &Method, path: Option<&str>) -> Matched {
        let Some(path) = path else { return Matched::Nothing };
        let method = if *method == Method::HEAD {
            &Method::GET
        } else {
            method
        };
        let mut of_path = self.0.get(path).into_iter().flatten();
        let found = of_path.find(|info| info.method == *method);
        found.map_or(Matched::AddressOnly, |info| Matched::Operation(info.clone()))
    }
}

/// What a request asks for. Among the extensions of every request.
#[derive(Clone, Debug, Default)]
pub enum Matched {
    /// No address of the service.
    #[default]
    Nothing,
    /// One of its addresses, by a method that it does not have.
    AddressOnly,
    /// An operation.
    Operation(Arc<RouteInfo>),
}

impl Matched {
    /// That of a request.
    pub fn of(request: &Request) -> Self {
        request.extensions().get::<Self>().cloned().unwrap_or_default()
    }

    /// The operation's id, for logs, metrics and the audit log.
    pub fn name(&self) -> &str {
        match self {
            Self::Operation(info) => &info.operation,
            Self::Nothing | Self::AddressOnly => UNMATCHED,
        }
    }

    /// What it demands. The answer to an unknown address tells nothing, so it demands nothing.
    pub fn access(&self) -> Access {
        match self {
            Self::Operation(info) => info.access,
            Self::AddressOnly => Access::Needs(Scope::Admin),
            Self::Nothing => Access::Public,
        }
    }

    /// Whether it may change something: it needs more than to read, and its method says so.
    pub fn changes(&self, method: &Method) -> bool {
        let writes = self.access().scope().is_some_and(|scope| scope > Scope::Read);
        writes && *method != Method::GET && *method != Method::HEAD
    }

    /// Whether it is what a monitoring system asks again and again.
    pub fn is_metrics(&self) -> bool {
        self.name() == "get_metrics"
    }
}

/// The name of requests that no operation matches.
pub const UNMATCHED: &str = "unmatched";
