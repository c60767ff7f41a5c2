//! Bytes → a clean triangle mesh.

pub mod boundary;
pub mod clean;
pub mod components;
pub mod context;
pub mod decimate;
pub mod detect;
pub mod double;
pub mod edges;
pub mod error;
pub mod gltf;
pub mod holes;
pub mod limits;
mod locality;
pub mod obj;
pub mod off;
pub mod orient;
mod pieces;
pub mod ply;
pub mod prepare;
pub mod read;
pub mod refine;
mod scan;
pub mod soup;
pub mod stl;
mod tangle;
pub mod trimesh;
pub mod weld;
pub mod whiten;

pub use context::{ReadContext, Warnings};
pub use detect::Format;
pub use error::MeshError;
pub use limits::Limits;
pub use prepare::{Components, PrepareOptions, PrepareReport, prepare, prepare_until};
pub use read::{Companion, Pose, Source, read, read_poses, read_poses_within, read_within};
pub use soup::TriangleSoup;
pub use trimesh::TriMesh;
