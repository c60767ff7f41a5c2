//! The metrics of a request, and the audit log's line where it may have changed something.

use super::identify::RequestId;
use super::problems::Outcome;
use crate::http::audit::{Entry, Request as Audited};
use crate::http::caller::Caller;
use crate::http::metrics;
use crate::http::operation::Matched;
use crate::http::state::AppState;
use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::Response;
use std::time::Instant;

/// Counts, times and audits the request.
pub async fn record(State(state): State<AppState>, request: Request, next: Next) -> Response {
    let began = Instant::now();
    let matched = Matched::of(&request);
    let audited = matched.changes(request.method()).then(|| {
        let id = request
            .extensions()
            .get::<RequestId>()
            .cloned()
            .unwrap_or_default();
        (id, request.uri().path().to_owned())
    });
    let response = next.run(request).await;
    let status = response.status().as_u16();
    if let Some((id, path)) = audited {
        let caller = response.extensions().get::<Caller>().cloned().unwrap_or_default();
        let outcome = response
            .extensions()
            .get::<Outcome>()
            .copied()
            .unwrap_or_default();
        let request = Audited {
            id: &id.0,
            operation: matched.name(),
            path: &path,
        };
        state
            .audit
            .write(&Entry::new(&request, &caller, status, outcome.0));
    }
    metrics::count_request(matched.name(), status, began.elapsed());
    response
}
