//! How well a class fits shapes of its own that it was learnt without: what confidence is calibrated by.

use super::{Description, PipelineError, learn_model};
use crate::cancel::Cancel;
use crate::parameters::{Hypothesis, Parameters, RankBy};
use crate::ranking::{View, prepare_views, score};

/// Folds at most. More follow the class's final dictionary more closely and cost a dictionary each.
const FOLDS: usize = 10;

/// Scores of a class's training shapes, each under dictionaries learnt from the other folds' shapes; in no particular
/// order, but for open ones, which say nothing of whole shapes and are not judged. Empty for a single shape, and with a
/// ranking by Eq. 5, whose error grows with the number of vertices, so that one shape's says nothing of another's.
///
/// # Errors
/// As [`learn_model`] and [`score`].
pub fn held_out_scores(
    shapes: &[&Description],
    parameters: &Parameters,
    cancel: &Cancel,
) -> Result<Vec<f64>, PipelineError> {
    if parameters.rank_by == RankBy::Frobenius || shapes.len() < 2 {
        return Ok(Vec::new());
    }
    let folds = shapes.len().min(FOLDS);
    let mut scores = Vec::with_capacity(shapes.len());
    for fold in 0..folds {
        let (held, rest): (Vec<_>, Vec<_>) = shapes.iter().enumerate().partition(|(i, _)| i % folds == fold);
        let rest: Vec<&Description> = rest.into_iter().map(|(_, shape)| *shape).collect();
        let model = learn_model(&rest, parameters, cancel, &|_, _| ())?;
        for (_, shape) in held.into_iter().filter(|(_, s)| !s.report.is_open()) {
            // A training shape's view on the fixed grid is there to be learnt from; as a query it would be open.
            let views: Vec<View> = shape
                .views
                .iter()
                .filter(|view| view.hypothesis != Hypothesis::Doubled)
                .cloned()
                .collect();
            let prepared = prepare_views(&views, parameters.rank_by)?;
            let score = score(
                &prepared,
                &model.dictionaries,
                parameters.lambda,
                parameters.rank_by,
                "held out",
                cancel,
            )?;
            scores.push(score.value);
        }
    }
    Ok(scores)
}
