//! The handlers, a file per resource. Each is named verb_resource, which is its operation's id too.

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
