//! How right the method is on labelled shapes.

pub mod deform;
pub mod evaluate;
pub mod protocol;

pub use evaluate::{Evaluation, LabelledShape, QueryResult, evaluate};
pub use protocol::{Protocol, Round, rounds};
