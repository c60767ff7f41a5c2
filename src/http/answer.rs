//! One query: a mesh and an index → the answer on the wire.

use super::admission::Work;
use super::dto::class::ClassRef;
use super::dto::query::{QueryAnswer, QueryOptions, RankedClass, RankedShape};
use super::metrics;
use super::problem::{Code, Problem};
use super::problem_from::{baselines_missing, index_empty};
use super::ranked::Ranked;
use super::state::Parts;
use super::time_limit::{TimeView, rank_until};
use super::uploaded::UploadedMesh;
use crate::jobs::LiveIndex;
use crate::mesh::TriangleSoup;
use crate::model::ClassId;
use crate::pipeline::estimate::{self, Role};
use crate::pipeline::prepared::OPEN_ABOVE;
use crate::pipeline::{Stage, StageSpan, describe_plain, describe_query, rank, rank_top};
use crate::ranking::{Index, SIGNIFICANCE};
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
    limit: Option<&TimeView>,
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
    let stop = limit.map_or(&work.cancel, |limit| &limit.over);
    let timely = |problem: Problem| match limit {
        Some(limit) if problem.code == Code::Cancelled => limit.nothing_scored(),
        _ => problem,
    };
    let context = mesh.context(state.config.limits, stop);
    let (format, soup) = mesh.read(&context).map_err(timely)?;
    context
        .memory
        .grow(computing_bytes(&soup, &index, state.config.query_threads))?;
    let named = options.rank_by.unwrap_or(parameters.rank_by.into());
    let (description, ranking, left) = match named.method() {
        Ok(rank_by) => {
            let description =
                describe_query(soup, parameters, stop, &observer).map_err(|e| timely(e.into()))?;
            observer(Stage::Ranking);
            let ranked = match limit {
                Some(_) => rank_until(&description.views, &index, rank_by, stop),
                None => match options.top {
                    Some(top) => rank_top(&description.views, &index, rank_by, top, stop),
                    None => rank(&description.views, &index, rank_by, stop),
                }
                .map(|ranking| (ranking, Vec::new())),
            };
            let (ranking, left) = ranked.map_err(|e| timely(e.into()))?;
            let mut ranked = Ranked::from(ranking);
            if rank_by == parameters.rank_by && description.report.openness <= OPEN_ABOVE {
                ranked.judge(live.calibration.as_ref());
            }
            (description, ranked, left)
        }
        Err(baseline) => {
            let baselines = live
                .baselines
                .as_ref()
                .ok_or_else(|| baselines_missing(named.name()))?;
            let description =
                describe_plain(soup, parameters, stop, &observer).map_err(|e| timely(e.into()))?;
            observer(Stage::Ranking);
            let present = |label: &str| names.contains_key(label);
            let nearest = baselines
                .nearest(&description, baseline, &present)
                .ok_or_else(|| baselines_missing(named.name()))?;
            (description, Ranked::from(nearest), Vec::new())
        }
    };
    drop(context);
    let stages = watch.end();
    for (stage, took) in &stages {
        metrics::time_stage(*stage, *took);
    }
    let class_of = |label: &str| ClassRef {
        id: label.to_owned(),
        name: names.get(label).cloned().unwrap_or_else(|| label.to_owned()),
    };
    let top = options.top.unwrap_or(usize::MAX);
    let possible = ranking
        .classes
        .iter()
        .filter(|c| c.p_value.is_some_and(|p| p > SIGNIFICANCE));
    let possible_classes = possible.map(|c| class_of(&c.label)).collect();
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
            p_value: c.p_value,
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
        compared: ranking.compared,
        pruned: ranking.pruned,
        none_of_these: ranking.none_of_these,
        possible_classes,
        partial: !left.is_empty(),
        not_compared: left.iter().map(|label| class_of(label)).collect(),
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

/// Memory that describing and ranking a mesh takes beside the mesh itself, in bytes.
fn computing_bytes(soup: &TriangleSoup, index: &Index, threads: usize) -> u64 {
    let (vertices, parameters) = (soup.vertices.len(), &index.parameters);
    let largest = (index.classes.iter())
        .flat_map(|class| class.dictionaries.values())
        .map(|dictionary| dictionary.len())
        .max();
    let preparing = estimate::preparing_bytes(vertices, soup.faces.len());
    let describing = estimate::describing_bytes(vertices, parameters, Role::Query);
    let ranking = estimate::ranking_bytes(vertices, largest.unwrap_or(0), threads, parameters);
    // Views are held while they are ranked, and the spectra are gone then.
    preparing.max(describing).max(
        ranking
            + estimate::description_bytes(
                estimate::prepared_vertices(vertices, parameters),
                parameters,
                Role::Query,
            ),
    )
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
    span: StageSpan,
}

impl Stopwatch {
    fn begin(&self, stage: Stage) {
        self.span.begin(stage);
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
