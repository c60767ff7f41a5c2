//! Datasets: many classes in one upload.

use crate::http::AppState;
use crate::http::access::Access;
use crate::http::caller::Caller;
use crate::http::checked::{self, rejected};
use crate::http::dataset::{Placed, class_name, places};
use crate::http::dto::Binary;
use crate::http::dto::FilesForm;
use crate::http::dto::class::ClassDto;
use crate::http::dto::dataset::{DatasetClass, DatasetQuery, DatasetResult};
use crate::http::extract::ApiQuery;
use crate::http::poses::check_poses;
use crate::http::problem::Code;
use crate::http::problem::Problem;
use crate::http::problem_from::recovery_mode;
use crate::http::problem_sets::{MESH, POOL, UPLOAD, WRITE};
use crate::http::route::Route;
use crate::http::state::Parts;
use crate::http::upload;
use crate::http::uploaded::UploadedMesh;
use crate::jobs::LiveIndex;
use crate::model::Scope;
use crate::model::{ClassName, NewShape};
use crate::store::{ClassShapes, FilledClass, Store};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use std::collections::BTreeMap;
use std::sync::PoisonError;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    use Code::*;
    vec![Route::new(
        routes!(upload_dataset),
        Access::Needs(Scope::Write),
        &[
            UPLOAD,
            MESH,
            POOL,
            WRITE,
            &[
                InvalidName,
                FileWithoutClass,
                UploadRejected,
                NoAnimation,
                QuotaExceeded,
                ClassExists,
            ],
        ],
    )]
}

/// Upload a dataset
///
/// A zip, tar or tar.gz whose top folders are classes, `class/pose.off`; a folder around all of them is passed over, and
/// what lies deeper belongs to the class. Classes that do not exist are made, the others filled. Every file is read and
/// prepared before anything is stored: where one cannot be used, nothing is stored and `failures` names each. The same
/// archive again changes nothing.
#[utoipa::path(
    post, path = "/v1/shapes", tag = "shapes", params(DatasetQuery),
    request_body(description = "An archive with a folder per class", content(
        (Binary = "application/zip"),
        (Binary = "application/x-tar"),
        (Binary = "application/gzip"),
        (Binary = "application/octet-stream"),
        (FilesForm = "multipart/form-data"),
    )),
    responses(
        (status = 201, description = "At least one shape was added", body = DatasetResult),
        (status = 200, description = "All shapes were there already", body = DatasetResult),
    )
)]
pub async fn upload_dataset(
    State(state): State<AppState>,
    ApiQuery(query): ApiQuery<DatasetQuery>,
    caller: Caller,
    request: Request,
) -> Result<Response, Problem> {
    check_poses(query.poses, &state.config.limits)?;
    let asking = caller.clone();
    let options = state
        .blocking(move |s| {
            if s.store.recovery_mode().is_some() {
                return Err(recovery_mode());
            }
            s.limits.require_room(&s.store, &asking, 0)?;
            Ok(s.store.parameters()?.prepare_options())
        })
        .await?;
    let upload = upload::receive(&state, request, None).await?;
    let placed = placed(&upload.meshes)?;
    let asking = caller.clone();
    let named = state
        .blocking(move |s| {
            let named = named(&s.store, placed)?;
            // What certainly does not fit is refused before the meshes are read.
            s.limits
                .require_room(&s.store, &asking, missing(&s.store, &named)?)?;
            Ok(named)
        })
        .await?;
    let shapes = checked::shapes_of(&state, upload.meshes, query.poses, options).await?;
    let filled = state.blocking(move |s| store(s, &caller, named, shapes)).await?;
    let result = result(filled, upload.ignored, &state.jobs.live_index());
    let status = match result.shapes_created {
        0 => StatusCode::OK,
        _ => StatusCode::CREATED,
    };
    Ok((status, Json(result)).into_response())
}

/// A file with the class it belongs to.
type Named = (ClassName, String);

/// The folder of every file.
fn placed(meshes: &[UploadedMesh]) -> Result<Vec<(String, Placed)>, Problem> {
    let paths: Vec<Option<&str>> = meshes.iter().map(|mesh| mesh.member.as_deref()).collect();
    let found = places(&paths).into_iter().zip(meshes);
    all(found.map(|(place, mesh)| (mesh.name.clone(), place)))
}

/// The class of every file.
fn named(store: &Store, placed: Vec<(String, Placed)>) -> Result<Vec<Named>, Problem> {
    let found = placed.into_iter().map(|(file, place)| {
        let class = class_name(&place.folder, |name| Ok(store.class_by_name(name)?.is_some()));
        (file, class.map(|class| (class, place.name)))
    });
    Ok(all(found)?.into_iter().map(|(_, named)| named).collect())
}

/// Everything, or the problem of the files that have one.
fn all<T>(found: impl Iterator<Item = (String, Result<T, Problem>)>) -> Result<Vec<(String, T)>, Problem> {
    let (mut good, mut failures) = (Vec::new(), Vec::new());
    for (file, outcome) in found {
        match outcome {
            Ok(value) => good.push((file, value)),
            Err(problem) if problem.code.status().is_server_error() => return Err(problem),
            Err(problem) => failures.push((file, problem)),
        }
    }
    let total = good.len() + failures.len();
    match failures.is_empty() {
        true => Ok(good),
        false => Err(rejected(failures, total)),
    }
}

/// How many classes would be made.
fn missing(store: &Store, named: &[Named]) -> Result<u64, Problem> {
    let mut classes = BTreeMap::new();
    for (class, _) in named {
        if !classes.contains_key(class) {
            classes.insert(class, store.class_by_name(class)?.is_none());
        }
    }
    Ok(classes.values().filter(|missing| **missing).count() as u64)
}

fn store(
    parts: &Parts,
    caller: &Caller,
    named: Vec<Named>,
    shapes: Vec<Vec<NewShape>>,
) -> Result<Vec<FilledClass>, Problem> {
    let mut dataset: Vec<ClassShapes> = Vec::new();
    let mut places: BTreeMap<ClassName, usize> = BTreeMap::new();
    for ((class, name), shapes) in named.into_iter().zip(shapes) {
        let place = *places.entry(class.clone()).or_insert_with(|| {
            dataset.push(ClassShapes {
                name: class,
                shapes: Vec::new(),
            });
            dataset.len() - 1
        });
        let named = shapes.into_iter().map(|shape| NewShape {
            name: Some(name.clone()),
            ..shape
        });
        dataset[place].shapes.extend(named);
    }
    let _alone = parts.catalogue.lock().unwrap_or_else(PoisonError::into_inner);
    let maker = parts.limits.maker(caller);
    Ok(parts.store.fill_classes_by(maker.as_ref(), dataset)?)
}

fn result(filled: Vec<FilledClass>, ignored: Vec<String>, live: &LiveIndex) -> DatasetResult {
    let count = |created: bool| {
        let shapes = filled.iter().flat_map(|class| &class.shapes);
        shapes.filter(|shape| shape.created == created).count()
    };
    DatasetResult {
        classes_created: filled.iter().filter(|class| class.created).count(),
        shapes_created: count(true),
        shapes_existing: count(false),
        classes: filled
            .into_iter()
            .map(|filled| DatasetClass {
                created: filled.created,
                class: ClassDto::new(filled.class, live.generation.as_ref()),
                shapes: filled.shapes.into_iter().map(Into::into).collect(),
            })
            .collect(),
        ignored,
    }
}
