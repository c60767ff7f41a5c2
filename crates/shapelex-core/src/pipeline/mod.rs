//! The data flow and nothing else. The command line, the indexing worker and the query handler all call these three
//! functions, so there is one way to do each: [`describe_shape`] / [`describe_query`] (bytes or mesh → signatures),
//! [`learn_model`] (signatures → dictionaries) and [`rank`] (signatures × index → ranking).

pub mod describe;
pub mod description;
pub mod error;
pub mod estimate;
mod fixed_grid;
pub mod held_out;
pub mod learn;
mod near_copies;
pub mod prepared;
pub mod stage;
pub mod views;
pub mod within;

pub use describe::{
    describe_both, describe_plain, describe_plain_within, describe_query, describe_query_within,
    describe_shape, describe_shape_within,
};
pub use description::Description;
pub use error::PipelineError;
pub use held_out::{HeldOutScores, held_out_scores};
pub use learn::{Model, ModelReport, learn_model};
pub use prepared::PreparedShape;
pub use stage::{Stage, StageSpan};
pub use within::Within;
