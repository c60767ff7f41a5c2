//! Shape against shape: who is nearest to whom, and how good the lists are.

use super::evaluate::{LabelledShape, Models};
use super::measures::RetrievalMeasures;
use super::query_result::counts_as;
use faer::Mat;
use rayon::prelude::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::{PipelineError, learn_model};
use shapelex_core::ranking::{Index, IndexedClass, View, rank};
use shapelex_core::signature::Signatures;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Shapes with a dictionary in memory at a time.
const TOGETHER: usize = 24;

/// Signatures of a query that are coded: shape against shape is many codings, and so many tell shapes apart as well
/// as all do.
const SIGNATURES: usize = 250;

/// `scores[i][j]`: how badly a dictionary of shape j alone regenerates query i (docs/method.md#ranking), by at most 250 of its
/// signatures; the smaller, the more alike. Not symmetric. `progress(done, total)` counts dictionaries and queries.
///
/// # Errors
/// The first error of learning or ranking.
pub fn coding_scores(
    shapes: &[LabelledShape],
    parameters: &Parameters,
    given: &Models,
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<Vec<f64>>, PipelineError> {
    let n = shapes.len();
    let mut scores = vec![vec![f64::INFINITY; n]; n];
    let total = n + n * n.div_ceil(TOGETHER);
    let done = AtomicUsize::new(0);
    let tick = || progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
    let all: Vec<usize> = (0..n).collect();
    let queries: Vec<Vec<View>> = shapes.par_iter().map(|s| thinned(&s.query.views)).collect();
    for chunk in all.chunks(TOGETHER) {
        let classes = chunk
            .par_iter()
            .map(|&j| {
                let model = match given.get(&vec![j]) {
                    Some(model) => model.clone(),
                    None => Arc::new(learn_model(
                        &[&shapes[j].training],
                        parameters,
                        cancel,
                        &|_, _| (),
                    )?),
                };
                tick();
                Ok(IndexedClass {
                    label: j.to_string(),
                    dictionaries: model.dictionaries.clone(),
                    shapes: Vec::new(),
                })
            })
            .collect::<Result<Vec<_>, PipelineError>>()?;
        let index = Index {
            parameters: parameters.clone(),
            classes,
        };
        scores
            .par_iter_mut()
            .zip(&queries)
            .try_for_each(|(row, views)| -> Result<(), PipelineError> {
                let ranking = rank(views, &index, parameters.rank_by, cancel)?;
                for class in ranking.classes {
                    // Labels are the numbers written above.
                    if let Ok(j) = class.label.parse::<usize>() {
                        row[j] = class.score;
                    }
                }
                tick();
                Ok(())
            })?;
    }
    Ok(scores)
}

/// Every k-th signature of each view, so that at most [`SIGNATURES`] are left.
fn thinned(views: &[View]) -> Vec<View> {
    views
        .iter()
        .map(|view| {
            let Signatures { matrix, vertices } = &view.signatures;
            let step = vertices.len().div_ceil(SIGNATURES).max(1);
            let kept: Vec<u32> = vertices.iter().copied().step_by(step).collect();
            let signatures = Signatures {
                matrix: Mat::from_fn(matrix.nrows(), kept.len(), |i, j| matrix[(i, j * step)]),
                vertices: kept,
            };
            View {
                hypothesis: view.hypothesis,
                channel: view.channel,
                area_scale: view.area_scale,
                bounded: view.bounded,
                signatures,
            }
        })
        .collect()
}

/// What a matrix of scores says: how often the nearest other shape is of the query's class, out of how many queries,
/// and the means of the measures. A query that is alone in its class is left out.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RetrievalOutcome {
    /// Queries whose nearest other shape is of their class.
    pub correct: usize,
    /// Queries with another shape of their class.
    pub total: usize,
    /// Means over the queries.
    pub measures: RetrievalMeasures,
    /// For every shape, in the order they were given, the position in that order of its nearest other shape; `None` for a
    /// single one.
    pub nearest: Vec<Option<usize>>,
}

/// Judges every row of `scores` (smaller is nearer) against the classes; a shape is not its own answer.
pub fn judge_retrieval(scores: &[Vec<f64>], classes: &[&str], same: &[Vec<String>]) -> RetrievalOutcome {
    let mut outcome = RetrievalOutcome::default();
    let mut measures = Vec::new();
    for (i, row) in scores.iter().enumerate() {
        let mut others: Vec<usize> = (0..row.len()).filter(|&j| j != i).collect();
        others.sort_by(|&a, &b| row[a].total_cmp(&row[b]).then(a.cmp(&b)));
        let relevant: Vec<bool> = others
            .iter()
            .map(|&j| counts_as(classes[i], classes[j], same))
            .collect();
        outcome.nearest.push(others.first().copied());
        if let Some(m) = RetrievalMeasures::of(&relevant) {
            outcome.total += 1;
            outcome.correct += usize::from(relevant[0]);
            measures.push(m);
        }
    }
    outcome.measures = RetrievalMeasures::mean(&measures);
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_judged_without_the_query_itself() {
        // Shapes on a line at 0, 1, 5, 6 and 2.1, the last alone in its class.
        let places = [0.0, 1.0, 5.0, 6.0, 2.1];
        let scores: Vec<Vec<f64>> = places
            .iter()
            .map(|a: &f64| places.iter().map(|b| (a - b).abs()).collect())
            .collect();
        let classes = ["cat", "cat", "dog", "dog", "fox"];
        let outcome = judge_retrieval(&scores, &classes, &[]);
        assert_eq!((outcome.correct, outcome.total), (4, 4));
        assert_eq!(outcome.nearest, [Some(1), Some(0), Some(3), Some(2), Some(1)]);
        assert_eq!(outcome.measures.first_tier, 1.0);
        let merged = judge_retrieval(&scores, &classes, &[vec!["fox".into(), "cat".into()]]);
        assert_eq!((merged.correct, merged.total), (5, 5));
    }
}
