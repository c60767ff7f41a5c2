//! The query: a mesh and an index → classes, ranked and judged. The service and the command line both call
//! [`QueryEngine::run`].
//!
//! | step | from | to |
//! |---|---|---|
//! | describe | [`TriangleSoup`](crate::mesh::TriangleSoup) | [`Description`](crate::pipeline::Description): eigenpairs, then signatures, M × N per view |
//! | rank | signatures × dictionaries, or vectors × training shapes | classes and shapes, ordered by score |
//! | judge | scores and the scores of held-out training shapes | p-values, verdict |

pub mod deadline;
pub mod engine;
pub mod error;
pub mod index;
pub mod judge;
pub mod method;
pub mod outcome;
pub mod ranked;

pub use deadline::{AtDeadline, Deadline};
pub use engine::{QueryEngine, QuerySpec};
pub use error::QueryError;
pub use index::SearchIndex;
pub use method::RankingMethod;
pub use outcome::QueryOutcome;
pub use ranked::{RankedClass, RankedShape};
