//! The figures of an evaluation.

use super::results::{class_embedding, dissimilarity};
use super::{
    ClassAccuracy, FigureError, GalleryRow, HeatMap, RowView, Series, Sheet, class_accuracy, coverage,
    gallery, heat_map, precision_recall,
};
use crate::benchmark::measures::RetrievalMeasures;
use crate::benchmark::report::{ClassMatrix, TOTAL};
use crate::benchmark::retrieval::RetrievalOutcome;
use crate::benchmark::{Evaluation, OpenSet};
use shapelex_core::mesh::TriangleSoup;
use std::collections::{BTreeMap, BTreeSet};

/// A query that was mistaken, or nearly, with the meshes it is about.
#[derive(Clone, Debug, PartialEq)]
pub struct WorstQuery {
    /// Such as `cat 3 as dog`.
    pub label: String,
    /// The query itself.
    pub query: Option<TriangleSoup>,
    /// A shape of the class that was answered.
    pub answered: Option<TriangleSoup>,
    /// Another shape of its own class.
    pub own: Option<TriangleSoup>,
}

/// The figures of a protocol, named after it: who was taken for whom, the accuracy of each class, the dissimilarity of
/// the classes, and, where every class was compared with every other, the classes in the plane.
///
/// # Errors
/// The first figure's that cannot be drawn; [`FigureError::Empty`] without queries.
pub fn evaluation_figures(evaluation: &Evaluation) -> Result<Vec<Sheet>, FigureError> {
    let protocol = evaluation.protocol.name();
    let Counted {
        classes,
        answers,
        right,
        scores,
    } = Counted::of(evaluation);
    let matrix = ClassMatrix {
        protocol: protocol.to_owned(),
        method: "queries".to_owned(),
        category: TOTAL.to_owned(),
        values: scores,
        classes: classes.clone(),
    };
    let title = format!("Accuracy by class, {protocol}");
    let mut sheets = vec![
        confusion(evaluation, &classes, &answers)?,
        Sheet::new("accuracy.svg", class_accuracy(&title, &right)?),
        dissimilarity(&matrix, "class of the queries")?,
    ];
    if matrix.values.iter().flatten().all(|v| v.is_finite()) {
        sheets.push(class_embedding(&matrix)?);
    }
    for sheet in &mut sheets {
        sheet.name = format!("{}-{}", file_name(protocol), sheet.name);
    }
    Ok(sheets)
}

fn file_name(protocol: &str) -> String {
    protocol.replace('/', "-")
}

/// What an evaluation's queries add up to, by class in order of the names.
struct Counted {
    classes: Vec<String>,
    /// True class → answered class → queries.
    answers: Vec<Vec<usize>>,
    right: Vec<ClassAccuracy>,
    /// True class → class → mean score; not finite where they were never compared.
    scores: Vec<Vec<f64>>,
}

impl Counted {
    fn of(evaluation: &Evaluation) -> Self {
        let classes: Vec<String> = evaluation
            .queries
            .iter()
            .flat_map(|q| q.ranked.iter().map(|(class, _)| class).chain([&q.class]))
            .collect::<BTreeSet<_>>()
            .into_iter()
            .cloned()
            .collect();
        let place: BTreeMap<&str, usize> = classes.iter().enumerate().map(|(i, c)| (c.as_str(), i)).collect();
        let n = classes.len();
        let mut answers = vec![vec![0; n]; n];
        let mut right: Vec<ClassAccuracy> = classes
            .iter()
            .map(|class| ClassAccuracy {
                class: class.clone(),
                correct: 0,
                total: 0,
            })
            .collect();
        let mut sums = vec![vec![(0.0, 0.0); n]; n];
        for query in &evaluation.queries {
            let row = place[query.class.as_str()];
            right[row].total += 1;
            right[row].correct += usize::from(query.correct);
            for (rank, (class, score)) in query.ranked.iter().enumerate() {
                let column = place[class.as_str()];
                let (sum, count) = &mut sums[row][column];
                *sum += score;
                *count += 1.0;
                answers[row][column] += usize::from(rank == 0);
            }
        }
        let mean = |row: Vec<(f64, f64)>| row.into_iter().map(|(sum, count)| sum / count).collect();
        let scores = sums.into_iter().map(mean).collect();
        Self {
            classes,
            answers,
            right,
            scores,
        }
    }
}

/// Who was taken for whom: colours are shares of a class's queries, so that large classes do not outshine small ones;
/// the counts are written.
fn confusion(
    evaluation: &Evaluation,
    classes: &[String],
    answers: &[Vec<usize>],
) -> Result<Sheet, FigureError> {
    let rates: Vec<Vec<f64>> = answers
        .iter()
        .map(|row| {
            let total: usize = row.iter().sum();
            row.iter().map(|&n| n as f64 / total as f64).collect()
        })
        .collect();
    let written = |n: &usize| if *n == 0 { String::new() } else { n.to_string() };
    let texts: Vec<Vec<String>> = answers
        .iter()
        .map(|row| row.iter().map(written).collect())
        .collect();
    let map = HeatMap {
        row_axis: "true class",
        column_axis: "answered class",
        value: "share of the class's queries",
        rows: classes,
        columns: classes,
        values: &rates,
        texts: Some(&texts),
        shares: true,
    };
    let title = format!(
        "Answers of {}: {} of {} right",
        evaluation.protocol.name(),
        evaluation.correct,
        evaluation.total
    );
    Ok(Sheet::new("confusion.svg", heat_map(&title, &map)?))
}

/// Precision over recall, shape against shape.
///
/// # Errors
/// As [`precision_recall`]; [`FigureError::Empty`] where no query had another shape of its class.
pub fn retrieval_figure(outcome: &RetrievalOutcome) -> Result<Sheet, FigureError> {
    let precision = &outcome.measures.precision;
    if precision.is_empty() {
        return Err(FigureError::Empty {
            what: "precision-recall curves",
        });
    }
    let curve = Series {
        label: format!("mAP {:.3}", outcome.measures.average_precision),
        points: RetrievalMeasures::recalls()
            .into_iter()
            .zip(precision.iter().copied())
            .collect(),
    };
    let title = format!("Retrieval, shape against shape: {} queries", outcome.total);
    Ok(Sheet::new(
        "retrieval-precision-recall.svg",
        precision_recall(&title, &[curve])?,
    ))
}

/// Coverage of the sets of possible classes against the level, and how often a shape of a class left out is told.
///
/// # Errors
/// As [`coverage`].
pub fn open_set_figure(open_set: &OpenSet) -> Result<Sheet, FigureError> {
    let series = |label: &str, pick: &dyn Fn(&crate::benchmark::AtLevel) -> f64| Series {
        label: label.to_owned(),
        points: open_set
            .by_level
            .iter()
            .map(|at| (1.0 - at.level, pick(at)))
            .collect(),
    };
    let title = format!("Possible classes of {} queries", open_set.covered.total);
    Ok(Sheet::new(
        "open-set-coverage.svg",
        coverage(
            &title,
            &[series("the true class is possible", &|at| at.covered.value())],
        )?,
    ))
}

/// The worst queries in pictures, beside what they were taken for and what they are.
///
/// # Errors
/// As [`gallery`].
pub fn worst_queries(protocol: &str, worst: Vec<WorstQuery>) -> Result<Sheet, FigureError> {
    let columns = ["query", "answered class", "own class"].map(str::to_owned);
    let rows: Vec<GalleryRow> = worst
        .into_iter()
        .map(|w| GalleryRow {
            label: w.label,
            meshes: vec![w.query, w.answered, w.own],
            view: RowView::Own,
        })
        .collect();
    let title = format!("Worst queries of {protocol}");
    Ok(Sheet::new(
        format!("{}-worst.svg", file_name(protocol)),
        gallery(&title, &columns, &rows)?,
    ))
}
