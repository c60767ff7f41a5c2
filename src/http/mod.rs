//! The HTTP service: requests → jobs, store, pipeline, and nothing computed here.
//!
//! [`router::router`] has every route on one screen; a handler's name is its operation's id in `openapi.yaml`, which
//! [`openapi`] makes out of the handlers. Every answer that is not a success is a [`problem::Problem`].

pub mod admission;
pub mod answer;
pub mod archive;
mod archive_path;
pub mod arriving;
pub mod audit;
pub mod auth;
mod batch;
mod body;
mod checked;
mod compression;
pub mod config;
mod connection;
pub mod connections;
mod dataset;
pub mod dto;
pub mod extract;
pub mod host;
mod housekeeping;
pub mod keyring;
pub mod limits;
mod linger;
pub mod local_access;
pub mod metrics;
mod multipart;
pub mod openapi;
mod origin;
mod poses;
pub mod problem;
mod problem_from;
mod query_string;
mod ranked;
mod recovery_mode;
mod request_memory;
pub mod respond;
pub mod router;
mod routes;
mod scrubber;
pub mod serve;
pub mod state;
mod stored;
mod stream;
mod time_limit;
mod tls;
mod trace_context;
pub mod upload;
pub mod uploaded;

pub use config::ServiceConfig;
pub use router::router;
pub use serve::{announce, serve};
pub use state::{AppState, OpenError};
pub use tls::check_tls;
