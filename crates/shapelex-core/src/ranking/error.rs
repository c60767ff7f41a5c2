//! Why a query could not be ranked.

use crate::coding::CodingError;
use crate::parameters::Channel;

/// Why there is no ranking.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RankingError {
    /// Coding failed or was cancelled.
    #[error(transparent)]
    Coding(#[from] CodingError),
    /// There is no class with a dictionary to rank by.
    #[error("the index is empty: no class has a dictionary yet")]
    EmptyIndex,
    /// The query has no plain view, which every ranking starts from.
    #[error("the query was not described under the plain hypothesis")]
    NoPlainView,
    /// A class lacks the dictionary a view has to be coded under.
    #[error("class {class} has no dictionary for the {channel:?} channel")]
    MissingChannel {
        /// The class's label.
        class: String,
        /// The channel.
        channel: Channel,
    },
}
