//! Why bytes did not become a mesh. Every variant is one stable problem code of the API.

use super::Format;
use crate::cancel::Cancelled;
use crate::memory::MemoryError;

/// Why a file could not be read or a mesh could not be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// Nothing was sent.
    #[error("the file is empty; send a mesh as OBJ, glTF, GLB, PLY, STL or OFF")]
    Empty,
    /// Neither the bytes, nor the declared type, nor the name tell a format we read.
    #[error("the format was not recognised; shapelex reads OBJ, glTF, GLB, PLY, STL and OFF")]
    UnknownFormat,
    /// The bytes are not what their format demands.
    #[error("not a readable {format} file: {detail}")]
    Malformed {
        /// The format it was read as.
        format: Format,
        /// What is wrong, and where.
        detail: String,
    },
    /// The file ends before what its header promises.
    #[error("the {format} file is cut short: {detail}")]
    Truncated {
        /// The format it was read as.
        format: Format,
        /// What is missing.
        detail: String,
    },
    /// The file needs something we do not do, named as its format names it.
    #[error(
        "the {format} file needs {feature}, which shapelex does not support; {}",
        instead_of(feature)
    )]
    Unsupported {
        /// The format it was read as.
        format: Format,
        /// What it needs.
        feature: String,
    },
    /// A glTF points to a file that did not come with it.
    #[error(
        "the glTF file refers to '{uri}', which is missing; put it beside the file (over HTTP, send it in the same multipart request or archive), or export a GLB"
    )]
    MissingBuffer {
        /// Its address, as the file has it.
        uri: String,
    },
    /// A face points outside the vertex list.
    #[error("face {face} refers to vertex {index}, but there are {vertices} vertices")]
    IndexOutOfRange {
        /// The face, from 0.
        face: usize,
        /// The vertex it refers to, from 0.
        index: i64,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} has a coordinate that is not a finite number")]
    NotFinite {
        /// The vertex, from 0.
        vertex: usize,
    },
    /// There are points but no faces.
    #[error("the file has {vertices} vertices and no faces; shapelex needs a surface, not a point cloud")]
    NoFaces {
        /// How many vertices there are.
        vertices: usize,
    },
    /// The default scene of a glTF has no node that shows a mesh.
    #[error(
        "the file's scene shows none of its {meshes} meshes; add them to the scene that is shown first, and export it again"
    )]
    EmptyScene {
        /// Meshes of the file.
        meshes: usize,
    },
    /// Fewer vertices or faces than a spectrum needs, after cleaning.
    #[error(
        "only {vertices} vertices and {faces} faces are left after cleaning; a shape needs at least 4 vertices and 2 faces"
    )]
    TooSmall {
        /// Vertices that are left.
        vertices: usize,
        /// Faces that are left.
        faces: usize,
    },
    /// All faces have zero area.
    #[error("every face is degenerate (zero area or repeated vertices)")]
    Degenerate,
    /// The mesh falls into pieces of which only a small part would be kept.
    #[error(
        "the mesh is not connected: {dropped} of {parts} separate parts, {percent:.0} % of the surface, would be left out; connect the parts (weld their vertices), or set components to all, which keeps those of at least 1 % of it"
    )]
    Disconnected {
        /// Connected components.
        parts: usize,
        /// Components that would be left out.
        dropped: usize,
        /// Their share of the area, in percent.
        percent: f64,
    },
    /// Simplification to the working size would leave no face with an area.
    #[error(
        "the mesh cannot be simplified from {vertices} to {size} vertices, as too many of its faces are thin or apart; raise working_size or set it to 0"
    )]
    NotSimplified {
        /// Vertices before simplification.
        vertices: usize,
        /// Vertices asked for.
        size: usize,
    },
    /// More than the limits allow.
    #[error("the mesh has {found} {what}, more than the limit of {limit}")]
    TooLarge {
        /// What is counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many are allowed.
        limit: usize,
    },
    /// Poses were asked of a file that has no animation.
    #[error("poses were asked for, but the file has no animation")]
    NoAnimation,
    /// Its memory was not granted.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A [`TriMesh`](super::TriMesh) was built from arrays that break its invariants.
    #[error("invalid mesh: {detail}")]
    Invalid {
        /// Which invariant, and where.
        detail: String,
    },
}

/// What to do about a feature that is not supported.
fn instead_of(feature: &str) -> &'static str {
    match feature {
        "glTF 1.0" => "export it as glTF 2.0",
        _ => "re-export it without",
    }
}

impl MeshError {
    /// A [`MeshError::Malformed`] with these words.
    pub(super) fn malformed(format: Format, detail: impl Into<String>) -> Self {
        Self::Malformed {
            format,
            detail: detail.into(),
        }
    }

    /// What an error of words means where the file has `lines` lines for more `elements`, nearly one for each: its end
    /// is missing, and words were taken for what they are not.
    pub(super) fn unless_cut_short(self, format: Format, lines: usize, elements: usize) -> Self {
        match self {
            Self::Malformed { .. } | Self::IndexOutOfRange { .. }
                if lines < elements && lines > elements / 2 =>
            {
                Self::truncated(
                    format,
                    format!(
                        "its header promises {elements} elements, but only {lines} lines follow ({self})"
                    ),
                )
            }
            other => other,
        }
    }

    /// A [`MeshError::Truncated`] with these words.
    pub(super) fn truncated(format: Format, detail: impl Into<String>) -> Self {
        Self::Truncated {
            format,
            detail: detail.into(),
        }
    }
}
