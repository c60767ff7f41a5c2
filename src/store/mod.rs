//! The durable store. CONTRACT STAGE.

pub mod error;

pub use error::StoreError;

use crate::model::*;
use crate::parameters::Parameters;
use crate::ranking::Index;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a store is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoreOptions {
    /// Page cache of the key-value store, in bytes.
    pub cache_bytes: u64,
}

impl Default for StoreOptions {
    /// 64 MiB.
    fn default() -> Self {
        Self {
            cache_bytes: 64 << 20,
        }
    }
}

/// Whether the store takes writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Health {
    /// It does.
    Ready,
    /// A write failed, so it no longer does.
    ReadOnly {
        /// The failure.
        why: String,
    },
}

/// What the store holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Classes.
    pub classes: u64,
    /// Training shapes.
    pub shapes: u64,
    /// Bytes of the shapes' files; a file several shapes came from counts for each.
    pub bytes: u64,
}

/// What adding a shape led to.
#[derive(Clone, Debug, PartialEq)]
pub struct AddedShape {
    /// The shape.
    pub shape: Shape,
    /// Whether it is new; `false` where the class had the same file and pose already.
    pub created: bool,
}

/// The durable store: classes, training shapes with their files, generations of the index, jobs. Cheap to clone;
/// every clone is the same store. All methods block on the disk: call them from `spawn_blocking`.
#[derive(Clone)]
pub struct Store(Arc<()>);

const STUB: fn() -> StoreError = || StoreError::ReadOnly {
    why: "not yet".into(),
};

#[allow(missing_docs, unused_variables)]
impl Store {
    pub fn open(path: &Path, options: &StoreOptions) -> Result<Self, StoreError> {
        Err(STUB())
    }
    pub fn path(&self) -> &Path {
        Path::new("")
    }
    pub fn health(&self) -> Health {
        Health::Ready
    }
    /// Lines that say what was recovered at open; empty where nothing had to be.
    pub fn recovery(&self) -> &[String] {
        &[]
    }
    pub fn statistics(&self) -> Result<Statistics, StoreError> {
        Err(STUB())
    }
    pub fn create_class(&self, name: ClassName) -> Result<Class, StoreError> {
        Err(STUB())
    }
    pub fn class(&self, id: ClassId) -> Result<Class, StoreError> {
        Err(STUB())
    }
    pub fn class_by_name(&self, name: &ClassName) -> Result<Option<Class>, StoreError> {
        Err(STUB())
    }
    /// By identifier (that is, by creation), those greater than `after`, at most `limit`.
    pub fn list_classes(&self, after: Option<ClassId>, limit: usize) -> Result<Vec<Class>, StoreError> {
        Err(STUB())
    }
    pub fn rename_class(&self, id: ClassId, name: ClassName) -> Result<Class, StoreError> {
        Err(STUB())
    }
    /// With its shapes; originals nobody else refers to are removed. Returns the class as it was.
    pub fn delete_class(&self, id: ClassId) -> Result<Class, StoreError> {
        Err(STUB())
    }
    /// All or none. One answer per new shape, in order.
    pub fn add_shapes(&self, class: ClassId, shapes: Vec<NewShape>) -> Result<Vec<AddedShape>, StoreError> {
        Err(STUB())
    }
    pub fn shape(&self, id: ShapeId) -> Result<Shape, StoreError> {
        Err(STUB())
    }
    /// By identifier, those greater than `after`, at most `limit`.
    pub fn list_shapes(
        &self,
        class: ClassId,
        after: Option<ShapeId>,
        limit: usize,
    ) -> Result<Vec<Shape>, StoreError> {
        Err(STUB())
    }
    pub fn delete_shape(&self, id: ShapeId) -> Result<Shape, StoreError> {
        Err(STUB())
    }
    /// Path of a stored file, for streaming.
    pub fn original_path(&self, content: ContentHash) -> PathBuf {
        PathBuf::new()
    }
    /// A stored file, checked against its hash.
    pub fn original(&self, content: ContentHash) -> Result<Vec<u8>, StoreError> {
        Err(STUB())
    }
    pub fn generation(&self) -> Result<Option<Generation>, StoreError> {
        Err(STUB())
    }
    /// The parameters a reindex without parameters of its own uses: the index's last ones, else the default preset.
    pub fn parameters(&self) -> Result<Parameters, StoreError> {
        Err(STUB())
    }
    pub fn load_index(&self, generation: &Generation) -> Result<Index, StoreError> {
        Err(STUB())
    }
    pub fn flush(&self) -> Result<(), StoreError> {
        Err(STUB())
    }
}
