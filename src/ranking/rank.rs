//! Class scores → ranking.

use super::score::{Score, prepare_views, score};
use super::{Index, RankingError, View};
use crate::cancel::Cancel;
use crate::parameters::{Hypothesis, RankBy};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How well one class regenerates a query.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClassScore {
    /// The class's label in the index.
    pub label: String,
    /// What the ranking is ordered by, ascending: one of the errors below, by `rank_by`, with the hypotheses' offsets.
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

/// How well one training shape regenerates a query (method, step 9).
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
    /// The hypothesis the score comes from.
    pub hypothesis: Hypothesis,
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
    /// Signatures that were coded, of the plain view.
    pub signatures: usize,
}

/// Codes a query under every dictionary of the index and orders the classes (method, steps 8 to 10; Eq. 5).
///
/// Classes are coded in parallel on the current rayon pool; each is computed on its own, so the result does not depend
/// on the number of threads. Ties are broken by label, so it does not depend on the order of the index either.
///
/// # Errors
/// [`RankingError::EmptyIndex`] without classes; [`RankingError::MissingChannel`] where a class has no dictionary for
/// a view's channel; [`RankingError::NoPlainView`] without a plain view; [`RankingError::Coding`] where coding failed
/// or was cancelled.
pub fn rank(
    views: &[View],
    index: &Index,
    rank_by: RankBy,
    cancel: &Cancel,
) -> Result<Ranking, RankingError> {
    if index.classes.is_empty() {
        return Err(RankingError::EmptyIndex);
    }
    let lambda = index.parameters.lambda;
    let prepared = prepare_views(views, rank_by)?;
    let mut classes = index
        .classes
        .par_iter()
        .map(|class| {
            let s = score(
                &prepared,
                &class.dictionaries,
                lambda,
                rank_by,
                &class.label,
                cancel,
            )?;
            Ok(class_score(&class.label, &s))
        })
        .collect::<Result<Vec<_>, RankingError>>()?;
    classes.sort_by(|a, b| a.score.total_cmp(&b.score).then_with(|| a.label.cmp(&b.label)));
    for i in 1..classes.len() {
        classes[i - 1].margin = Some(margin(classes[i - 1].score, classes[i].score));
    }
    let mut shapes = index
        .classes
        .par_iter()
        .flat_map(|class| class.shapes.par_iter().map(move |shape| (class, shape)))
        .map(|(class, shape)| {
            let s = score(
                &prepared,
                &shape.dictionaries,
                lambda,
                rank_by,
                &shape.label,
                cancel,
            )?;
            Ok(ShapeScore {
                class: class.label.clone(),
                label: shape.label.clone(),
                score: s.value,
                frobenius_error: s.plain.frobenius,
                hypothesis: s.hypothesis,
            })
        })
        .collect::<Result<Vec<_>, RankingError>>()?;
    shapes.sort_by(|a, b| a.score.total_cmp(&b.score).then_with(|| a.label.cmp(&b.label)));
    let confidence = classes[0].margin.unwrap_or(1.0);
    let signatures = views
        .iter()
        .find(|v| v.hypothesis == Hypothesis::Plain)
        .map_or(0, |v| v.signatures.len());
    Ok(Ranking {
        classes,
        shapes,
        confidence,
        signatures,
    })
}

fn class_score(label: &str, s: &Score) -> ClassScore {
    ClassScore {
        label: label.to_owned(),
        score: s.value,
        frobenius_error: s.plain.frobenius,
        relative_error: s.plain.relative,
        mean_objective: s.plain.mean_objective,
        trimmed_objective: s.plain.trimmed_objective,
        mean_nonzeros: s.plain.mean_nonzeros,
        hypothesis: s.hypothesis,
        margin: None,
    }
}

/// (next − score) / next, 0 where both are 0.
fn margin(score: f64, next: f64) -> f64 {
    if next > 0.0 { (next - score) / next } else { 0.0 }
}
