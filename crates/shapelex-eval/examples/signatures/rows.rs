//! Scores of queries under the classes of their round.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One query's scores.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// Position of its round.
    pub round: usize,
    /// Position of its shape in the set.
    pub shape: usize,
    /// Class → score, smaller is better.
    pub scores: BTreeMap<String, f64>,
}

/// What a signature says of a set.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Rows {
    /// The queries.
    pub queries: Vec<Row>,
    /// The shapes that tell how well it separates.
    pub probes: Vec<Row>,
}
