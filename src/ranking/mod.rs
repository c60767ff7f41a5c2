//! Codes → class scores → ranking, and the in-memory index a query runs against.

pub mod error;
pub mod index;
pub mod score;
pub mod view;

pub use error::RankingError;
pub use index::{Index, IndexedClass, IndexedShape};
pub use score::{ClassScore, Ranking, ShapeScore, rank};
pub use view::View;
