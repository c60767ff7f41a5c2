//! One query's answer, and whether it is right.

use serde::{Deserialize, Serialize};

/// One query's answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct QueryResult {
    /// The true class.
    pub class: String,
    /// The shape's name.
    pub name: String,
    /// All classes of the round with their scores, best first.
    pub ranked: Vec<(String, f64)>,
    /// Whether the best class is the true one or counts as the same.
    pub correct: bool,
    /// Position of the first class that counts as true, 1 for the best.
    pub true_rank: usize,
    /// (best score among the true − best score among the false) / the latter: above 0 where it was mistaken, the
    /// larger the worse.
    pub error_margin: f64,
}

/// Whether an answer of class `answered` to a query of class `class` counts as right.
pub fn counts_as(class: &str, answered: &str, same: &[Vec<String>]) -> bool {
    let within = |group: &Vec<String>, name: &str| group.iter().any(|c| c == name);
    class == answered || same.iter().any(|g| within(g, class) && within(g, answered))
}
