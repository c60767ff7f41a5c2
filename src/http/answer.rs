//! One query: a mesh and an index → the answer on the wire.

use super::admission::Work;
use super::dto::class::ClassRef;
use super::dto::query::{DetailsName, QueryAnswer, QueryOptions, RankedClass, RankedShape, SampledView};
use super::dto::shape::PoseDto;
use super::metrics;
use super::problem::{Code, Problem};
use super::problem_from::{baselines_missing, baselines_not_imported, index_empty};
use super::ranked::Ranked;
use super::state::Parts;
use super::time_limit::{TimeView, rank_until};
use super::uploaded::{ReadMesh, UploadedMesh};
use crate::jobs::LiveIndex;
use crate::model::{ClassId, Generation, Origin};
use crate::store::StoreError;
use shapelex_core::mesh::TriangleSoup;
use shapelex_core::parameters::Channel;
use shapelex_core::pipeline::estimate::{self, Role};
use shapelex_core::pipeline::{
    Description, Stage, StageSpan, describe_plain, describe_query, judged_by, rank, rank_top,
};
use shapelex_core::ranking::{Index, JUDGED, NotJudged, SIGNIFICANCE};
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
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
    let ReadMesh { format, pose, soup } = mesh.read_posture(&context).map_err(timely)?;
    context
        .memory
        .grow(computing_bytes(&soup, &index, state.config.query_threads))?;
    let named = options.rank_by.unwrap_or(parameters.rank_by.into());
    let name_of = |label: &str| names.get(label).cloned().unwrap_or_else(|| label.to_owned());
    let (description, ranking, left, verdict) = match named.method() {
        Ok(rank_by) => {
            let description =
                describe_query(soup, parameters, stop, &observer).map_err(|e| timely(e.into()))?;
            observer(Stage::Ranking);
            let ranked = match limit {
                Some(_) => rank_until(&description.views, &index, rank_by, stop),
                None => match options.top {
                    // The verdict is about the first few, however many are answered.
                    Some(top) => rank_top(&description.views, &index, rank_by, top.max(JUDGED), stop),
                    None => rank(&description.views, &index, rank_by, stop),
                }
                .map(|ranking| (ranking, Vec::new())),
            };
            let (ranking, left) = ranked.map_err(|e| timely(e.into()))?;
            let mut ranked = Ranked::from(ranking);
            let calibration = match left.is_empty() {
                true => judged_by(&live.calibration, parameters, rank_by, &description),
                false => Err(NotJudged::Partial),
            };
            let verdict = ranked.judge(calibration, name_of);
            (description, ranked, left, verdict)
        }
        Err(baseline) => {
            let baselines = live
                .baselines
                .as_ref()
                .ok_or_else(|| no_baselines(generation, named.name()))?;
            let description =
                describe_plain(soup, parameters, stop, &observer).map_err(|e| timely(e.into()))?;
            observer(Stage::Ranking);
            let present = |label: &str| names.contains_key(label);
            let nearest = baselines
                .nearest(&description, baseline, &present)
                .ok_or_else(|| no_baselines(generation, named.name()))?;
            let mut ranked = Ranked::from(nearest);
            let left = without(&index, &ranked);
            let verdict = ranked.judge(Err(NotJudged::OtherMeasure), name_of);
            (description, ranked, left, verdict)
        }
    };
    let warnings_of_reading = context.warnings.list();
    drop(context);
    let stages = watch.end();
    for (stage, took) in &stages {
        metrics::time_stage(*stage, *took);
    }
    let best = ranking.classes.first();
    metrics::count_answer(ranking.none_of_these, best.and_then(|class| class.p_value));
    let class_of = |label: &str| ClassRef {
        id: label.to_owned(),
        name: name_of(label),
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
        pose: pose.map(PoseDto::from),
        classes: classes.collect(),
        nearest_shapes: shapes.collect(),
        probability: verdict.probability,
        verdict: verdict.into(),
        margin: ranking.margin,
        confidence: ranking.margin,
        compared: ranking.compared,
        pruned: ranking.pruned,
        none_of_these: ranking.none_of_these,
        possible_classes,
        partial: named.method().is_ok() && !left.is_empty(),
        not_compared: left.iter().map(|label| class_of(label)).collect(),
        signatures: ranking.signatures,
        samples: (options.details == Some(DetailsName::Samples)).then(|| samples(&description)),
        format: format.extension().to_owned(),
        warnings: [warnings_of_reading, description.report.warnings.clone()].concat(),
        mesh: description.report.into(),
        eigenvalues: description.eigenvalues,
        generation: generation.number,
        rank_by: named,
        parameters: parameters.clone().into(),
        timings_ms: timings(&stages, work.waited, began.elapsed()),
    })
}

fn no_baselines(generation: &Generation, rank_by: &str) -> Problem {
    if generation
        .classes
        .iter()
        .all(|class| class.origin == Origin::Imported)
    {
        baselines_not_imported(rank_by)
    } else {
        baselines_missing(rank_by)
    }
}

/// Labels of the classes that a baseline knows no shape of: imported ones, where the file had nothing for it.
fn without(index: &Index, ranked: &Ranked) -> Vec<String> {
    let known: BTreeSet<&str> = ranked.classes.iter().map(|class| class.label.as_str()).collect();
    let labels = index.classes.iter().map(|class| &class.label);
    labels.filter(|l| !known.contains(l.as_str())).cloned().collect()
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

/// A duration in milliseconds, to the microsecond, so that logs and answers have no digits without meaning.
pub(super) fn milliseconds(duration: Duration) -> f64 {
    (duration.as_secs_f64() * 1e6).round() / 1e3
}

fn timings(stages: &[(Stage, Duration)], waited: Duration, total: Duration) -> BTreeMap<String, f64> {
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
