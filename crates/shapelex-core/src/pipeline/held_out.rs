//! How well a class fits shapes of its own that it was learnt without: what answers are judged by.

use super::near_copies::groups;
use super::{Description, PipelineError, learn_model};
use crate::cancel::Cancel;
use crate::parameters::{Hypothesis, Parameters, RankBy};
use crate::ranking::{View, prepare_views, score};

/// Folds at most. More follow the class's final dictionary more closely and cost a dictionary each.
const FOLDS: usize = 10;

/// Scores of a class's shapes under dictionaries they were left out of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeldOutScores {
    /// Where their near copies were left out with them; in no particular order.
    pub distinct: Vec<f64>,
    /// Where they were not, because all shapes of the class are near copies of each other.
    pub copies: Vec<f64>,
}

/// Scores of a class's training shapes, each under dictionaries learnt from the other folds' shapes; near copies are in the
/// same fold. Open shapes have none: they say nothing of whole ones and are not judged. Empty for a single shape, and with
/// a ranking by Eq. 5, whose error grows with the number of vertices, so that one shape's says nothing of another's.
///
/// # Errors
/// As [`learn_model`] and [`score`].
pub fn held_out_scores(
    shapes: &[&Description],
    parameters: &Parameters,
    cancel: &Cancel,
) -> Result<HeldOutScores, PipelineError> {
    if parameters.rank_by == RankBy::Frobenius || shapes.len() < 2 {
        return Ok(HeldOutScores::default());
    }
    let groups = groups(shapes);
    let distinct = groups.iter().any(|group| *group != groups[0]);
    let groups = if distinct {
        groups
    } else {
        (0..shapes.len()).collect()
    };
    let scores = scores(shapes, &groups, parameters, cancel)?;
    Ok(if distinct {
        HeldOutScores {
            distinct: scores,
            copies: Vec::new(),
        }
    } else {
        HeldOutScores {
            distinct: Vec::new(),
            copies: scores,
        }
    })
}

/// Scores of the shapes, those of one group (numbered from 0) in the same fold.
fn scores(
    shapes: &[&Description],
    groups: &[usize],
    parameters: &Parameters,
    cancel: &Cancel,
) -> Result<Vec<f64>, PipelineError> {
    let folds = FOLDS.min(1 + groups.iter().copied().max().unwrap_or(0));
    let mut scores = Vec::with_capacity(shapes.len());
    for fold in 0..folds {
        let all = shapes.iter().zip(groups);
        let (held, rest): (Vec<_>, Vec<_>) = all.partition(|(_, group)| *group % folds == fold);
        let rest: Vec<&Description> = rest.into_iter().map(|(shape, _)| *shape).collect();
        let model = learn_model(&rest, parameters, cancel, &|_, _| ())?;
        for (shape, _) in held.into_iter().filter(|(s, _)| !s.report.is_open()) {
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
