//! A query's outcome → its answer on the wire.

use super::class::ClassRef;
use super::parameters::QueryRankByName;
use super::query::{DetailsName, QueryAnswer, RankedClass, RankedShape, SampledView};
use super::shape::PoseDto;
use shapelex_core::mesh::Format;
use shapelex_core::parameters::Channel;
use shapelex_core::pipeline::Description;
use shapelex_core::retrieval::{QueryOutcome, SearchIndex};
use std::collections::BTreeMap;

/// What was asked, as far as the answer repeats it.
pub struct Question<'a> {
    /// The mesh's name.
    pub name: &'a str,
    /// Which pose of an animated file it is.
    pub pose: Option<PoseDto>,
    /// Its format.
    pub format: Format,
    /// What the classes were ordered by.
    pub rank_by: QueryRankByName,
    /// How many classes and shapes are answered; all where it is `None`.
    pub top: Option<usize>,
    /// What is answered beside the ranking.
    pub details: Option<DetailsName>,
}

impl Question<'_> {
    /// The outcome on the wire, without generation and times, which only a service knows.
    pub fn answered(&self, index: &SearchIndex, outcome: QueryOutcome) -> QueryAnswer {
        let parameters = &index.dictionaries.parameters;
        let reference = |label: &str| ClassRef {
            id: label.to_owned(),
            name: index.name(label).to_owned(),
        };
        let top = self.top.unwrap_or(usize::MAX);
        let wants_samples = self.details == Some(DetailsName::Samples);
        let description = &outcome.description;
        QueryAnswer {
            name: self.name.to_owned(),
            pose: self.pose.clone(),
            classes: ranked_classes(&outcome, top),
            nearest_shapes: ranked_shapes(&outcome, top, &reference),
            probability: outcome.verdict.probability,
            margin: outcome.margin,
            confidence: outcome.margin,
            compared: outcome.compared,
            pruned: outcome.pruned,
            none_of_these: outcome.none_of_these,
            possible_classes: outcome.possible_classes().map(|c| reference(&c.label)).collect(),
            partial: outcome.partial,
            not_compared: outcome.not_compared.iter().map(|l| reference(l)).collect(),
            signatures: outcome.signatures,
            samples: wants_samples.then(|| samples(description)),
            format: self.format.extension().to_owned(),
            warnings: description.report.warnings.clone(),
            verdict: outcome.verdict.into(),
            mesh: outcome.description.report.into(),
            eigenvalues: outcome.description.eigenvalues,
            generation: 0,
            rank_by: self.rank_by,
            parameters: parameters.clone().into(),
            timings_ms: BTreeMap::new(),
        }
    }
}

fn ranked_classes(outcome: &QueryOutcome, top: usize) -> Vec<RankedClass> {
    let ranked = outcome.classes.iter().take(top).enumerate().map(|(i, class)| {
        let coded = class.coded.as_ref();
        RankedClass {
            rank: i + 1,
            class: ClassRef {
                id: class.label.clone(),
                name: class.name.clone(),
            },
            score: class.score,
            reconstruction_error: coded.map(|c| c.frobenius_error),
            relative_error: coded.map(|c| c.relative_error),
            mean_objective: coded.map(|c| c.mean_objective),
            trimmed_objective: coded.map(|c| c.trimmed_objective),
            mean_nonzeros: coded.map(|c| c.mean_nonzeros),
            hypothesis: coded.map(|c| c.hypothesis.into()),
            margin: class.margin,
            p_value: class.p_value,
        }
    });
    ranked.collect()
}

fn ranked_shapes(
    outcome: &QueryOutcome,
    top: usize,
    reference: &dyn Fn(&str) -> ClassRef,
) -> Vec<RankedShape> {
    let ranked = outcome
        .shapes
        .iter()
        .take(top)
        .enumerate()
        .map(|(i, shape)| RankedShape {
            rank: i + 1,
            shape: shape.label.clone(),
            class: reference(&shape.class),
            score: shape.score,
            reconstruction_error: shape.frobenius_error,
        });
    ranked.collect()
}

fn samples(description: &Description) -> Vec<SampledView> {
    let views = description.views.iter().map(|view| SampledView {
        hypothesis: view.hypothesis.into(),
        channel: match view.channel {
            Channel::Plain => "plain",
            Channel::Whitened => "whitened",
            Channel::FixedGrid => "fixed_grid",
        },
        area_scale: view.area_scale,
        bounded: view.bounded,
        vertices: view.signatures.vertices.clone(),
        signals: (0..view.signatures.len())
            .map(|i| view.signatures.matrix.col_as_slice(i).to_vec())
            .collect(),
    });
    views.collect()
}
