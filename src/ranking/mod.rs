//! Codes → class scores → ranking, and the in-memory index a query runs against.

mod anchors;
mod bound;
pub mod calibration;
mod coarse;
pub mod error;
pub mod index;
pub mod rank;
pub mod score;
mod search;
pub mod view;

pub use calibration::{Calibration, SIGNIFICANCE, Verdict};
pub use error::RankingError;
pub use index::{Index, IndexedClass, IndexedShape};
pub use rank::{ClassScore, Ranking, ShapeScore, rank, rank_top};
pub use score::{Errors, PreparedView, Score, prepare_views, score};
pub use view::View;
