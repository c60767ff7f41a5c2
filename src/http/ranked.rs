//! A ranking by whatever method, as the answer needs it.

use crate::baseline::{Nearest, nearest_classes};
use crate::ranking::{ClassScore, Ranking};

/// A class and its score.
pub(super) struct Class {
    pub(super) label: String,
    pub(super) score: f64,
    pub(super) margin: Option<f64>,
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
    pub(super) confidence: f64,
    /// Signatures that were coded.
    pub(super) signatures: usize,
}

impl From<Ranking> for Ranked {
    fn from(ranking: Ranking) -> Self {
        let class = |c: ClassScore| Class {
            label: c.label.clone(),
            score: c.score,
            margin: c.margin,
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
            confidence: ranking.confidence,
            signatures: ranking.signatures,
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
            coded: None,
        });
        Self {
            confidence: margin(0).unwrap_or(1.0),
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
