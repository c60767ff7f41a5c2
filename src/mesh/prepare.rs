//! Soup → clean mesh of the working size, with a report of what was done.

use super::boundary::loops_length;
use super::clean::{Cleaned, clean};
use super::decimate::{Simplified, simplify_to};
use super::edges::edge_census;
use super::holes::fill_small_holes;
use super::{MeshError, TriMesh, TriangleSoup};
use crate::cancel::Cancel;
use serde::{Deserialize, Serialize};

/// Boundary length / √area above which a surface counts as open (a half sphere has 2.507).
pub const OPEN: f64 = 2.5;

/// Fewer vertices than this describe a shape poorly.
const FEW_VERTICES: usize = 300;

/// More separate parts than this are worth a warning.
const MANY_COMPONENTS: usize = 10;

/// Which connected components are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Components {
    /// The one with the largest area.
    #[default]
    Largest,
    /// All with at least 1 % of the area.
    All,
}

/// How a soup becomes a mesh (method, step 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PrepareOptions {
    /// Which connected components are kept.
    pub components: Components,
    /// Close boundary loops with a perimeter below this many times √area; 0 closes none.
    pub fill_holes_below: f64,
    /// Simplify meshes with more vertices than this, or than 8; 0 never does.
    pub working_size: usize,
}

impl Default for PrepareOptions {
    /// Largest component, holes below 1.2 √area closed, 2000 vertices.
    fn default() -> Self {
        Self {
            components: Components::Largest,
            fill_holes_below: 1.2,
            working_size: 2000,
        }
    }
}

/// What preparing did to a mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PrepareReport {
    /// Vertices as read.
    pub input_vertices: usize,
    /// Faces as read.
    pub input_faces: usize,
    /// Vertices merged into a coincident one.
    pub welded_vertices: usize,
    /// Faces dropped for a repeated vertex or (nearly) no area.
    pub degenerate_faces: usize,
    /// Faces dropped because the same three vertices have one already.
    pub duplicate_faces: usize,
    /// Vertices dropped because no face uses them, or only dropped faces did.
    pub unreferenced_vertices: usize,
    /// Connected components (faces that share a vertex) after cleaning.
    pub components: usize,
    /// Components left out.
    pub components_dropped: usize,
    /// Share of the total area that was left out, 0 to 1.
    pub area_dropped: f64,
    /// Edges with more than two faces, before simplification.
    pub non_manifold_edges: usize,
    /// Edges with one face, after small holes were closed.
    pub boundary_edges: usize,
    /// Boundary loops closed by a fan.
    pub holes_filled: usize,
    /// Vertices before simplification, where the mesh was simplified.
    pub simplified_from: Option<usize>,
    /// Vertices that carry signatures, before a coarse mesh is refined.
    pub vertices: usize,
    /// Faces of the prepared mesh.
    pub faces: usize,
    /// Surface area of the prepared mesh before normalisation, in the file's squared units.
    pub area: f64,
    /// Length of the boundary's loops / √area after small holes were closed: 0 for a closed surface, 8–16 for a single
    /// view.
    pub openness: f64,
    /// Things a user should know, one sentence each.
    pub warnings: Vec<String>,
}

/// Cleans, simplifies and closes small holes; the result has unit area and its area centroid at the origin.
///
/// In this order: [cleaning](super::clean) (weld, degenerate and duplicate faces, unused vertices, components),
/// [simplification](super::decimate) above the working size, [small holes](super::holes), scale and place. Vertices
/// added to holes come last and carry no signatures. The outcome does not depend on the position, size or units of
/// the input, nor, up to order and unless the mesh is simplified, on the order of its vertices and faces.
///
/// Errors: [`MeshError::NoFaces`] for points only, [`MeshError::NotFinite`] and [`MeshError::IndexOutOfRange`] for
/// soups that break their promise, [`MeshError::Degenerate`] when no face has an area, [`MeshError::TooSmall`] when
/// fewer than 4 vertices or 2 faces are left, [`MeshError::NotSimplified`] when the working size would leave nothing.
pub fn prepare(soup: TriangleSoup, options: &PrepareOptions) -> Result<(TriMesh, PrepareReport), MeshError> {
    prepare_until(soup, options, &Cancel::new())
}

/// As [`prepare`], for a caller that may ask to stop. The flag is looked at between the steps; large meshes are
/// simplified in pieces, and between these, too.
///
/// Errors: those of [`prepare`], and [`MeshError::Cancelled`].
pub fn prepare_until(
    soup: TriangleSoup,
    options: &PrepareOptions,
    cancel: &Cancel,
) -> Result<(TriMesh, PrepareReport), MeshError> {
    let mut report = PrepareReport::default();
    let mut mesh = clean(soup, options.components, &mut report, cancel)?;
    cancel.check()?;
    let mut census = edge_census(mesh.vertices.len(), &mesh.faces);
    report.non_manifold_edges = census.non_manifold;

    let before = mesh.vertices.len();
    let oriented = census.inconsistent == 0;
    let simplified = simplify_to(
        &mut mesh,
        options.working_size,
        options.components,
        oriented,
        cancel,
    )?;
    if simplified != Simplified::No {
        report.simplified_from = Some(before);
        census = edge_census(mesh.vertices.len(), &mesh.faces);
    }

    let Cleaned {
        mut vertices,
        mut faces,
        scale,
    } = mesh;
    report.vertices = vertices.len();
    report.holes_filled = fill_small_holes(
        &mut vertices,
        &mut faces,
        &census.boundary,
        options.fill_holes_below,
    );
    report.faces = faces.len();
    if report.holes_filled > 0 {
        census = edge_census(vertices.len(), &faces);
    }
    let mesh = TriMesh::new(vertices, faces, report.vertices)?;
    let area = mesh.area();
    report.boundary_edges = census.boundary.len();
    report.openness = loops_length(mesh.vertices(), &census.boundary) / area.sqrt();
    // Clamped, as the squared units of a finite file may overflow and reports are written as JSON.
    report.area = (area * scale * scale).min(f64::MAX);
    report.warnings = warnings(&report, simplified);
    Ok((mesh.normalised()?, report))
}

/// One sentence for everything that may surprise a user in the ranking.
fn warnings(report: &PrepareReport, simplified: Simplified) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut warn = |condition: bool, sentence: String| {
        if condition {
            warnings.push(sentence);
        }
    };
    warn(
        10 * report.degenerate_faces > report.input_faces,
        format!(
            "{} of {} faces have no area and were dropped.",
            report.degenerate_faces, report.input_faces
        ),
    );
    warn(
        report.area_dropped > 0.1,
        format!(
            "{} of {} separate parts were left out, with {:.0} % of the surface area.",
            report.components_dropped,
            report.components,
            100.0 * report.area_dropped
        ),
    );
    warn(
        report.components > MANY_COMPONENTS,
        format!(
            "The mesh falls into {} separate parts; parts of one shape should be connected.",
            report.components
        ),
    );
    warn(
        report.non_manifold_edges > 0,
        format!(
            "The mesh is not a manifold: more than two faces meet at {} of its edges.",
            report.non_manifold_edges
        ),
    );
    warn(
        report.openness > OPEN,
        format!(
            "The surface is open: its boundary is {:.1} times the square root of its area.",
            report.openness
        ),
    );
    warn(
        report.simplified_from.is_some(),
        format!(
            "The mesh was simplified from {} to {} vertices.",
            report.simplified_from.unwrap_or_default(),
            report.vertices
        ),
    );
    warn(
        simplified == Simplified::AcrossTopology,
        "The simplification had to collapse across non-manifold places.".to_owned(),
    );
    warn(
        simplified == Simplified::ByClustering,
        "The mesh could not be simplified by edge collapses; its vertices were clustered, which may change its topology.".to_owned(),
    );
    warn(
        report.vertices < FEW_VERTICES,
        format!(
            "Only {} vertices are left; fewer than {FEW_VERTICES} describe a shape poorly.",
            report.vertices
        ),
    );
    warnings
}
