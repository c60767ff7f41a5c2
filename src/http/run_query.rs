//! A query on the compute pool, within its time limit, with slow ones logged.

use super::admission::Patience;
use super::answer::answer;
use super::dto::query::{QueryAnswer, QueryOptions};
use super::problem::Problem;
use super::state::AppState;
use super::time_limit::TimeLimit;
use super::uploaded::UploadedMesh;
use crate::jobs::LiveIndex;
use std::sync::Arc;
use std::time::Duration;

/// Runs a query once there is a thread for it.
///
/// # Errors
/// Those of [`answer`]; `overloaded` and `shutting_down` where there is no thread.
pub(super) async fn run_query(
    state: &AppState,
    patience: Patience,
    live: Arc<LiveIndex>,
    mesh: UploadedMesh,
    options: QueryOptions,
) -> Result<QueryAnswer, Problem> {
    let shared = state.clone();
    let name = mesh.name.clone();
    let limit = options
        .time_limit_ms
        .map(|milliseconds| TimeLimit::start(Duration::from_millis(milliseconds)));
    let view = limit.as_ref().map(TimeLimit::view);
    let answered = state
        .compute
        .run(patience, state.config.query_timeout, move |work| {
            answer(&shared, &live, &mesh, &options, view.as_ref(), work)
        })
        .await;
    drop(limit);
    if let (Ok(answer), Some(slow)) = (&answered, state.config.slow_query) {
        let total = answer.timings_ms.get("total").copied().unwrap_or_default();
        if total >= slow.as_secs_f64() * 1e3 {
            let timings = serde_json::to_string(&answer.timings_ms).unwrap_or_default();
            tracing::warn!(target: "shapelex::slow_query", name, milliseconds = total, timings, "slow query");
        }
    }
    answered
}
