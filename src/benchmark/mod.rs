//! How right the method is on labelled shapes.

pub mod deform;
pub mod evaluate;
pub mod measures;
pub mod open_set;
pub mod paper;
pub mod protocol;
pub mod report;

pub use evaluate::{Evaluation, LabelledShape, QueryResult, evaluate};
pub use measures::RetrievalMeasures;
pub use open_set::{OpenSet, Share, evaluate_open_set};
pub use protocol::{Protocol, Round, rounds};
pub use report::BenchmarkReport;
