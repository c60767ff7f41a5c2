//! Snapshots: made, listed, downloaded, restored.

use super::classes::insert;
use crate::http::AppState;
use crate::http::access::Access;
use crate::http::body::{body_too_large, broke_off, too_late};
use crate::http::dto::snapshot::{RestoredDto, SnapshotDto};
use crate::http::dto::{Binary, Page, PageQuery};
use crate::http::extract::{ApiPath, ApiQuery, media_type};
use crate::http::problem::{Code, Problem};
use crate::http::problem_sets::{PAGE, RESTORE, WRITE};
use crate::http::request_memory::file_body;
use crate::http::route::Route;
use crate::http::state::Parts;
use crate::jobs::JobError;
use crate::model::Scope;
use crate::model::{Restored, SnapshotId, SnapshotOrigin};
use crate::store::StoreError;
use crate::store::snapshot::Staged;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use shapelex_core::memory::Reservation;
use std::io::Seek;
use std::sync::PoisonError;
use std::time::Duration;
use tokio::io::AsyncWriteExt;
use tokio::time::Instant;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    use Code::*;
    vec![
        Route::new(
            routes!(create_snapshot),
            Access::Needs(Scope::Admin),
            &[WRITE, &[SnapshotRunning]],
        ),
        Route::new(routes!(list_snapshots), Access::Needs(Scope::Admin), &[PAGE]),
        Route::new(
            routes!(get_snapshot),
            Access::Needs(Scope::Admin),
            &[&[SnapshotNotFound]],
        ),
        Route::new(
            routes!(delete_snapshot),
            Access::Needs(Scope::Admin),
            &[&[SnapshotNotFound]],
        ),
        Route::new(
            routes!(get_snapshot_file),
            Access::Needs(Scope::Admin),
            &[&[SnapshotNotFound]],
        ),
        Route::new(
            routes!(restore_snapshot),
            Access::Owner,
            &[WRITE, RESTORE, &[SnapshotNotFound]],
        ),
        Route::new(
            routes!(restore_upload),
            Access::Owner,
            &[
                WRITE,
                RESTORE,
                &[
                    EmptyBody,
                    InvalidRequest,
                    RequestTimeout,
                    BodyTooLarge,
                    UnsupportedMediaType,
                ],
            ],
        ),
    ]
}

/// Bytes of a snapshot that must arrive in a second, on average, once the time that any body may take is over.
const SLOWEST: u64 = 1 << 20;

/// Make a snapshot
///
/// Everything the service holds at this moment, as one file: classes, shapes with their files, the index. Requests go
/// on meanwhile. The answer comes when the file is on the disk; where the client leaves earlier, it is made all the
/// same and listed then.
#[utoipa::path(
    post, path = "/v1/snapshots", tag = "operation",
    responses((status = 201, description = "The snapshot", body = SnapshotDto, headers(
        ("location" = String, description = "Where the snapshot is"),
    )))
)]
pub async fn create_snapshot(State(state): State<AppState>) -> Result<Response, Problem> {
    let snapshot = state
        .blocking(|s| Ok(s.store.create_snapshot(SnapshotOrigin::Requested)?))
        .await?;
    let location = format!("/v1/snapshots/{}", snapshot.id);
    let mut response = (StatusCode::CREATED, Json(SnapshotDto::from(snapshot))).into_response();
    insert(&mut response, header::LOCATION, &location);
    Ok(response)
}

/// List snapshots
///
/// In the order they were made.
#[utoipa::path(
    get, path = "/v1/snapshots", tag = "operation", params(PageQuery),
    responses((status = 200, description = "A page of snapshots", body = Page<SnapshotDto>))
)]
pub async fn list_snapshots(
    State(state): State<AppState>,
    ApiQuery(page): ApiQuery<PageQuery>,
) -> Result<Json<Page<SnapshotDto>>, Problem> {
    let (limit, after) = (page.limit()?, page.after::<SnapshotId>("snapshots")?);
    let found = state
        .blocking(move |s| Ok(s.store.list_snapshots(after, limit + 1)?))
        .await?;
    Ok(Json(Page::cut(
        "snapshots",
        found,
        limit,
        |s| s.id.to_string(),
        Into::into,
    )))
}

/// Show a snapshot
#[utoipa::path(
    get, path = "/v1/snapshots/{snapshot}", tag = "operation",
    params(("snapshot" = String, Path, description = "The snapshot's id")),
    responses((status = 200, description = "The snapshot", body = SnapshotDto))
)]
pub async fn get_snapshot(
    State(state): State<AppState>,
    ApiPath(snapshot): ApiPath<String>,
) -> Result<Json<SnapshotDto>, Problem> {
    let id = parse(&snapshot)?;
    let found = state.blocking(move |s| Ok(s.store.snapshot(id)?)).await?;
    Ok(Json(found.into()))
}

/// Delete a snapshot
#[utoipa::path(
    delete, path = "/v1/snapshots/{snapshot}", tag = "operation",
    params(("snapshot" = String, Path, description = "The snapshot's id")),
    responses((status = 204, description = "It is gone"))
)]
pub async fn delete_snapshot(
    State(state): State<AppState>,
    ApiPath(snapshot): ApiPath<String>,
) -> Result<StatusCode, Problem> {
    let id = parse(&snapshot)?;
    state.blocking(move |s| Ok(s.store.delete_snapshot(id)?)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Download a snapshot
///
/// A tar archive under zstd; `docs/storage.md` says what is in it.
#[utoipa::path(
    get, path = "/v1/snapshots/{snapshot}/file", tag = "operation",
    params(("snapshot" = String, Path, description = "The snapshot's id")),
    responses((status = 200, description = "The file", body = Binary, content_type = "application/zstd", headers(
        ("etag" = String, description = "The hash of its bytes"),
    )))
)]
pub async fn get_snapshot_file(
    State(state): State<AppState>,
    ApiPath(snapshot): ApiPath<String>,
) -> Result<Response, Problem> {
    let id = parse(&snapshot)?;
    let (found, path) = state
        .blocking(move |s| Ok((s.store.snapshot(id)?, s.store.snapshot_path(id))))
        .await?;
    let file =
        tokio::fs::File::open(path)
            .await
            .map_err(|e| match StoreError::io("read a snapshot", &e) {
                busy @ StoreError::OutOfDescriptors { .. } => Problem::from(busy),
                _ => Problem::from(StoreError::NoSnapshot { id }).logged(e),
            })?;
    let mut response = file_body(file, &state.memory)?.into_response();
    insert(&mut response, header::CONTENT_LENGTH, &found.bytes.to_string());
    insert(&mut response, header::CONTENT_TYPE, "application/zstd");
    insert(&mut response, header::ETAG, &format!("\"{}\"", found.hash));
    let disposition = format!("attachment; filename=\"shapelex-{id}.tar.zst\"");
    insert(&mut response, header::CONTENT_DISPOSITION, &disposition);
    Ok(response)
}

/// Restore a snapshot that is here
///
/// Checks it first, then switches: afterwards the service holds what the snapshot holds, and nothing that came later.
/// No job may wait or run.
#[utoipa::path(
    post, path = "/v1/snapshots/{snapshot}/restore", tag = "operation",
    params(("snapshot" = String, Path, description = "The snapshot's id")),
    responses((status = 200, description = "What there is now", body = RestoredDto))
)]
pub async fn restore_snapshot(
    State(state): State<AppState>,
    ApiPath(snapshot): ApiPath<String>,
) -> Result<Json<RestoredDto>, Problem> {
    let id = parse(&snapshot)?;
    refuse_busy(&state)?;
    let restored = state
        .blocking(move |s| {
            let _memory = reserve(s)?;
            take_over(s, s.store.stage_own_snapshot(id, s.config.snapshot_max_bytes)?)
        })
        .await?;
    Ok(Json(restored.into()))
}

/// Restore a snapshot that is sent
///
/// As above, with the snapshot's file as the body.
#[utoipa::path(
    post, path = "/v1/snapshots/restore", tag = "operation",
    request_body(description = "A snapshot's file", content(
        (Binary = "application/zstd"),
        (Binary = "application/octet-stream"),
    )),
    responses((status = 200, description = "What there is now", body = RestoredDto))
)]
pub async fn restore_upload(
    State(state): State<AppState>,
    request: Request,
) -> Result<Json<RestoredDto>, Problem> {
    require_snapshot_type(request.headers())?;
    refuse_busy(&state)?;
    let limit = state.config.snapshot_max_bytes;
    let archive = receive(&state, request, limit).await?;
    let restored = state
        .blocking(move |s| {
            let _memory = reserve(s)?;
            take_over(s, s.store.stage_snapshot(archive, limit)?)
        })
        .await?;
    Ok(Json(restored.into()))
}

/// A form of a web page can send the types of forms and plain text, and no type; a snapshot comes as none of these.
fn require_snapshot_type(headers: &HeaderMap) -> Result<(), Problem> {
    let declared = media_type(headers);
    let accepted = ["application/zstd", "application/octet-stream"];
    if declared
        .as_deref()
        .is_some_and(|declared| accepted.contains(&declared))
    {
        return Ok(());
    }
    let found = declared.map_or_else(
        || "no content type".to_owned(),
        |declared| format!("'{declared}'"),
    );
    Err(Problem::new(
        Code::UnsupportedMediaType,
        format!("{found} is not read here; send application/zstd"),
    ))
}

/// What unpacking a snapshot takes at most, in bytes: zstd looks back over up to 128 MiB, and records are read whole.
const UNPACKING: u64 = 160 << 20;

/// Memory for a restore, or all there is of it where that is less.
fn reserve(parts: &Parts) -> Result<Reservation, Problem> {
    let memory = parts.memory.reservation();
    memory.grow(UNPACKING.min(parts.memory.limit()))?;
    Ok(memory)
}

/// Switches with nobody else at the catalogue and no job in the way.
fn take_over(parts: &Parts, staged: Staged<'_>) -> Result<Restored, Problem> {
    let _alone = parts.catalogue.lock().unwrap_or_else(PoisonError::into_inner);
    let restored = parts.jobs.exclusively(|| staged.switch())?;
    parts.keys.replace(parts.store.api_keys()?);
    tracing::info!(snapshot = %restored.id, classes = restored.classes, shapes = restored.shapes, "restored");
    Ok(restored)
}

/// Before anything is received: a restore that would be refused in the end.
fn refuse_busy(state: &AppState) -> Result<(), Problem> {
    match state.jobs.queue_depth() {
        0 => Ok(()),
        jobs => Err(JobError::Unfinished { jobs }.into()),
    }
}

/// Receives the body into a file that goes by itself.
async fn receive(state: &AppState, request: Request, limit: u64) -> Result<std::fs::File, Problem> {
    let too_long = || body_too_large(usize::try_from(limit).unwrap_or(usize::MAX));
    let fail = |e: std::io::Error| Problem::from(StoreError::io("receive a snapshot", &e));
    let directory = state.config.data_dir.clone();
    let file = state
        .blocking(move |_| {
            tempfile::tempfile_in(&directory).map_err(|e| {
                let what = format!("receive a snapshot into {}", directory.display());
                Problem::from(StoreError::io(what, &e))
            })
        })
        .await?;
    let mut file = tokio::fs::File::from_std(file);
    let mut stream = request.into_body().into_data_stream();
    let mut received = 0_u64;
    let began = Instant::now();
    loop {
        // A snapshot may be larger than what arrives within the time limit of other bodies, not slower.
        let time = state.config.upload_timeout + Duration::from_secs(received / SLOWEST);
        let piece = tokio::time::timeout_at(began + time, stream.next())
            .await
            .map_err(|_| too_late(time))?;
        let Some(piece) = piece else { break };
        let piece = piece.map_err(broke_off)?;
        received += piece.len() as u64;
        if received > limit {
            return Err(too_long());
        }
        file.write_all(&piece).await.map_err(fail)?;
    }
    file.flush().await.map_err(fail)?;
    if received == 0 {
        return Err(Problem::new(
            Code::EmptyBody,
            "send a snapshot's file as the body",
        ));
    }
    let mut file = file.into_std().await;
    file.rewind().map_err(fail)?;
    Ok(file)
}

fn parse(text: &str) -> Result<SnapshotId, Problem> {
    text.parse().map_err(|_| {
        let shown: String = text.chars().take(100).collect();
        Problem::new(Code::SnapshotNotFound, format!("there is no snapshot '{shown}'"))
            .with("snapshot", shown)
    })
}
