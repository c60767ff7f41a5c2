//! The index on the wire.

use super::class::IndexState;
use super::parameters::ParametersDto;
use serde::Serialize;
use utoipa::ToSchema;

/// A class, as the index has it.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct IndexClass {
    /// The class's id.
    pub id: String,
    /// As it is called now.
    pub name: String,
    /// How it stands to the index.
    pub index_state: IndexState,
    /// Shapes in the class.
    pub shapes: u64,
    /// Shapes its dictionary was learnt from.
    pub shapes_learnt: usize,
    /// Atoms of its dictionaries.
    pub atoms: usize,
    /// Bytes of its dictionaries.
    pub bytes: u64,
    /// Shapes with a dictionary of their own.
    pub shape_dictionaries: usize,
}

/// The generation of the index that queries are answered from.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct IndexAnswer {
    /// Counts from 1; `null` before the first reindex.
    pub generation: Option<u64>,
    /// When it took over; RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub created_at: Option<String>,
    /// The parameters its dictionaries were learnt with.
    pub parameters: Option<ParametersDto>,
    /// Every class of the catalogue.
    pub classes: Vec<IndexClass>,
    /// Names of classes whose shapes changed since they were learnt.
    pub stale: Vec<String>,
    /// Names of classes that have no dictionary.
    pub not_indexed: Vec<String>,
    /// Bytes of all dictionaries.
    pub bytes: u64,
}
