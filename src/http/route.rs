//! One operation of the API. The table of all of them is [`routes::routes`](super::routes::routes); the router, the
//! OpenAPI document, access control, the metrics' labels and the audit log are derived from it.

use super::access::Access;
use super::operation::{Operations, RouteInfo};
use super::problem::Code;
use super::state::AppState;
use axum::http::Method;
use axum::routing::MethodRouter;
use utoipa::openapi::path::{Operation, PathItem, Paths};
use utoipa::openapi::{RefOr, Schema};
use utoipa_axum::router::UtoipaMethodRouter;

/// An operation with its handler and its part of the document.
pub struct Route {
    /// What is known about it.
    pub info: RouteInfo,
    pub(super) handler: MethodRouter<AppState>,
    pub(super) paths: Paths,
    pub(super) schemas: Vec<(String, RefOr<Schema>)>,
}

impl Route {
    /// A route of a handler; `utoipa_axum::routes!` reads method, address and id off the handler's attribute.
    pub(super) fn new(described: UtoipaMethodRouter<AppState>, access: Access, problems: &[&[Code]]) -> Self {
        let (schemas, mut paths, handler) = described;
        let mut found = Vec::new();
        for (path, item) in &mut paths.paths {
            for (method, operation) in operations_of(item) {
                found.push((path.clone(), method, operation.operation_id.clone()));
            }
        }
        let (path, method, operation) = found.pop().unwrap_or_default();
        Self {
            info: RouteInfo {
                operation: operation.unwrap_or_default(),
                method,
                path,
                access,
                problems: problems.concat(),
            },
            handler,
            paths,
            schemas,
        }
    }
}

/// What is known of the operations of these routes.
pub fn operations(routes: &[Route]) -> Operations {
    Operations::new(routes.iter().map(|route| route.info.clone()))
}

/// The operations of an address, by method.
pub(super) fn operations_of(item: &mut PathItem) -> impl Iterator<Item = (Method, &mut Operation)> {
    [
        (Method::GET, &mut item.get),
        (Method::POST, &mut item.post),
        (Method::PATCH, &mut item.patch),
        (Method::PUT, &mut item.put),
        (Method::DELETE, &mut item.delete),
    ]
    .into_iter()
    .filter_map(|(method, operation)| Some((method, operation.as_mut()?)))
}
