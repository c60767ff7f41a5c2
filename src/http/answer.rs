//! One query: a mesh and an index → the answer on the wire.

use super::admission::Work;
use super::dto::class::ClassRef;
use super::dto::query::{QueryAnswer, QueryOptions, RankedClass, RankedShape};
use super::metrics;
use super::problem::Problem;
use super::problem_from::{baselines_missing, index_empty};
use super::ranked::Ranked;
use super::state::Parts;
use super::uploaded::UploadedMesh;
use crate::baseline::baseline_parameters;
use crate::jobs::LiveIndex;
use crate::model::ClassId;
use crate::pipeline::{Stage, describe_query, describe_shape, rank};
use crate::ranking::Index;
use crate::store::StoreError;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Answers a query. Blocks on the computation: call it on the compute pool.
///
/// # Errors
/// `index_empty`, `baselines_missing`, and those of reading, describing and ranking.
pub fn answer(
    state: &Parts,
    live: &LiveIndex,
    mesh: &UploadedMesh,
    options: &QueryOptions,
    work: &Work,
) -> Result<QueryAnswer, Problem> {
    metrics::time_wait(work.waited);
    let began = Instant::now();
    let Some(generation) = &live.generation else {
        return Err(index_empty());
    };
    let (index, names) = present(state, live)?;
    if index.classes.is_empty() {
        return Err(index_empty());
    }
    let parameters = &index.parameters;
    let watch = Stopwatch::default();
    let observer = |stage| watch.begin(stage);
    observer(Stage::Read);
    let (format, soup) = mesh.read(&state.config.limits)?;
    let named = options.rank_by.unwrap_or(parameters.rank_by.into());
    let (description, ranking) = match named.method() {
        Ok(rank_by) => {
            let description = describe_query(soup, parameters, &work.cancel, &observer)?;
            observer(Stage::Ranking);
            let ranking = rank(&description.views, &index, rank_by, &work.cancel)?;
            (description, Ranked::from(ranking))
        }
        Err(baseline) => {
            let baselines = live
                .baselines
                .as_ref()
                .ok_or_else(|| baselines_missing(named.name()))?;
            let parameters = baseline_parameters(parameters);
            let description = describe_shape(soup, &parameters, &work.cancel, &observer)?;
            observer(Stage::Ranking);
            let present = |label: &str| names.contains_key(label);
            let nearest = baselines
                .nearest(&description, baseline, &present)
                .ok_or_else(|| baselines_missing(named.name()))?;
            (description, Ranked::from(nearest))
        }
    };
    let stages = watch.end();
    for (stage, took) in &stages {
        metrics::time_stage(*stage, *took);
    }
    let class_of = |label: &str| ClassRef {
        id: label.to_owned(),
        name: names.get(label).cloned().unwrap_or_else(|| label.to_owned()),
    };
    let top = options.top.unwrap_or(usize::MAX);
    let compared = ranking.classes.len();
    let classes = ranking.classes.into_iter().take(top).enumerate().map(|(i, c)| {
        let coded = c.coded;
        RankedClass {
            rank: i + 1,
            class: class_of(&c.label),
            score: c.score,
            reconstruction_error: coded.as_ref().map(|c| c.frobenius_error),
            relative_error: coded.as_ref().map(|c| c.relative_error),
            mean_objective: coded.as_ref().map(|c| c.mean_objective),
            trimmed_objective: coded.as_ref().map(|c| c.trimmed_objective),
            mean_nonzeros: coded.as_ref().map(|c| c.mean_nonzeros),
            hypothesis: coded.as_ref().map(|c| c.hypothesis.into()),
            margin: c.margin,
        }
    });
    let shapes = ranking
        .shapes
        .into_iter()
        .take(top)
        .enumerate()
        .map(|(i, s)| RankedShape {
            rank: i + 1,
            shape: s.label,
            class: class_of(&s.class),
            score: s.score,
            reconstruction_error: s.frobenius_error,
        });
    Ok(QueryAnswer {
        name: mesh.name.clone(),
        classes: classes.collect(),
        nearest_shapes: shapes.collect(),
        confidence: ranking.confidence,
        compared,
        signatures: ranking.signatures,
        format: format.extension().to_owned(),
        warnings: description.report.warnings.clone(),
        mesh: description.report.into(),
        eigenvalues: description.eigenvalues,
        generation: generation.number,
        rank_by: named,
        parameters: parameters.clone().into(),
        timings_ms: timings(&stages, work.waited, began.elapsed()),
    })
}

/// The index without the classes that were deleted since it was learnt, and the names the others have now.
fn present(state: &Parts, live: &LiveIndex) -> Result<(Index, BTreeMap<String, String>), Problem> {
    let mut names = BTreeMap::new();
    let mut classes = Vec::with_capacity(live.index.classes.len());
    for class in &live.index.classes {
        let Ok(id) = class.label.parse::<ClassId>() else {
            return Err(Problem::internal(format!("'{}' labels no class", class.label)));
        };
        match state.store.class(id) {
            Ok(found) => {
                names.insert(class.label.clone(), found.name.to_string());
                classes.push(class.clone());
            }
            Err(StoreError::NoClass { .. }) => {}
            Err(other) => return Err(other.into()),
        }
    }
    let parameters = live.index.parameters.clone();
    Ok((Index { parameters, classes }, names))
}

fn timings(stages: &[(Stage, Duration)], waited: Duration, total: Duration) -> BTreeMap<String, f64> {
    let milliseconds = |d: Duration| (d.as_secs_f64() * 1e6).round() / 1e3;
    let mut timings: BTreeMap<String, f64> = stages
        .iter()
        .map(|(stage, took)| (stage.name().to_owned(), milliseconds(*took)))
        .collect();
    timings.insert("wait".to_owned(), milliseconds(waited));
    timings.insert("total".to_owned(), milliseconds(waited + total));
    timings
}

/// Times stages by their beginnings; a stage that begins again, as under a second hypothesis, adds up.
#[derive(Default)]
struct Stopwatch {
    running: RefCell<Option<(Stage, Instant)>>,
    sums: RefCell<BTreeMap<Stage, Duration>>,
}

impl Stopwatch {
    fn begin(&self, stage: Stage) {
        let before = self.running.replace(Some((stage, Instant::now())));
        self.add(before);
    }

    fn add(&self, ended: Option<(Stage, Instant)>) {
        if let Some((stage, began)) = ended {
            *self.sums.borrow_mut().entry(stage).or_default() += began.elapsed();
        }
    }

    fn end(self) -> Vec<(Stage, Duration)> {
        let last = self.running.take();
        self.add(last);
        self.sums.into_inner().into_iter().collect()
    }
}
