//! Class scores → ranking.

use super::candidate::{Candidate, Measure};
use super::score::{Score, measure, prepare_views};
use super::search::{Scored, Search};
use super::{Index, RankingError, View};
use crate::cancel::{Cancel, Cancelled};
use crate::coding::CodingError;
use crate::parameters::{Hypothesis, RankBy};
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

/// How well one training shape regenerates a query (docs/method.md#ranking).
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
    /// The classes, best first: all, or as many as were asked for.
    pub classes: Vec<ClassScore>,
    /// Shapes with a dictionary of their own, best first; empty where the index has none.
    pub shapes: Vec<ShapeScore>,
    /// Relative margin of the best class to the runner-up, 0 to 1; 1 where there is only one.
    pub confidence: f64,
    /// Signatures that were coded, of the plain view.
    pub signatures: usize,
    /// Classes in the index.
    pub compared: usize,
    /// Classes of these that a lower bound of their score left out; the query's signatures were coded under the
    /// dictionaries of the others.
    pub pruned: usize,
    /// Labels of the classes that there was no time for; empty but for [`rank_until`].
    pub not_compared: Vec<String>,
}

/// Codes a query under every dictionary of the index and orders the classes (docs/method.md#ranking; Eq. 5).
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
    ranking(views, index, rank_by, Extent::All, cancel)
}

/// As [`rank`], but only the `top` best classes and shapes, exactly as they stand in the full ranking.
///
/// Among many, most are left out by a lower bound of their score that exceeds the scores of enough others. Eq. 5 has no
/// such bound; ranked by it, all are coded.
///
/// # Errors
/// As [`rank`].
pub fn rank_top(
    views: &[View],
    index: &Index,
    rank_by: RankBy,
    top: usize,
    cancel: &Cancel,
) -> Result<Ranking, RankingError> {
    ranking(views, index, rank_by, Extent::Top(top), cancel)
}

/// As [`rank`], but of as many classes as there is time for until `passed` is set, each scored exactly as in [`rank`].
/// The others are named in [`Ranking::not_compared`], in the order of the index.
///
/// # Errors
/// As [`rank`]; cancelled where not even one class was scored.
pub fn rank_until(
    views: &[View],
    index: &Index,
    rank_by: RankBy,
    passed: &Cancel,
) -> Result<Ranking, RankingError> {
    ranking(views, index, rank_by, Extent::InTime, passed)
}

/// How much of the index is ranked.
#[derive(Clone, Copy)]
enum Extent {
    /// All of it.
    All,
    /// The best so many.
    Top(usize),
    /// What is scored before the flag is set.
    InTime,
}

impl Extent {
    /// How many classes or shapes are answered at most.
    fn limit(self) -> usize {
        match self {
            Self::Top(top) => top,
            Self::All | Self::InTime => usize::MAX,
        }
    }

    fn search(self, search: &Search<'_>, candidates: &[Candidate<'_>]) -> Result<Scored, RankingError> {
        match self {
            Self::All => search.best(candidates, None),
            // One more than asked for, because the last one's margin is against it.
            Self::Top(top) => search.best(candidates, Some(top.saturating_add(1))),
            Self::InTime => search.in_time(candidates),
        }
    }
}

fn ranking(
    views: &[View],
    index: &Index,
    rank_by: RankBy,
    extent: Extent,
    cancel: &Cancel,
) -> Result<Ranking, RankingError> {
    if index.classes.is_empty() {
        return Err(RankingError::EmptyIndex);
    }
    let prepared = prepare_views(views, rank_by)?;
    let search = Search {
        views: &prepared,
        measure: Measure {
            lambda: index.parameters.lambda,
            rank_by: measure(&prepared, rank_by),
            cancel,
        },
    };
    let candidates: Vec<_> = index
        .classes
        .iter()
        .map(|class| Candidate {
            label: &class.label,
            dictionaries: &class.dictionaries,
        })
        .collect();
    let found = extent.search(&search, &candidates)?;
    if found.is_empty() {
        return Err(CodingError::Cancelled(Cancelled).into());
    }
    let not_compared = match extent {
        Extent::InTime => left_out(&candidates, &found),
        Extent::All | Extent::Top(_) => Vec::new(),
    };
    let mut classes: Vec<ClassScore> = found
        .iter()
        .map(|(i, score)| class_score(candidates[*i].label, score))
        .collect();
    for i in 1..classes.len() {
        classes[i - 1].margin = Some(margin(classes[i - 1].score, classes[i].score));
    }
    let (owners, candidates): (Vec<_>, Vec<_>) = index
        .classes
        .iter()
        .flat_map(|class| class.shapes.iter().map(move |shape| (class, shape)))
        .map(|(class, shape)| {
            let candidate = Candidate {
                label: &shape.label,
                dictionaries: &shape.dictionaries,
            };
            (class, candidate)
        })
        .unzip();
    let mut shapes: Vec<ShapeScore> = extent
        .search(&search, &candidates)?
        .iter()
        .map(|(i, score)| ShapeScore {
            class: owners[*i].label.clone(),
            label: candidates[*i].label.to_owned(),
            score: score.value,
            frobenius_error: score.plain.frobenius,
            hypothesis: score.hypothesis,
        })
        .collect();
    let coded = classes.len();
    let confidence = classes[0].margin.unwrap_or(1.0);
    classes.truncate(extent.limit());
    shapes.truncate(extent.limit());
    let signatures = views
        .iter()
        .find(|v| v.hypothesis == Hypothesis::Plain)
        .map_or(0, |v| v.signatures.len());
    Ok(Ranking {
        classes,
        shapes,
        confidence,
        signatures,
        compared: index.classes.len() - not_compared.len(),
        pruned: index.classes.len() - not_compared.len() - coded,
        not_compared,
    })
}

/// Labels of the candidates that were not found, in their order.
fn left_out(candidates: &[Candidate<'_>], found: &Scored) -> Vec<String> {
    let mut scored = vec![false; candidates.len()];
    for (i, _) in found {
        scored[*i] = true;
    }
    let left = candidates.iter().zip(scored).filter(|(_, scored)| !scored);
    left.map(|(candidate, _)| candidate.label.to_owned()).collect()
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
