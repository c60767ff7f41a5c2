//! How classes are ordered.

use crate::baseline::Baseline;
use crate::parameters::RankBy;

/// The method a query's classes are ranked by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RankingMethod {
    /// Sparse coding of the query's signatures under each class's dictionary, by this error.
    SparseCoding(RankBy),
    /// The distance to the class's nearest training shape.
    Baseline(Baseline),
}

impl From<RankBy> for RankingMethod {
    fn from(rank_by: RankBy) -> Self {
        Self::SparseCoding(rank_by)
    }
}
