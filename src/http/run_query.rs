//! A query on the compute pool, within its time limit, with slow ones logged.

use super::admission::Patience;
use super::answer::answer;
use super::dto::query::{QueryAnswer, QueryOptions};
use super::problem::Problem;
use super::state::AppState;
use super::time_limit::TimeLimit;
use super::uploaded::UploadedMesh;
use crate::jobs::LiveIndex;
use bytes::Bytes;
use shapelex_core::memory::Reservation;
use std::sync::Arc;
use std::time::Duration;

/// An answer as it is sent, and the memory it takes until then.
pub(super) struct Rendered {
    pub(super) text: Bytes,
    pub(super) memory: Reservation,
    total_ms: f64,
    timings: String,
}

/// Runs a query once there is a thread for it, and renders the answer there: a large one would keep a thread that waits
/// for sockets from the others.
///
/// # Errors
/// Those of [`answer`] and of memory; `overloaded` and `shutting_down` where there is no thread.
pub(super) async fn run_query(
    state: &AppState,
    patience: Patience,
    live: Arc<LiveIndex>,
    mesh: UploadedMesh,
    options: QueryOptions,
    render: impl FnOnce(QueryAnswer) -> Bytes + Send + 'static,
) -> Result<Rendered, Problem> {
    let shared = state.clone();
    let name = mesh.name.clone();
    let limit = options
        .time_limit_ms
        .map(|milliseconds| TimeLimit::start(Duration::from_millis(milliseconds)));
    let view = limit.as_ref().map(TimeLimit::view);
    let answered = state
        .compute
        .run(patience, state.config.query_timeout, move |work| {
            let answer = answer(&shared, &live, &mesh, &options, view.as_ref(), work)?;
            let memory = shared.memory.reservation();
            memory.grow(answer.bytes())?;
            let total_ms = answer.timings_ms.get("total").copied().unwrap_or_default();
            let timings = serde_json::to_string(&answer.timings_ms).unwrap_or_default();
            let text = render(answer);
            memory.shrink(memory.bytes().saturating_sub(text.len() as u64));
            Ok(Rendered {
                text,
                memory,
                total_ms,
                timings,
            })
        })
        .await;
    drop(limit);
    if let (Ok(answer), Some(slow)) = (&answered, state.config.slow_query)
        && answer.total_ms >= slow.as_secs_f64() * 1e3
    {
        tracing::warn!(
            target: "shapelex::slow_query",
            name, milliseconds = answer.total_ms, timings = answer.timings, "slow query"
        );
    }
    answered
}
