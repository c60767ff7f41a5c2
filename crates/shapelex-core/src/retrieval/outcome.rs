//! A query's answer, whichever method ranked it.

use super::judge::judge;
use super::ranked::{RankedClass, RankedShape};
use crate::baseline::{Nearest, nearest_classes};
use crate::pipeline::Description;
use crate::ranking::{Calibration, NotJudged, Ranking, SIGNIFICANCE, Verdict};

/// A query's answer.
#[derive(Clone, Debug)]
pub struct QueryOutcome {
    /// The query's signatures, and what preparing did to its mesh.
    pub description: Description,
    /// The classes, best first: all, or at least as many as were asked for.
    pub classes: Vec<RankedClass>,
    /// Training shapes, best first, where the index has dictionaries of single shapes or a baseline ranked.
    pub shapes: Vec<RankedShape>,
    /// Relative margin of the best class to the runner-up, 0 to 1; 1 where there is only one.
    pub margin: f64,
    /// Signatures that were coded; 0 where a baseline ranked.
    pub signatures: usize,
    /// Classes that were compared with.
    pub compared: usize,
    /// Classes of these that a lower bound of their score left out.
    pub pruned: usize,
    /// Labels of the classes that were not compared with: those the deadline left, or those the baselines have no shape of.
    pub not_compared: Vec<String>,
    /// Whether the deadline passed before all classes were compared with.
    pub partial: bool,
    /// Whether no class is possible; `None` where that is not known.
    pub none_of_these: Option<bool>,
    /// What the answer comes to, in words.
    pub verdict: Verdict,
}

impl QueryOutcome {
    /// The classes with a p-value above [`SIGNIFICANCE`].
    pub fn possible_classes(&self) -> impl Iterator<Item = &RankedClass> {
        self.classes
            .iter()
            .filter(|class| class.p_value.is_some_and(|p| p > SIGNIFICANCE))
    }

    /// The answer of sparse coding.
    pub(super) fn coded(
        description: Description,
        ranking: Ranking,
        calibration: Result<&Calibration, NotJudged>,
        name: impl Fn(&str) -> String,
    ) -> Self {
        let classes: Vec<RankedClass> = ranking
            .classes
            .into_iter()
            .map(|class| RankedClass {
                name: name(&class.label),
                label: class.label.clone(),
                score: class.score,
                margin: class.margin,
                p_value: None,
                coded: Some(class),
            })
            .collect();
        let shapes = ranking.shapes.into_iter().map(|shape| RankedShape {
            class: shape.class,
            label: shape.label,
            score: shape.score,
            frobenius_error: Some(shape.frobenius_error),
        });
        let outcome = Self {
            partial: !ranking.not_compared.is_empty(),
            verdict: Verdict::not_judged(None, NotJudged::OtherMeasure),
            description,
            classes,
            shapes: shapes.collect(),
            margin: ranking.confidence,
            signatures: ranking.signatures,
            compared: ranking.compared,
            pruned: ranking.pruned,
            not_compared: ranking.not_compared,
            none_of_these: None,
        };
        outcome.judged(calibration)
    }

    /// The answer of a baseline; `not_compared` are the classes it knows no shape of.
    pub(super) fn nearest(
        description: Description,
        shapes: Vec<Nearest>,
        not_compared: Vec<String>,
        name: impl Fn(&str) -> String,
    ) -> Self {
        let nearest = nearest_classes(&shapes);
        let margin = |i: usize| {
            let next = nearest.get(i + 1)?.distance;
            let relative = (next - nearest[i].distance) / next;
            Some(if next > 0.0 { relative } else { 0.0 })
        };
        let classes: Vec<RankedClass> = nearest
            .iter()
            .enumerate()
            .map(|(i, class)| RankedClass {
                label: class.class.clone(),
                name: name(&class.class),
                score: class.distance,
                margin: margin(i),
                p_value: None,
                coded: None,
            })
            .collect();
        let ranked = shapes.into_iter().map(|shape| RankedShape {
            class: shape.class,
            label: shape.shape,
            score: shape.distance,
            frobenius_error: None,
        });
        let outcome = Self {
            description,
            shapes: ranked.collect(),
            margin: margin(0).unwrap_or(1.0),
            signatures: 0,
            compared: classes.len(),
            pruned: 0,
            not_compared,
            partial: false,
            none_of_these: None,
            verdict: Verdict::not_judged(None, NotJudged::OtherMeasure),
            classes,
        };
        outcome.judged(Err(NotJudged::OtherMeasure))
    }

    fn judged(mut self, calibration: Result<&Calibration, NotJudged>) -> Self {
        let judged = judge(calibration, &self.classes);
        for (class, p_value) in self.classes.iter_mut().zip(judged.p_values) {
            class.p_value = p_value;
        }
        self.none_of_these = judged.none_of_these;
        self.verdict = judged.verdict;
        self
    }
}
