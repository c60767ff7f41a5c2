//! Codes → class scores → ranking, and the in-memory index a query runs against.

pub mod calibration;
pub mod error;
pub mod index;
pub mod rank;
pub mod score;
pub mod view;

pub use calibration::{Calibration, SIGNIFICANCE, Verdict};
pub use error::RankingError;
pub use index::{Index, IndexedClass, IndexedShape};
pub use rank::{ClassScore, Ranking, ShapeScore, rank};
pub use score::{Errors, PreparedView, Score, prepare_views, score};
pub use view::View;
