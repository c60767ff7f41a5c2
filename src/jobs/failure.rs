//! Why a reindex ended early, and the stable names of failures.

use crate::model::JobFailure;
use crate::store::StoreError;
use shapelex_core::memory::MemoryError;
use shapelex_core::mesh::MeshError;
use shapelex_core::pipeline::PipelineError;
use std::any::Any;

/// Why a reindex ended early.
#[derive(Debug)]
pub(super) enum ReindexError {
    /// Somebody asked it to stop.
    Cancelled,
    /// It cannot be done now, for want of what others will give back.
    Later(String),
    /// It cannot be done.
    Failed(JobFailure),
}

impl ReindexError {
    pub(super) fn failed(code: &str, detail: impl Into<String>) -> Self {
        Self::Failed(JobFailure {
            code: code.to_owned(),
            detail: detail.into(),
        })
    }
}

impl From<StoreError> for ReindexError {
    fn from(error: StoreError) -> Self {
        let code = match &error {
            StoreError::OutOfDescriptors { .. } => return Self::Later(error.to_string()),
            StoreError::Full { .. } => "storage_full",
            StoreError::ReadOnly { .. } => "storage_read_only",
            StoreError::Denied { .. } => "storage_denied",
            StoreError::Damaged { .. } => "storage_damaged",
            _ => "storage_failed",
        };
        Self::failed(code, error.to_string())
    }
}

/// The code of what does not fit the memory for reindexing.
pub(super) const MEMORY_EXCEEDED: &str = "memory_exceeded";

/// Says what does not fit, by how much, and what to do.
pub(super) fn no_memory(what: &str, error: &MemoryError) -> String {
    format!("{what}: {error}; lower the parameters or raise --indexing-memory-mib")
}

/// The stable name of a stage's failure.
pub(super) fn code(error: &PipelineError) -> &'static str {
    match error {
        PipelineError::Cancelled(_) => "cancelled",
        PipelineError::Mesh(MeshError::Memory(_)) => MEMORY_EXCEEDED,
        PipelineError::Mesh(_) => "mesh_unusable",
        PipelineError::Spectral(_) => "spectrum_failed",
        PipelineError::Coding(_) => "coding_failed",
        PipelineError::Ranking(_) => "ranking_failed",
        PipelineError::Parameter(_) => "invalid_parameters",
    }
}

/// What a panic said.
pub(super) fn panic_text(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}
