//! Queries: one mesh, or many as a stream.

use crate::http::AppState;
use crate::http::access::Access;
use crate::http::admission::Patience;
use crate::http::batch::Batch;
use crate::http::caller::Caller;
use crate::http::dto::query::{BatchLine, QueryAnswer, QueryOptions};
use crate::http::dto::{Binary, FilesForm};
use crate::http::extract::ApiQuery;
use crate::http::limits::Allowance;
use crate::http::middleware::RequestId;
use crate::http::poses::Poses;
use crate::http::problem::{Code, Problem};
use crate::http::problem_from::index_empty;
use crate::http::problem_sets::{MESH, POOL, STORED, UPLOAD};
use crate::http::route::Route;
use crate::http::run_query::run_query;
use crate::http::stored;
use crate::http::upload::{self, Upload};
use crate::jobs::LiveIndex;
use crate::model::Scope;
use axum::extract::{Request, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use std::sync::Arc;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    use Code::*;
    vec![
        Route::new(
            routes!(query_mesh),
            Access::Needs(Scope::Read),
            &[
                UPLOAD,
                MESH,
                POOL,
                &[
                    OneMeshExpected,
                    IndexEmpty,
                    IndexIncomplete,
                    RecoveryMode,
                    RateLimited,
                    NoAnimation,
                ],
                STORED,
            ],
        ),
        Route::new(
            routes!(query_batch),
            Access::Needs(Scope::Read),
            &[
                UPLOAD,
                STORED,
                &[IndexEmpty, RecoveryMode, RateLimited, OneMeshExpected],
            ],
        ),
    ]
}

/// Query with a mesh
///
/// Ranks all classes by how well each regenerates the mesh's signatures. The mesh is the body, or the one mesh of a
/// `multipart/form-data` with its buffers, or of an archive; with `shape` it is a stored shape, and the request has no
/// body. With `poses` and `pose` it is a pose of an animated glTF.
#[utoipa::path(
    post, path = "/v1/query", tag = "query", params(QueryOptions),
    request_body(description = "One mesh; nothing where `shape` names one", content(
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
    let poses = poses_of(&state, &options)?;
    let (live, upload, left) = begin(&state, &caller, &options, request).await?;
    let mesh = poses.only(upload::only_mesh(upload)?)?;
    let rendered = run_query(&state, Patience::Bounded, live, mesh, options, |answer| {
        text_of(&answer)
    })
    .await?;
    let kind = [(header::CONTENT_TYPE, "application/json")];
    // Counted anew until the client has read it.
    drop(rendered.memory);
    let mut response = (kind, rendered.text).into_response();
    if let Some(left) = left {
        left.tell(&mut response);
    }
    Ok(response)
}

/// Query with many meshes
///
/// Answers a line of JSON per mesh, in the order they are finished, and a last line with the counts. A mesh that could
/// not be answered has `"status": "failed"` and its problem; that is never the same as an answer without a match. A
/// stream without the last line was cut short. With `poses` there is a line per pose of each mesh; `index` is the
/// mesh's, `pose` tells them apart.
#[utoipa::path(
    post, path = "/v1/query/batch", tag = "query", params(QueryOptions),
    request_body(description = "Meshes; nothing where `shape` names one", content(
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
    let id = request.extensions().get::<RequestId>().map(|id| id.0.clone());
    let poses = poses_of(&state, &options)?;
    let (live, upload, mut left) = begin(&state, &caller, &options, request).await?;
    let total = upload.meshes.len() * poses.per_file();
    if total > 1 {
        left = state.limits.take_queries(&caller, total - 1)?;
    }
    let batch = Batch {
        state,
        live,
        options,
        poses,
        id,
    };
    let kind = [(header::CONTENT_TYPE, "application/x-ndjson")];
    let mut response = (kind, batch.body(upload.meshes)).into_response();
    if let Some(left) = left {
        left.tell(&mut response);
    }
    Ok(response)
}

fn poses_of(state: &AppState, options: &QueryOptions) -> Result<Poses, Problem> {
    Poses::new(options.poses, options.pose, &state.config.limits)
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
    let upload = match &options.shape {
        Some(named) => {
            let mesh = stored::receive(state, request, named.clone(), options.name.clone()).await?;
            Upload {
                meshes: vec![mesh],
                ignored: Vec::new(),
            }
        }
        None => upload::receive(state, request, options.name.clone()).await?,
    };
    // What was switched in while the body arrived.
    Ok((answerable(state)?, upload, left))
}

/// The index there is now.
fn answerable(state: &AppState) -> Result<Arc<LiveIndex>, Problem> {
    let live = state.jobs.live_index();
    state.require_index()?;
    if live.search.dictionaries.classes.is_empty() {
        return Err(index_empty());
    }
    Ok(live)
}

fn text_of(answer: &QueryAnswer) -> Bytes {
    // Strings, numbers and maps with string keys always serialise.
    serde_json::to_vec(answer).unwrap_or_default().into()
}
