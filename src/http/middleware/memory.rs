//! The memory of a request: a reservation for what it brings, and one for its answer while its client reads it.

use crate::http::operation::Matched;
use crate::http::request_memory::{self, Refusable, hold_answer};
use crate::http::state::AppState;
use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::Response;

/// Gives the request its reservation, and counts its answer.
pub async fn hold(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    let refusable = match Matched::of(&request).changes(request.method()) {
        true => Refusable::No,
        false => Refusable::Yes,
    };
    request_memory::begin(&mut request, &state.memory);
    let response = next.run(request).await;
    hold_answer(response, &state.memory, refusable)
}
