//! A ranking by whatever method, as the answer needs it.

use shapelex_core::baseline::{Nearest, nearest_classes};
use shapelex_core::pipeline::{RankedClass, judge};
use shapelex_core::ranking::{Calibration, ClassScore, NotJudged, Ranking, Verdict};

/// A class and its score.
pub(super) struct Class {
    pub(super) label: String,
    pub(super) score: f64,
    pub(super) margin: Option<f64>,
    pub(super) p_value: Option<f64>,
    /// What only sparse coding knows.
    pub(super) coded: Option<ClassScore>,
}

/// A training shape and its score.
pub(super) struct Shape {
    pub(super) class: String,
    pub(super) label: String,
    pub(super) score: f64,
    pub(super) frobenius_error: Option<f64>,
}

/// Classes and shapes, best first.
pub(super) struct Ranked {
    pub(super) classes: Vec<Class>,
    pub(super) shapes: Vec<Shape>,
    /// Relative margin of the best class to the runner-up; 1 where there is only one.
    pub(super) margin: f64,
    /// Signatures that were coded.
    pub(super) signatures: usize,
    /// Classes that were compared with, and how many of them a bound ruled out.
    pub(super) compared: usize,
    pub(super) pruned: usize,
    /// Whether no class is believed possible; `None` where that cannot be told.
    pub(super) none_of_these: Option<bool>,
}

impl Ranked {
    /// Adds p-values, where there is something to tell them by, and makes the sentence; `name` is what a label is called.
    pub(super) fn judge(
        &mut self,
        calibration: Result<&Calibration, NotJudged>,
        name: impl Fn(&str) -> String,
    ) -> Verdict {
        let names: Vec<String> = self.classes.iter().map(|class| name(&class.label)).collect();
        let ranked: Vec<RankedClass<'_>> = self
            .classes
            .iter()
            .zip(&names)
            .map(|(class, name)| RankedClass {
                label: &class.label,
                name,
                score: class.score,
            })
            .collect();
        let judged = judge(calibration, &ranked);
        for (class, p_value) in self.classes.iter_mut().zip(judged.p_values) {
            class.p_value = p_value;
        }
        self.none_of_these = judged.none_of_these;
        judged.verdict
    }
}

impl From<Ranking> for Ranked {
    fn from(ranking: Ranking) -> Self {
        let class = |c: ClassScore| Class {
            label: c.label.clone(),
            score: c.score,
            margin: c.margin,
            p_value: None,
            coded: Some(c),
        };
        Self {
            classes: ranking.classes.into_iter().map(class).collect(),
            shapes: ranking
                .shapes
                .into_iter()
                .map(|s| Shape {
                    class: s.class,
                    label: s.label,
                    score: s.score,
                    frobenius_error: Some(s.frobenius_error),
                })
                .collect(),
            margin: ranking.confidence,
            signatures: ranking.signatures,
            compared: ranking.compared,
            pruned: ranking.pruned,
            none_of_these: None,
        }
    }
}

impl From<Vec<Nearest>> for Ranked {
    fn from(shapes: Vec<Nearest>) -> Self {
        let nearest = nearest_classes(&shapes);
        let margin = |i: usize| {
            let next = nearest.get(i + 1)?.distance;
            Some(if next > 0.0 {
                (next - nearest[i].distance) / next
            } else {
                0.0
            })
        };
        let classes = nearest.iter().enumerate().map(|(i, n)| Class {
            label: n.class.clone(),
            score: n.distance,
            margin: margin(i),
            p_value: None,
            coded: None,
        });
        Self {
            margin: margin(0).unwrap_or(1.0),
            compared: nearest.len(),
            pruned: 0,
            none_of_these: None,
            classes: classes.collect(),
            shapes: shapes
                .into_iter()
                .map(|s| Shape {
                    class: s.class,
                    label: s.shape,
                    score: s.distance,
                    frobenius_error: None,
                })
                .collect(),
            signatures: 0,
        }
    }
}
