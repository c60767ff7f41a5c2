//! The request's span, in the log and in traces, and the log line of its end.

use super::identify::RequestId;
use super::problems::Outcome;
use crate::http::access::Access;
use crate::http::operation::Matched;
use crate::http::stopwatch::milliseconds;
use crate::http::trace_context::{self, trace_parent};
use axum::extract::Request;
use axum::middleware::Next;
use axum::response::Response;
use std::time::Instant;
use tracing::field::Empty;
use tracing::{Instrument, Span};

/// Runs the request in a span of its own, a child of its caller's where that is told.
pub async fn trace(request: Request, next: Next) -> Response {
    let began = Instant::now();
    let matched = Matched::of(&request);
    let span = span(&request, &matched);
    let mut response = next.run(request).instrument(span.clone()).await;
    let outcome = response.extensions_mut().remove::<Outcome>().unwrap_or_default();
    let status = response.status();
    trace_context::end(&span, status, outcome.0);
    let (status, milliseconds) = (status.as_u16(), milliseconds(began.elapsed()));
    span.in_scope(|| {
        if matched.access() == Access::Probe || matched.is_metrics() {
            tracing::debug!(status, milliseconds, "answered");
        } else {
            tracing::info!(status, milliseconds, "answered");
        }
    });
    response
}

fn span(request: &Request, matched: &Matched) -> Span {
    let id = request
        .extensions()
        .get::<RequestId>()
        .cloned()
        .unwrap_or_default();
    let operation = matched.name();
    let span = tracing::info_span!(
        "request", request_id = %id.0, operation, method = %request.method(), path = request.uri().path(), key = Empty,
        trace_id = Empty, parent_span = Empty, otel.name = Empty, otel.kind = Empty
    );
    let parent = trace_parent(request.headers());
    if let Some(parent) = parent {
        span.record("trace_id", parent.trace);
        span.record("parent_span", parent.span);
    }
    trace_context::begin(&span, parent, operation);
    span
}
