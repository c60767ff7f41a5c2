//! Queries: one mesh, or many as a stream.

use crate::http::AppState;
use crate::http::admission::Patience;
use crate::http::answer::answer;
use crate::http::auth::Caller;
use crate::http::dto::query::{BatchLine, BatchSummary, QueryAnswer, QueryOptions};
use crate::http::dto::{Binary, FilesForm};
use crate::http::extract::ApiQuery;
use crate::http::limits::Allowance;
use crate::http::problem::{Code, Problem};
use crate::http::problem_from::index_empty;
use crate::http::time_limit::TimeLimit;
use crate::http::upload::{self, Upload};
use crate::http::uploaded::UploadedMesh;
use crate::http::{metrics, respond};
use crate::jobs::LiveIndex;
use axum::Json;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures_util::{StreamExt, stream};
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

/// Query with a mesh
///
/// Ranks all classes by how well each regenerates the mesh's signatures. The mesh is the body, or the one mesh of a
/// `multipart/form-data` with its buffers, or of an archive.
#[utoipa::path(
    post, path = "/v1/query", tag = "query", params(QueryOptions),
    request_body(description = "One mesh", content(
        (Binary = "application/octet-stream"),
        (Binary = "model/obj"),
        (Binary = "model/gltf+json"),
        (Binary = "model/gltf-binary"),
        (Binary = "model/stl"),
        (Binary = "model/ply"),
        (Binary = "model/off"),
        (Binary = "application/zip"),
        (Binary = "application/x-tar"),
        (Binary = "application/gzip"),
        (FilesForm = "multipart/form-data"),
    )),
    responses((status = 200, description = "The ranking", body = QueryAnswer))
)]
pub async fn query_mesh(
    State(state): State<AppState>,
    ApiQuery(options): ApiQuery<QueryOptions>,
    caller: Caller,
    request: Request,
) -> Result<Response, Problem> {
    let (live, upload, left) = begin(&state, &caller, &options, request).await?;
    let mesh = upload::only_mesh(upload)?;
    let answer = rank(&state, Patience::Bounded, live, mesh, options).await?;
    let mut response = Json(answer).into_response();
    if let Some(left) = left {
        left.tell(&mut response);
    }
    Ok(response)
}

/// Query with many meshes
///
/// Answers a line of JSON per mesh, in the order they are finished, and a last line with the counts. A mesh that could
/// not be answered has `"status": "failed"` and its problem; that is never the same as an answer without a match. A
/// stream without the last line was cut short.
#[utoipa::path(
    post, path = "/v1/query/batch", tag = "query", params(QueryOptions),
    request_body(description = "Meshes", content(
        (FilesForm = "multipart/form-data"),
        (Binary = "application/zip"),
        (Binary = "application/x-tar"),
        (Binary = "application/gzip"),
        (Binary = "application/octet-stream"),
    )),
    responses((status = 200, description = "Lines of JSON", body = BatchLine, content_type = "application/x-ndjson"))
)]
pub async fn query_batch(
    State(state): State<AppState>,
    ApiQuery(options): ApiQuery<QueryOptions>,
    caller: Caller,
    request: Request,
) -> Result<Response, Problem> {
    let id = respond::id_of(&request);
    let (live, upload, mut left) = begin(&state, &caller, &options, request).await?;
    let total = upload.meshes.len();
    if total > 1 {
        left = state.limits.take_queries(&caller, total - 1)?;
    }
    let threads = state.config.query_threads.max(1);
    let stopping = state.stopping.clone();
    let lines = stream::iter(upload.meshes.into_iter().enumerate())
        .map(move |(index, mesh)| {
            let (state, live, options) = (state.clone(), live.clone(), options.clone());
            async move {
                let name = mesh.name.clone();
                let answer = rank(&state, Patience::Batch, live, mesh, options).await;
                (index, name, answer)
            }
        })
        .buffer_unordered(threads)
        .take_until(stopping.cancelled_owned());
    let body = stream::unfold(
        (Box::pin(lines), BatchSummary::default(), false),
        move |(mut lines, mut summary, ended)| {
            let id = id.clone();
            async move {
                if ended {
                    return None;
                }
                let line = match lines.next().await {
                    Some((index, _, Ok(answer))) => {
                        summary.ok += 1;
                        BatchLine::Answered {
                            status: "ok",
                            index,
                            answer: Box::new(answer),
                        }
                    }
                    Some((index, name, Err(problem))) => {
                        summary.failed += 1;
                        metrics::count_problem(problem.code);
                        if let Some(internal) = &problem.internal {
                            tracing::error!(code = problem.code.name(), internal, name, "{}", problem.detail);
                        }
                        BatchLine::Failed {
                            status: "failed",
                            index,
                            name,
                            problem: problem.to_json(id.as_deref()),
                        }
                    }
                    // Cut short by a shutdown: no last line, so that nobody takes it for the whole.
                    None if summary.ok + summary.failed < total => return None,
                    None => {
                        summary.total = total;
                        return Some((line_of(&BatchLine::Summary { summary }), (lines, summary, true)));
                    }
                };
                Some((line_of(&line), (lines, summary, false)))
            }
        },
    );
    let kind = [(header::CONTENT_TYPE, "application/x-ndjson")];
    let mut response = (kind, Body::from_stream(body)).into_response();
    if let Some(left) = left {
        left.tell(&mut response);
    }
    Ok(response)
}

fn line_of(line: &BatchLine) -> Result<Bytes, Infallible> {
    // Strings, numbers and maps with string keys always serialise.
    let mut text = serde_json::to_vec(line).unwrap_or_default();
    text.push(b'\n');
    Ok(text.into())
}

/// The index the request is answered from, whatever is switched in meanwhile, what it brought, and what is left of
/// its key's queries. The first query is taken off before the body is read.
async fn begin(
    state: &AppState,
    caller: &Caller,
    options: &QueryOptions,
    request: Request,
) -> Result<(Arc<LiveIndex>, Upload, Option<Allowance>), Problem> {
    for (name, value) in [
        ("top", options.top.map(|top| top as u64)),
        ("time_limit_ms", options.time_limit_ms),
    ] {
        if value == Some(0) {
            let detail = format!("{name} must be 1 or more, got 0");
            return Err(Problem::new(Code::InvalidQuery, detail).with("name", name));
        }
    }
    let left = state.limits.take_queries(caller, 1)?;
    answerable(state)?;
    let upload = upload::receive(state, request, options.name.clone()).await?;
    // What was switched in while the body arrived.
    Ok((answerable(state)?, upload, left))
}

/// The index there is now.
fn answerable(state: &AppState) -> Result<Arc<LiveIndex>, Problem> {
    let live = state.jobs.live_index();
    state.require_index()?;
    if live.index.classes.is_empty() {
        return Err(index_empty());
    }
    Ok(live)
}

async fn rank(
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
