//! Codes → class scores → ranking, and the in-memory index a query runs against.

mod anchors;
mod bound;
pub mod calibration;
mod candidate;
mod coarse;
pub mod error;
pub mod index;
pub mod not_judged;
pub mod rank;
pub mod score;
mod search;
pub mod verdict;
pub mod view;

pub use calibration::{Calibration, HeldOut, Judgement, SIGNIFICANCE};
pub use error::RankingError;
pub use index::{Index, IndexedClass, IndexedShape};
pub use not_judged::NotJudged;
pub use rank::{ClassScore, Ranking, ShapeScore, rank, rank_top, rank_until};
pub use score::{Errors, PreparedView, Score, prepare_views, score};
pub use verdict::{Candidate, JUDGED, Verdict, VerdictKind};
pub use view::View;
