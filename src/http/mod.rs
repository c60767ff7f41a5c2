//! The HTTP service: requests → jobs, store, pipeline, and nothing computed here.
//!
//! [`routes::routes`] is the table of routes, from which router, OpenAPI document, access control, metrics and audit log
//! are derived; a handler's name is its operation's id in `openapi.yaml`. Every answer that is not a success is a [`problem::Problem`].

pub mod access;
pub mod admission;
pub mod answer;
pub mod archive;
mod archive_path;
pub mod arriving;
pub mod audit;
pub mod auth;
mod batch;
mod body;
pub mod caller;
mod checked;
mod compression;
pub mod config;
mod connection;
pub mod connections;
mod dataset;
pub mod dto;
pub mod extract;
pub mod gauges;
pub mod host;
mod housekeeping;
pub mod keyring;
pub mod limits;
mod linger;
pub mod local_access;
pub mod metrics;
pub mod middleware;
mod multipart;
mod open;
pub mod openapi;
pub mod operation;
mod origin;
mod poses;
pub mod problem;
mod problem_from;
mod problem_sets;
mod query_string;
mod recovery_mode;
mod request_memory;
pub mod route;
pub mod router;
pub mod routes;
mod run_query;
mod scrubber;
pub mod serve;
pub mod state;
mod stopwatch;
mod stored;
mod stream;
mod time_limit;
mod tls;
mod trace_context;
pub mod upload;
pub mod uploaded;

pub use config::ServiceConfig;
pub use open::OpenError;
pub use router::router;
pub use serve::{announce, serve};
pub use state::AppState;
pub use tls::check_tls;
