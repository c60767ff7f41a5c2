//! What happens around every handler, one concern per file. From the outside in: [`identify`], [`headers`], [`trace`],
//! [`record`], [`problems`], [`admit`], [`memory`], [`methods`].
//!
//! What one layer finds out, others read off the request's or the response's extensions: [`RequestId`],
//! [`Matched`](super::operation::Matched) and [`Caller`](super::caller::Caller) on the request, `Caller` and
//! [`Outcome`](problems::Outcome) on the response.

mod admit;
mod headers;
mod identify;
mod memory;
mod methods;
pub mod problems;
mod record;
mod trace;

pub use identify::{REQUEST_ID, RequestId};

use super::operation::Operations;
use super::state::AppState;
use axum::Router;
use axum::middleware::{from_fn, from_fn_with_state};
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;

/// Puts all layers around the routes; `operations` are those of the routes.
pub fn around(routes: Router<AppState>, state: &AppState, operations: Operations) -> Router<AppState> {
    let operations = Arc::new(operations);
    // The last layer is the outermost.
    routes
        .layer(from_fn_with_state(operations.clone(), methods::name))
        .layer(CatchPanicLayer::custom(problems::panicked))
        .layer(from_fn_with_state(state.clone(), memory::hold))
        .layer(from_fn_with_state(state.clone(), admit::admit))
        .layer(from_fn(problems::render))
        .layer(from_fn_with_state(state.clone(), record::record))
        .layer(from_fn(trace::trace))
        .layer(from_fn_with_state(state.clone(), headers::protect))
        .layer(from_fn_with_state(operations, identify::identify))
}
