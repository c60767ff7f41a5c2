//! Soup → clean mesh of the working size, with a report of what was done.

use super::boundary::loops_length;
use super::clean::{Cleaned, clean};
use super::decimate::simplify_to;
use super::edges::{EdgeCensus, count_edges, edge_census_within};
use super::holes::fill_small_holes;
use super::report::Simplified;
use super::work::{Watch, Work};
use super::{MeshError, PrepareOptions, PrepareReport, TriMesh, TriangleSoup};
use crate::cancel::Cancel;
use crate::memory::{MemoryBudget, Reservation};

/// Cleans, simplifies and closes small holes; the result has unit area and its area centroid at the origin.
///
/// In this order: [cleaning](super::clean) (weld, slivers, degenerate and duplicate faces, unused vertices,
/// components), [simplification](super::decimate) above the working size, [small holes](super::holes), scale and place.
/// Vertices added to holes come last and carry no signatures. The outcome does not depend on the position, size or units
/// of the input, nor, up to order and unless the mesh is simplified, on the order of its vertices and faces.
///
/// Errors: [`MeshError::NoFaces`] for points only, [`MeshError::NotFinite`] and [`MeshError::IndexOutOfRange`] for
/// soups that break their promise, [`MeshError::Degenerate`] when no face has an area, [`MeshError::Disconnected`]
/// when more than 90 % of the area would be left out, [`MeshError::TooSmall`] when fewer than 4 vertices or 2 faces are
/// left, [`MeshError::NotSimplified`] when the working size would leave nothing.
pub fn prepare(soup: TriangleSoup, options: &PrepareOptions) -> Result<(TriMesh, PrepareReport), MeshError> {
    prepare_until(soup, options, &Cancel::new())
}

/// As [`prepare`], for a caller that may ask to stop and does not limit the memory.
///
/// Errors: those of [`prepare`], and [`MeshError::Cancelled`].
pub fn prepare_until(
    soup: TriangleSoup,
    options: &PrepareOptions,
    cancel: &Cancel,
) -> Result<(TriMesh, PrepareReport), MeshError> {
    prepare_within(soup, options, cancel, &MemoryBudget::unlimited().reservation())
}

/// As [`prepare`], for a caller that may ask to stop and that grants memory.
///
/// The flag is looked at every few milliseconds. The exception are meshes that are simplified to more than some 8000
/// vertices: the last collapses are one call for up to 8 faces per vertex of the working size, some 1 µs each.
///
/// Before arrays are allocated their bytes are reserved in `memory`, and given back when they are freed; after the call
/// it holds what it held before. For V vertices and F faces of the soup and a working size of W at most
/// 96 V + 64 F + 1800 W bytes and 32 MiB are reserved at a time, and 110 bytes for each boundary edge of a mesh that
/// is not simplified. The soup's own 24 V + 12 F bytes are the caller's, who has reserved them when it was read.
///
/// Errors: those of [`prepare`], [`MeshError::Cancelled`] and [`MeshError::Memory`].
pub fn prepare_within(
    soup: TriangleSoup,
    options: &PrepareOptions,
    cancel: &Cancel,
    memory: &Reservation,
) -> Result<(TriMesh, PrepareReport), MeshError> {
    let work = Work { cancel, memory };
    let mut report = PrepareReport::default();
    let mut mesh = clean(soup, options.components, &mut report, work)?;
    report.check_kept()?;
    let before = mesh.vertices.len();
    let edges = count_edges(before, &mesh.faces, work)?;
    report.non_manifold_edges = edges.non_manifold;
    let reduction = simplify_to(&mut mesh, options, &edges, work)?;
    if reduction.how != Simplified::No {
        report.simplified_from = Some(before);
    }
    let scale = mesh.scale;
    let (mesh, census) = close_holes(mesh, options, &mut report, work)?;
    let area = mesh.area();
    report.boundary_edges = census.boundary.len();
    report.openness = loops_length(mesh.vertices(), &census.boundary, &work)? / area.sqrt();
    // Clamped, as the squared units of a finite file may overflow and reports are written as JSON.
    report.area = (area * scale * scale).min(f64::MAX);
    report.warn(reduction.how, reduction.torn_off);
    work.check()?;
    Ok((mesh.normalised()?, report))
}

/// The mesh with small holes closed, and the edges it has then.
fn close_holes(
    mesh: Cleaned,
    options: &PrepareOptions,
    report: &mut PrepareReport,
    work: Work,
) -> Result<(TriMesh, EdgeCensus), MeshError> {
    let Cleaned {
        mut vertices,
        mut faces,
        ..
    } = mesh;
    report.vertices = vertices.len();
    let mut census = edge_census_within(vertices.len(), &faces, work)?;
    let _list = work.hold(census.boundary.len(), size_of::<[u32; 2]>())?;
    report.holes_filled = fill_small_holes(
        &mut vertices,
        &mut faces,
        &census.boundary,
        options.fill_holes_below,
        work,
    )?;
    report.faces = faces.len();
    if report.holes_filled > 0 {
        census = edge_census_within(vertices.len(), &faces, work)?;
    }
    work.check()?;
    Ok((TriMesh::new(vertices, faces, report.vertices)?, census))
}
