//! How right the method is on labelled shapes.

pub mod class_measures;
pub mod deform;
pub mod evaluate;
pub mod measures;
pub mod method;
pub mod nearest;
pub mod open_set;
pub mod paper;
pub mod protocol;
pub mod query_result;
pub mod report;
pub mod retrieval;
pub mod robustness;
pub mod specimen;
pub mod unit;

pub use class_measures::{ClassMeasures, Estimate};
pub use evaluate::{Evaluation, LabelledShape, evaluate};
pub use measures::{RetrievalMeasures, wilson};
pub use method::Method;
pub use open_set::{AtLevel, OpenSet, Share, evaluate_open_set};
pub use protocol::{Protocol, Round, rounds};
pub use query_result::QueryResult;
pub use report::BenchmarkReport;
pub use robustness::{Category, Member, Robustness, robustness_rounds};
pub use specimen::Specimen;
pub use unit::{Outcome, Setting, Shapes, null_models, run_unit};
