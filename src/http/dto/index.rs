//! The index on the wire.

use super::PageQuery;
use super::class::IndexState;
use super::parameters::ParametersDto;
use crate::model::Origin;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

/// Which classes of the index are shown.
#[derive(Clone, Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct IndexQuery {
    /// How many classes at most, 1 to 1000; 1000 where it is left out.
    #[param(minimum = 1, maximum = 1000, default = 1000)]
    pub limit: Option<usize>,
    /// `next_cursor` of the page before; the first page where it is left out.
    #[param(min_length = 1, pattern = "^[A-Za-z0-9_-]+$")]
    pub cursor: Option<String>,
}

impl From<IndexQuery> for PageQuery {
    fn from(query: IndexQuery) -> Self {
        Self {
            limit: query.limit.or(Some(1000)),
            cursor: query.cursor,
        }
    }
}

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
    /// Bytes of its dictionaries, as stored.
    pub bytes: u64,
    /// Bytes its dictionaries take in memory now. Those that are used first are kept ready for coding, which takes more,
    /// until 48 MiB are used up.
    pub resident_bytes: u64,
    /// Where its dictionaries come from; `null` where it has none.
    pub origin: Option<OriginName>,
    /// Shapes with a dictionary of their own.
    pub shape_dictionaries: usize,
}

/// Where the dictionaries of a class come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum OriginName {
    /// Learnt from the shapes of the class.
    Learnt,
    /// Imported from a file; reindexes keep it until the class gets shapes of its own or is deleted.
    Imported,
}

impl From<Origin> for OriginName {
    fn from(origin: Origin) -> Self {
        match origin {
            Origin::Learnt => Self::Learnt,
            Origin::Imported => Self::Imported,
        }
    }
}

/// How many classes stand how to the index, whatever the page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
pub struct IndexTotals {
    /// Classes of the catalogue.
    pub classes: usize,
    /// Classes whose dictionary is learnt from the shapes they have, or imported.
    pub current: usize,
    /// Classes whose shapes changed since they were learnt.
    pub stale: usize,
    /// Classes that have no dictionary.
    pub not_indexed: usize,
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
    /// The classes of the page, in the order of their ids; all of the catalogue where there are no more than `limit`.
    pub classes: Vec<IndexClass>,
    /// Pass it as `cursor` to get the next page; `null` at the end.
    pub next_cursor: Option<String>,
    /// Names of classes of the page whose shapes changed since they were learnt.
    pub stale: Vec<String>,
    /// Names of classes of the page that have no dictionary.
    pub not_indexed: Vec<String>,
    /// Counts over all classes, whatever the page.
    pub totals: IndexTotals,
    /// Bytes of all dictionaries, as stored.
    pub bytes: u64,
    /// Bytes that all dictionaries and what the baselines need take in memory now.
    pub resident_bytes: u64,
}
