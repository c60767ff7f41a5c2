//! The handlers, a file per resource, each with the lines of the route table that are its own. A handler is named
//! verb_resource, which is its operation's id too.

pub mod classes;
pub mod datasets;
pub mod docs;
pub mod health;
pub mod index;
pub mod jobs;
pub mod keys;
pub mod query;
pub mod shapes;
pub mod snapshots;

use super::route::Route;

/// Every route of the service.
pub fn routes() -> Vec<Route> {
    let resources = [
        classes::routes(),
        shapes::routes(),
        datasets::routes(),
        jobs::routes(),
        query::routes(),
        index::routes(),
        keys::routes(),
        snapshots::routes(),
        health::routes(),
        docs::routes(),
    ];
    resources.into_iter().flatten().collect()
}
