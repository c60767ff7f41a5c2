//! Training shapes: uploaded, listed, shown, deleted, downloaded.

use super::classes::{find_class, insert, is_at_hand};
use crate::http::AppState;
use crate::http::access::Access;
use crate::http::caller::Caller;
use crate::http::dto::class::ClassDto;
use crate::http::dto::shape::{ShapeDto, UploadQuery, UploadResult};
use crate::http::dto::{Binary, FilesForm, Page, PageQuery};
use crate::http::extract::{ApiPath, ApiQuery};
use crate::http::poses::check_poses;
use crate::http::problem::{Code, Problem};
use crate::http::problem_from::recovery_mode;
use crate::http::problem_sets::{MESH, PAGE, POOL, UPLOAD, WRITE};
use crate::http::request_memory::{file_body, page_memory};
use crate::http::route::Route;
use crate::http::state::Parts;
use crate::http::{checked, upload};
use crate::model::Scope;
use crate::model::{Class, ClassName, NewShape, Shape, ShapeId};
use crate::store::{AddedShape, StoreError};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::sync::PoisonError;
use tokio::io::AsyncReadExt;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    use Code::*;
    vec![
        Route::new(
            routes!(create_shapes),
            Access::Needs(Scope::Write),
            &[
                UPLOAD,
                MESH,
                POOL,
                WRITE,
                &[
                    InvalidName,
                    ClassNotFound,
                    UploadRejected,
                    NoAnimation,
                    QuotaExceeded,
                ],
            ],
        ),
        Route::new(
            routes!(list_shapes),
            Access::Needs(Scope::Read),
            &[PAGE, &[InvalidRequest, ClassNotFound]],
        ),
        Route::new(
            routes!(get_shape),
            Access::Needs(Scope::Read),
            &[&[InvalidRequest, ClassNotFound, ShapeNotFound]],
        ),
        Route::new(
            routes!(delete_shape),
            Access::Needs(Scope::Write),
            &[WRITE, &[InvalidRequest, ClassNotFound, ShapeNotFound]],
        ),
        Route::new(
            routes!(get_original),
            Access::Needs(Scope::Read),
            &[&[
                InvalidRequest,
                ClassNotFound,
                ShapeNotFound,
                OriginalMissing,
                OriginalDamaged,
                StorageDenied,
            ]],
        ),
    ]
}

/// Upload shapes
///
/// One mesh as the body, or several as `multipart/form-data`, or a zip, tar or tar.gz of them. Formats are OBJ, glTF,
/// GLB, PLY, STL and OFF, told by their bytes first. The buffers of a glTF come along in the same request. Every file
/// is read and prepared before anything is stored: where one cannot be used, nothing is stored and `failures` names
/// each. The same bytes again are the same shape.
#[utoipa::path(
    post, path = "/v1/classes/{class}/shapes", tag = "shapes",
    params(
        ("class" = String, Path, description = "The class's id or name", example = "dog"),
        UploadQuery,
    ),
    request_body(description = "One mesh, several, or an archive of them", content(
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
    responses(
        (status = 201, description = "At least one shape was added", body = UploadResult),
        (status = 200, description = "All shapes were there already", body = UploadResult),
    )
)]
pub async fn create_shapes(
    State(state): State<AppState>,
    ApiPath(class): ApiPath<String>,
    ApiQuery(query): ApiQuery<UploadQuery>,
    caller: Caller,
    request: Request,
) -> Result<Response, Problem> {
    let create = query.create.unwrap_or(false);
    check_poses(query.poses, &state.config.limits)?;
    let wanted = class.clone();
    let asking = caller.clone();
    let options = state
        .blocking(move |s| {
            if s.store.recovery_mode().is_some() {
                return Err(recovery_mode());
            }
            let more_classes = match find_class(&s.store, &wanted) {
                Err(missing) if create && missing.code == Code::ClassNotFound => {
                    ClassName::new(&wanted)?;
                    1
                }
                found => found.map(|_| 0)?,
            };
            // A caller that may add nothing at all is told so before its body is received.
            s.limits.require_room(&s.store, &asking, more_classes)?;
            Ok(s.store.parameters()?.prepare_options())
        })
        .await?;
    let upload = upload::receive(&state, request, query.name).await?;
    let shapes = checked::shapes_of(&state, upload.meshes, query.poses, options).await?;
    let shapes = shapes.into_iter().flatten().collect();
    let (class, added) = state
        .blocking(move |s| store(s, &caller, &class, create, shapes))
        .await?;
    let status = if added.iter().any(|a| a.created) {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let live = state.jobs.live_index();
    let body = UploadResult {
        class: ClassDto::new(class, live.generation.as_ref()),
        shapes: added.into_iter().map(Into::into).collect(),
        ignored: upload.ignored,
    };
    Ok((status, Json(body)).into_response())
}

fn store(
    parts: &Parts,
    caller: &Caller,
    class: &str,
    create: bool,
    shapes: Vec<NewShape>,
) -> Result<(Class, Vec<AddedShape>), Problem> {
    let _alone = parts.catalogue.lock().unwrap_or_else(PoisonError::into_inner);
    let maker = parts.limits.maker(caller);
    let found = match find_class(&parts.store, class) {
        Err(problem) if create && problem.code == Code::ClassNotFound => {
            let name = ClassName::new(class)?;
            let added = parts.store.create_filled_class_by(maker.as_ref(), name, shapes)?;
            // A mesh was sent, else the upload had been refused, so there is a shape that names its class.
            let made = added.first().map(|a| a.shape.class).ok_or(problem)?;
            return Ok((parts.store.class(made)?, added));
        }
        found => found?,
    };
    let added = parts.store.add_shapes_by(maker.as_ref(), found.id, shapes)?;
    Ok((parts.store.class(found.id)?, added))
}

/// List shapes
///
/// In the order they were added.
#[utoipa::path(
    get, path = "/v1/classes/{class}/shapes", tag = "shapes",
    params(
        ("class" = String, Path, description = "The class's id or name", example = "dog"),
        PageQuery,
    ),
    responses((status = 200, description = "A page of shapes", body = Page<ShapeDto>))
)]
pub async fn list_shapes(
    State(state): State<AppState>,
    ApiPath(class): ApiPath<String>,
    ApiQuery(page): ApiQuery<PageQuery>,
) -> Result<Json<Page<ShapeDto>>, Problem> {
    let limit = page.limit()?;
    let (list, found, _memory) = state
        .blocking(move |s| {
            let class = find_class(&s.store, &class)?;
            let list = format!("shapes of {}", class.id);
            let after = page.after::<ShapeId>(&list)?;
            let memory = s.memory.reservation();
            let found = s
                .store
                .page_of_shapes(class.id, after, limit, page_memory(&memory))?;
            Ok((list, found, memory))
        })
        .await?;
    Ok(Json(Page::of(&list, found, |s| s.id.to_string(), Into::into)))
}

/// Show a shape
#[utoipa::path(
    get, path = "/v1/classes/{class}/shapes/{shape}", tag = "shapes",
    params(
        ("class" = String, Path, description = "The class's id or name", example = "dog"),
        ("shape" = String, Path, description = "The shape's id"),
    ),
    responses((status = 200, description = "The shape", body = ShapeDto))
)]
pub async fn get_shape(
    State(state): State<AppState>,
    ApiPath((class, shape)): ApiPath<(String, String)>,
) -> Result<Json<ShapeDto>, Problem> {
    let shape = state.blocking(move |s| find_shape(s, &class, &shape)).await?;
    Ok(Json(shape.into()))
}

/// Delete a shape
///
/// Its class is stale afterwards. Its file goes too, unless another shape came from it.
#[utoipa::path(
    delete, path = "/v1/classes/{class}/shapes/{shape}", tag = "shapes",
    params(
        ("class" = String, Path, description = "The class's id or name", example = "dog"),
        ("shape" = String, Path, description = "The shape's id"),
    ),
    responses((status = 204, description = "It is gone"))
)]
pub async fn delete_shape(
    State(state): State<AppState>,
    ApiPath((class, shape)): ApiPath<(String, String)>,
) -> Result<StatusCode, Problem> {
    state
        .blocking(move |s| {
            let _alone = s.catalogue.lock().unwrap_or_else(PoisonError::into_inner);
            let shape = find_shape(s, &class, &shape)?;
            s.store.delete_shape(shape.id)?;
            Ok(StatusCode::NO_CONTENT)
        })
        .await
}

/// Download a shape's file
///
/// As it was uploaded, byte for byte. With `if-none-match` and the file's tag the answer is 304. The stored file is
/// compared with its hash first: one that is gone is answered with `original_missing`, one that has changed on the disk
/// with `original_damaged`; uploading the same file again heals it.
#[utoipa::path(
    get, path = "/v1/classes/{class}/shapes/{shape}/original", tag = "shapes",
    params(
        ("class" = String, Path, description = "The class's id or name", example = "dog"),
        ("shape" = String, Path, description = "The shape's id"),
        ("if-none-match" = Option<String>, Header, description = "The `etag` of a copy at hand"),
    ),
    responses(
        (status = 200, description = "The file", headers(
            ("etag" = String, description = "The hash of its bytes"),
            ("content-disposition" = String, description = "Its name"),
        ), content(
            (Binary = "model/obj"),
            (Binary = "model/gltf+json"),
            (Binary = "model/gltf-binary"),
            (Binary = "model/stl"),
            (Binary = "model/ply"),
            (Binary = "model/off"),
        )),
        (status = 304, description = "The copy at hand is the file"),
    )
)]
pub async fn get_original(
    State(state): State<AppState>,
    ApiPath((class, shape)): ApiPath<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    // Also for a copy that is there already: a condition counts only where the file could be sent (RFC 9110, 13.2.1).
    let (shape, checked) = state
        .blocking(move |s| {
            let shape = find_shape(s, &class, &shape)?;
            let checked = s.store.open_original(shape.content)?;
            Ok((shape, checked))
        })
        .await?;
    let tag = format!("\"{}\"", shape.content);
    let mut response = if is_at_hand(&headers, &tag) {
        StatusCode::NOT_MODIFIED.into_response()
    } else {
        let file = tokio::fs::File::from_std(checked.file).take(checked.length);
        let mut response = file_body(file, &state.memory)?.into_response();
        insert(&mut response, header::CONTENT_LENGTH, &checked.length.to_string());
        insert(&mut response, header::CONTENT_TYPE, shape.format.media_type());
        insert(&mut response, header::CONTENT_DISPOSITION, &disposition(&shape));
        response
    };
    insert(&mut response, header::ETAG, &tag);
    insert(&mut response, header::CACHE_CONTROL, "private, no-cache");
    Ok(response)
}

/// `attachment` with the file's name, percent-encoded as RFC 8187 has it, so that every name is one header value.
fn disposition(shape: &Shape) -> String {
    let fallback = format!("{}.{}", shape.id, shape.format.extension());
    let name = shape.name.as_deref().unwrap_or(&fallback);
    let name = name.rsplit('/').next().unwrap_or(name);
    let mut encoded = String::new();
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            encoded.push(char::from(byte));
        } else {
            encoded.push_str(&format!("%{byte:02X}"));
        }
    }
    format!("attachment; filename*=UTF-8''{encoded}")
}

/// A shape of a class, both as the address names them.
pub(in crate::http) fn find_shape(parts: &Parts, class: &str, shape: &str) -> Result<Shape, Problem> {
    let class = find_class(&parts.store, class)?;
    let missing = || {
        let shown: String = shape.chars().take(100).collect();
        Problem::new(
            Code::ShapeNotFound,
            format!("there is no shape '{shown}' in class '{}'", class.name),
        )
        .with("shape", shown)
    };
    let id: ShapeId = shape.parse().map_err(|_| missing())?;
    match parts.store.shape(id) {
        Ok(found) if found.class == class.id => Ok(found),
        Ok(_) | Err(StoreError::NoShape { .. }) => Err(missing()),
        Err(other) => Err(other.into()),
    }
}
