//! Datasets on the wire.

use super::class::ClassDto;
use super::shape::UploadedShape;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

/// How a dataset is uploaded.
#[derive(Clone, Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct DatasetQuery {
    /// Sample this many poses of every animated glTF instead of reading its resting pose.
    #[param(minimum = 1, maximum = 64)]
    pub poses: Option<usize>,
}

/// A class of an uploaded dataset.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct DatasetClass {
    /// Whether the class was made; `false` where it existed.
    pub created: bool,
    /// The class afterwards.
    pub class: ClassDto,
    /// One entry per mesh or pose, in the archive's order. The shapes' names are their paths below the class's folder.
    pub shapes: Vec<UploadedShape>,
}

/// What uploading a dataset led to. Everything was stored, or the answer is a problem and nothing was.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct DatasetResult {
    /// Classes that were made.
    pub classes_created: usize,
    /// Shapes that were added.
    pub shapes_created: usize,
    /// Shapes that were there already.
    pub shapes_existing: usize,
    /// The classes of the archive, in its order.
    pub classes: Vec<DatasetClass>,
    /// Files that were neither meshes nor buffers, such as materials and notes.
    pub ignored: Vec<String>,
}
