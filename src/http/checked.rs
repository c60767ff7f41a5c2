//! The meshes of an upload → shapes that can be stored.

use super::admission::Patience;
use super::problem::{Code, Problem};
use super::state::AppState;
use super::uploaded::UploadedMesh;
use crate::model::{NewShape, ShapePose};
use futures_util::{StreamExt, stream};
use serde_json::Value;
use shapelex_core::mesh::{PrepareOptions, ReadContext, TriangleSoup, prepare_within};
use std::sync::Arc;

/// Reads and prepares every mesh, as many at a time as there are query threads, each in a query's turn. Each gives one
/// shape, or one per pose.
///
/// # Errors
/// [`rejected`] where files cannot be used; what is about the service.
pub(super) async fn shapes_of(
    state: &AppState,
    meshes: Vec<UploadedMesh>,
    poses: Option<usize>,
    options: PrepareOptions,
) -> Result<Vec<Vec<NewShape>>, Problem> {
    let total = meshes.len();
    let limits = state.config.limits;
    let names: Arc<Vec<String>> = Arc::new(meshes.iter().map(|m| m.name.clone()).collect());
    // The first one queues like any request and may be turned away; the others follow it in.
    let outcomes: Vec<Result<Vec<NewShape>, Problem>> = stream::iter(meshes.into_iter().enumerate())
        .map(|(i, mesh)| {
            let patience = if i == 0 {
                Patience::Bounded
            } else {
                Patience::Batch
            };
            state
                .compute
                .run(patience, state.config.query_timeout, move |work| {
                    let context = mesh.context(limits, &work.cancel);
                    check_one(&mesh, poses, &context, &options)
                })
        })
        .buffered(state.config.query_threads.max(1))
        .collect()
        .await;
    let mut shapes = Vec::new();
    let mut failures = Vec::new();
    for (outcome, name) in outcomes.into_iter().zip(names.iter()) {
        match outcome {
            Ok(found) => shapes.push(found),
            // Overload and faults are about the service, not about the file.
            Err(problem) if problem.code.status().is_server_error() => return Err(problem),
            Err(problem) => failures.push((name.clone(), problem)),
        }
    }
    if failures.is_empty() {
        Ok(shapes)
    } else {
        Err(rejected(failures, total))
    }
}

/// The problem of an upload of `total` files of which some cannot be used, each by its name: that of a single file is the
/// file's own, else `upload_rejected` lists them.
pub(super) fn rejected(mut failures: Vec<(String, Problem)>, total: usize) -> Problem {
    if total == 1 && failures.len() == 1 {
        return failures.remove(0).1;
    }
    let failed = failures.len();
    let list: Vec<Value> = failures
        .into_iter()
        .map(|(name, problem)| {
            let mut entry = problem.to_json(None);
            entry["name"] = name.into();
            entry
        })
        .collect();
    Problem::new(
        Code::UploadRejected,
        format!("{failed} of {total} files could not be used; nothing was stored"),
    )
    .with("failed", failed)
    .with("total", total)
    .with("failures", list)
}

/// Bytes that a shape takes from its check to the answer, beside its names: the shape, its record and its part of the
/// answer.
const SHAPE_BYTES: u64 = 8 << 10;
/// How often the names of a shape and of its buffers are there meanwhile: in the new shape, the record, the shape that was
/// added, and the answer as values and as text.
const SHAPE_COPIES: u64 = 8;

fn check_one(
    mesh: &UploadedMesh,
    poses: Option<usize>,
    context: &ReadContext,
    options: &PrepareOptions,
) -> Result<Vec<NewShape>, Problem> {
    // Shared by all poses.
    let companions = mesh.companions(context)?;
    let names: usize = companions.iter().map(|companion| companion.name.len()).sum();
    let names = names + mesh.name.len() + mesh.member.as_ref().map_or(0, String::len);
    let shape = |format, pose, soup: TriangleSoup| -> Result<NewShape, Problem> {
        let (_, mut report) = prepare_within(soup, options, &context.cancel, &context.memory)?;
        report.warnings.splice(0..0, context.warnings.list());
        // Held from here until the answer tells of it.
        mesh.hold(SHAPE_BYTES + SHAPE_COPIES * names as u64)?;
        Ok(NewShape {
            name: Some(mesh.name.clone()),
            bytes: mesh.bytes.clone(),
            companions: companions.clone(),
            format,
            pose,
            report,
        })
    };
    let Some(wanted) = poses else {
        let (format, soup) = mesh.read(context)?;
        return Ok(vec![shape(format, None, soup)?]);
    };
    let (format, found) = mesh.read_poses(wanted, context)?;
    let of = found.len();
    found
        .into_iter()
        .enumerate()
        .map(|(index, pose)| {
            let label = ShapePose {
                label: pose.label,
                index,
                of,
            };
            shape(format, Some(label), pose.soup)
        })
        .collect()
}
