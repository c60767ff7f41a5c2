//! Training shapes on the wire.

use super::class::ClassDto;
use super::time;
use crate::model::{Shape, ShapePose};
use crate::store::AddedShape;
use serde::{Deserialize, Serialize};
use shapelex_core::mesh::PrepareReport;
use utoipa::{IntoParams, ToSchema};

/// How shapes are uploaded.
#[derive(Clone, Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct UploadQuery {
    /// What a raw body is called, such as `dog0.obj`. Multipart parts and archive members bring their own names.
    pub name: Option<String>,
    /// Sample this many poses of every animated glTF instead of reading its bind pose.
    #[param(minimum = 1, maximum = 64)]
    pub poses: Option<usize>,
    /// Make the class where it does not exist yet. `{class}` is its name then.
    pub create: Option<bool>,
}

/// What preparing did to a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ReportDto {
    /// The sizes as read, after cleaning or simplification, and after refinement, ready to be shown.
    pub summary: String,
    /// Vertices as read.
    pub input_vertices: usize,
    /// Faces as read.
    pub input_faces: usize,
    /// Vertices merged into a coincident one.
    pub welded_vertices: usize,
    /// Where copies of a vertex differ in the file's last digits: vertices closer than this, in the file's units, were
    /// merged.
    pub welded_within: Option<f64>,
    /// Faces dropped for a repeated vertex or (nearly) no area.
    pub degenerate_faces: usize,
    /// Faces without area that were taken out so that the surface stays closed.
    pub repaired_faces: usize,
    /// Faces dropped because the same three vertices have one already.
    pub duplicate_faces: usize,
    /// Vertices dropped because no face uses them.
    pub unreferenced_vertices: usize,
    /// Connected components after cleaning.
    pub components: usize,
    /// Components left out.
    pub components_dropped: usize,
    /// Share of the area left out with them, 0 to 1.
    pub area_dropped: f64,
    /// Edges with more than two faces.
    pub non_manifold_edges: usize,
    /// Edges with one face, after small holes were closed.
    pub boundary_edges: usize,
    /// Boundary loops closed.
    pub holes_filled: usize,
    /// Vertices before simplification, where the mesh was simplified.
    pub simplified_from: Option<usize>,
    /// Vertices that carry signatures, before a coarse mesh is refined.
    pub vertices: usize,
    /// Vertices after refinement, where a coarse mesh was refined for its spectrum.
    pub refined_to: Option<usize>,
    /// Faces of the prepared mesh, before a coarse mesh is refined.
    pub faces: usize,
    /// Surface area in the file's squared units.
    pub area: f64,
    /// Length of the boundary's loops over the root of the area: 0 for a closed surface, 8 to 16 for a single view.
    pub openness: f64,
    /// What may change a result, one sentence each. Simplification and refinement are normal: see `simplified_from` and
    /// `refined_to`.
    pub warnings: Vec<String>,
}

impl From<PrepareReport> for ReportDto {
    fn from(report: PrepareReport) -> Self {
        Self {
            summary: summary(&report),
            input_vertices: report.input_vertices,
            input_faces: report.input_faces,
            welded_vertices: report.welded_vertices,
            welded_within: report.welded_within,
            degenerate_faces: report.degenerate_faces,
            repaired_faces: report.repaired_faces,
            duplicate_faces: report.duplicate_faces,
            unreferenced_vertices: report.unreferenced_vertices,
            components: report.components,
            components_dropped: report.components_dropped,
            area_dropped: report.area_dropped,
            non_manifold_edges: report.non_manifold_edges,
            boundary_edges: report.boundary_edges,
            holes_filled: report.holes_filled,
            simplified_from: report.simplified_from,
            vertices: report.vertices,
            refined_to: report.refined_to,
            faces: report.faces,
            area: report.area,
            openness: report.openness,
            warnings: report.warnings,
        }
    }
}

/// What was read, and the normal steps that changed its size.
fn summary(report: &PrepareReport) -> String {
    let mut text = format!(
        "{} vertices and {} faces",
        report.input_vertices, report.input_faces
    );
    if report.simplified_from.is_some() {
        text += &format!(", simplified to {} vertices", report.vertices);
    } else if report.vertices != report.input_vertices {
        text += &format!(", cleaned to {} vertices", report.vertices);
    }
    if let Some(to) = report.refined_to {
        text += &format!(", refined to {to} vertices for the spectrum");
    }
    text
}

/// Which pose of an animated file a shape is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct PoseDto {
    /// Clip and moment, for people: `Gallop@0.50`.
    pub label: String,
    /// Which of the sampled poses, from 0.
    pub index: usize,
    /// How many poses were sampled from the file.
    pub of: usize,
}

impl From<ShapePose> for PoseDto {
    fn from(pose: ShapePose) -> Self {
        Self {
            label: pose.label,
            index: pose.index,
            of: pose.of,
        }
    }
}

/// A file that was sent with a shape and belongs to it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct CompanionDto {
    /// The name it was sent under.
    pub name: String,
    /// BLAKE3 of its bytes.
    pub hash: String,
}

/// A training shape.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ShapeDto {
    /// Never changes.
    pub id: String,
    /// The class's id.
    pub class: String,
    /// The name its file was sent under.
    pub name: Option<String>,
    /// `obj`, `gltf`, `glb`, `ply`, `stl` or `off`.
    pub format: String,
    /// The file's length, its companions included.
    pub bytes: u64,
    /// BLAKE3 of the file's bytes, 64 hexadecimal digits.
    pub hash: String,
    /// Files that were sent with it and belong to it.
    pub companions: Vec<CompanionDto>,
    /// Which pose of the file, where poses were asked for.
    pub pose: Option<PoseDto>,
    /// What preparing did when it was uploaded.
    pub report: ReportDto,
    /// Where its file can be downloaded.
    pub original: String,
    /// RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub created_at: String,
}

impl From<Shape> for ShapeDto {
    fn from(shape: Shape) -> Self {
        Self {
            id: shape.id.to_string(),
            class: shape.class.to_string(),
            name: shape.name,
            format: shape.format.extension().to_owned(),
            bytes: shape.bytes,
            hash: shape.content.to_string(),
            companions: shape
                .companions
                .into_iter()
                .map(|c| CompanionDto {
                    name: c.name,
                    hash: c.content.to_string(),
                })
                .collect(),
            pose: shape.pose.map(Into::into),
            report: shape.report.into(),
            original: format!("/v1/classes/{}/shapes/{}/original", shape.class, shape.id),
            created_at: time(shape.created_at),
        }
    }
}

/// A shape of an upload.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct UploadedShape {
    /// Whether the class had the same bytes and pose already; nothing was added then.
    pub existing: bool,
    /// The shape.
    #[serde(flatten)]
    pub shape: ShapeDto,
}

impl From<AddedShape> for UploadedShape {
    fn from(added: AddedShape) -> Self {
        Self {
            existing: !added.created,
            shape: added.shape.into(),
        }
    }
}

/// What an upload led to. Everything was stored, or the answer is a problem and nothing was.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct UploadResult {
    /// The class afterwards.
    pub class: ClassDto,
    /// One entry per mesh or pose, in the order they were sent.
    pub shapes: Vec<UploadedShape>,
    /// Files that were neither meshes nor buffers, such as materials and textures.
    pub ignored: Vec<String>,
}
