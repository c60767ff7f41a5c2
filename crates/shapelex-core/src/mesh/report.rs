//! What preparing did to a mesh, and what of it may change a result.

use super::MeshError;
use serde::{Deserialize, Serialize};

/// A surface whose boundary loops are longer than this many √area is open: a single view has 8 to 16, a half sphere
/// 2.507.
pub const OPEN_ABOVE: f64 = 2.5;

/// Fewer vertices than this describe a shape poorly.
const FEW_VERTICES: usize = 300;

/// More separate parts than this are worth a warning.
const MANY_COMPONENTS: usize = 10;

/// Share of the area that may be left out without a warning.
const AREA_DROPPED: f64 = 0.1;

/// Share of the area above which what is left is not taken for the shape.
const MOST_DROPPED: f64 = 0.9;

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
    /// Where the file's last digit differs between copies of a vertex: the distance, in the file's units, below which
    /// vertices were merged instead of the usual one.
    pub welded_within: Option<f64>,
    /// Faces dropped for a repeated vertex or (nearly) no area.
    pub degenerate_faces: usize,
    /// Faces without area that joined others: taken out so that the surface stays closed there.
    pub repaired_faces: usize,
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
    /// Vertices after refinement, where a coarse mesh was refined for its spectrum.
    pub refined_to: Option<usize>,
    /// Faces of the prepared mesh, before a coarse mesh is refined.
    pub faces: usize,
    /// Surface area of the prepared mesh before normalisation, in the file's squared units.
    pub area: f64,
    /// Length of the boundary's loops / √area after small holes were closed: 0 for a closed surface, 8–16 for a single
    /// view.
    pub openness: f64,
    /// What may change a result, one sentence each. Normal steps, such as simplification, are not among them.
    pub warnings: Vec<String>,
}

/// How a mesh came to its working size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Simplified {
    /// It was small enough already.
    #[default]
    No,
    /// By edge collapses that keep the topology.
    ByCollapse,
    /// Non-manifold places had to be collapsed across.
    AcrossTopology,
    /// Collapses did not suffice; vertices were clustered on a grid, which may change the topology.
    ByClustering,
}

impl PrepareReport {
    /// Whether the surface is open: likely a part of a shape, such as a single view.
    pub fn is_open(&self) -> bool {
        self.openness > OPEN_ABOVE
    }

    /// Refuses a mesh of which nearly nothing is kept.
    ///
    /// # Errors
    /// [`MeshError::Disconnected`] where more than 90 % of the area was left out.
    pub(super) fn check_kept(&self) -> Result<(), MeshError> {
        if self.area_dropped <= MOST_DROPPED {
            return Ok(());
        }
        Err(MeshError::Disconnected {
            parts: self.components,
            dropped: self.components_dropped,
            percent: 100.0 * self.area_dropped,
        })
    }

    /// Adds one sentence for everything that may surprise a user in the ranking. `torn_off` is the share of the area
    /// that the simplification lost with parts that came apart.
    pub(super) fn warn(&mut self, simplified: Simplified, torn_off: f64) {
        self.warn_of_cleaning();
        if self.is_open() {
            self.warnings.push(format!(
                "The surface is open: its boundary is {:.1} times the square root of its area.",
                self.openness
            ));
        }
        match simplified {
            Simplified::No | Simplified::ByCollapse => {}
            Simplified::AcrossTopology => self
                .warnings
                .push("The simplification had to collapse across non-manifold places.".to_owned()),
            Simplified::ByClustering => self.warnings.push(
                "The mesh could not be simplified by edge collapses; its vertices were clustered, which may change its topology."
                    .to_owned(),
            ),
        }
        if torn_off > AREA_DROPPED {
            self.warnings.push(format!(
                "Parts that came off when the mesh was simplified were left out, with {:.0} % of the surface area; raise working_size or connect the parts by more than single vertices.",
                100.0 * torn_off
            ));
        }
        if self.vertices < FEW_VERTICES {
            self.warnings.push(format!(
                "Only {} vertices are left; fewer than {FEW_VERTICES} describe a shape poorly.",
                self.vertices
            ));
        }
    }

    fn warn_of_cleaning(&mut self) {
        let mut warnings = Vec::new();
        if let Some(distance) = self.welded_within {
            warnings.push(format!(
                "Copies of a vertex differ in the last digits of the file; vertices closer than {distance:.1e} were taken for one."
            ));
        }
        if 10 * self.degenerate_faces > self.input_faces {
            warnings.push(format!(
                "{} of {} faces have no area and were dropped.",
                self.degenerate_faces, self.input_faces
            ));
        }
        if self.repaired_faces > 0 {
            warnings.push(format!(
                "{} {} so thin that the spectrum cannot be solved for; the vertices were joined to the neighbouring faces instead.",
                self.repaired_faces,
                if self.repaired_faces == 1 { "face is" } else { "faces are" }
            ));
        }
        if self.area_dropped > AREA_DROPPED {
            warnings.push(format!(
                "{} of {} separate parts, {:.0} % of the surface, were left out; set components to all, or connect the parts (weld their vertices).",
                self.components_dropped,
                self.components,
                100.0 * self.area_dropped
            ));
        }
        if self.components > MANY_COMPONENTS {
            warnings.push(format!(
                "The mesh falls into {} separate parts; parts of one shape should be connected.",
                self.components
            ));
        }
        if self.non_manifold_edges > 0 {
            warnings.push(format!(
                "The mesh is not a manifold: more than two faces meet at {} of its edges.",
                self.non_manifold_edges
            ));
        }
        self.warnings = warnings;
    }
}
