//! Mesh → signatures, for training shapes and for queries.

use super::estimate::Role;
use super::prepared::CleanShape;
use super::{Description, PipelineError, PreparedShape, Stage, Within};
use crate::cancel::Cancel;
use crate::memory::MemoryBudget;
use crate::mesh::TriangleSoup;
use crate::parameters::{Hypothesis, Parameters};
use crate::ranking::View;

/// Calls a function with memory that is not limited.
fn unlimited<T>(cancel: &Cancel, describe: impl FnOnce(Within<'_>) -> T) -> T {
    let memory = MemoryBudget::unlimited().reservation();
    describe(Within {
        cancel,
        memory: &memory,
    })
}

/// Cleans a mesh, reserves the memory of its spectra, solves for them and takes the views.
fn describe(
    soup: TriangleSoup,
    parameters: &Parameters,
    role: Role,
    within: Within<'_>,
    observer: &dyn Fn(Stage),
    views: impl FnOnce(&mut PreparedShape) -> Result<Vec<View>, PipelineError>,
) -> Result<Description, PipelineError> {
    let clean = CleanShape::new(soup, parameters, role, within, observer)?;
    let _held = within.memory.hold(clean.bytes(parameters, within)?)?;
    let mut shape = clean.solve(parameters, within.cancel, observer)?;
    let views = views(&mut shape)?;
    Ok(shape.into_description(views))
}

/// Describes a training shape: one view per channel of the parameters, `samples_per_shape` signatures each.
///
/// The vertices are drawn by area with the parameters' seed, so equal meshes give equal signatures.
///
/// # Errors
/// The error of the stage that failed, or [`PipelineError::Cancelled`].
pub fn describe_shape(
    soup: TriangleSoup,
    parameters: &Parameters,
    cancel: &Cancel,
    observer: &dyn Fn(Stage),
) -> Result<Description, PipelineError> {
    unlimited(cancel, |within| {
        describe_shape_within(soup, parameters, within, observer)
    })
}

/// As [`describe_shape`], for a caller that grants memory.
///
/// # Errors
/// As [`describe_shape`], and [`MeshError::Memory`](crate::mesh::MeshError::Memory).
pub fn describe_shape_within(
    soup: TriangleSoup,
    parameters: &Parameters,
    within: Within<'_>,
    observer: &dyn Fn(Stage),
) -> Result<Description, PipelineError> {
    describe(soup, parameters, Role::Training, within, observer, |shape| {
        shape.training_views(parameters, within.cancel)
    })
}

/// Describes a query: one view per hypothesis (an open surface's doubling gives one per assumed area),
/// `query_samples` signatures each. A hypothesis other than the plain one that fails is left out, with a warning.
///
/// # Errors
/// The error of the stage that failed, or [`PipelineError::Cancelled`].
pub fn describe_query(
    soup: TriangleSoup,
    parameters: &Parameters,
    cancel: &Cancel,
    observer: &dyn Fn(Stage),
) -> Result<Description, PipelineError> {
    unlimited(cancel, |within| {
        describe_query_within(soup, parameters, within, observer)
    })
}

/// As [`describe_query`], for a caller that grants memory.
///
/// # Errors
/// As [`describe_query`], and [`MeshError::Memory`](crate::mesh::MeshError::Memory).
pub fn describe_query_within(
    soup: TriangleSoup,
    parameters: &Parameters,
    within: Within<'_>,
    observer: &dyn Fn(Stage),
) -> Result<Description, PipelineError> {
    describe(soup, parameters, Role::Query, within, observer, |shape| {
        shape.query_views(parameters, within.cancel)
    })
}

/// Describes a query for the baselines, which compare it with the plain view of training shapes: by that view alone, with
/// `samples_per_shape` signatures, and without the whitened and doubled spectra. The solve is that of a training shape, so
/// that one finds itself to the last bit.
///
/// # Errors
/// The error of the stage that failed, or [`PipelineError::Cancelled`].
pub fn describe_plain(
    soup: TriangleSoup,
    parameters: &Parameters,
    cancel: &Cancel,
    observer: &dyn Fn(Stage),
) -> Result<Description, PipelineError> {
    unlimited(cancel, |within| {
        describe_plain_within(soup, parameters, within, observer)
    })
}

/// As [`describe_plain`], for a caller that grants memory.
///
/// # Errors
/// As [`describe_plain`], and [`MeshError::Memory`](crate::mesh::MeshError::Memory).
pub fn describe_plain_within(
    soup: TriangleSoup,
    parameters: &Parameters,
    within: Within<'_>,
    observer: &dyn Fn(Stage),
) -> Result<Description, PipelineError> {
    let mut parameters = parameters.clone();
    parameters.hypotheses.retain(|h| *h != Hypothesis::Whitened);
    describe(soup, &parameters, Role::Training, within, observer, |shape| {
        Ok(vec![shape.training_plain(&parameters)?])
    })
}

/// Describes one shape both as a training shape and as a query, from one spectrum: what an evaluation, in which every
/// shape is both, needs.
///
/// # Errors
/// As [`describe_shape`].
pub fn describe_both(
    soup: TriangleSoup,
    parameters: &Parameters,
    cancel: &Cancel,
) -> Result<(Description, Description), PipelineError> {
    let mut shape = PreparedShape::new(soup, parameters, cancel, &|_| ())?;
    let training = shape.training_views(parameters, cancel)?;
    let query = shape.query_views(parameters, cancel)?;
    let query = Description {
        views: query,
        report: shape.report().clone(),
        eigenvalues: shape.first_eigenvalues(),
    };
    Ok((shape.into_description(training), query))
}
