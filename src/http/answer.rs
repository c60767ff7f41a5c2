//! One query over HTTP: reserves its memory, runs it, and puts the outcome on the wire.

use super::admission::Work;
use super::dto::answer::Question;
use super::dto::query::{QueryAnswer, QueryOptions};
use super::dto::shape::PoseDto;
use super::metrics;
use super::problem::{Code, Problem};
use super::problem_from::{baselines_missing, baselines_not_imported, index_empty};
use super::state::Parts;
use super::stopwatch::{Stopwatch, milliseconds};
use super::time_limit::TimeView;
use super::uploaded::{ReadMesh, UploadedMesh};
use crate::jobs::LiveIndex;
use crate::model::{Generation, Origin};
use shapelex_core::pipeline::Stage;
use shapelex_core::retrieval::{Deadline, QueryEngine, QueryError, QuerySpec};
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
    let index = &live.search;
    let rank_by = options
        .rank_by
        .unwrap_or(index.dictionaries.parameters.rank_by.into());
    let watch = Stopwatch::default();
    let observer = |stage| watch.begin(stage);
    observer(Stage::Read);
    let deadline = match limit {
        Some(limit) => Deadline::best_so_far_at(&limit.over),
        None => Deadline::fail_at(&work.cancel),
    };
    let context = mesh.context(state.config.limits, &deadline.passed);
    let ReadMesh { format, pose, soup } = mesh
        .read_posture(&context)
        .map_err(|problem| in_time(problem, limit))?;
    let spec = QuerySpec {
        method: rank_by.method(),
        top: options.top,
    };
    let engine = QueryEngine {
        observer: &observer,
        memory: Some(&context.memory),
    };
    let outcome = engine
        .run(index, soup, &spec, &deadline)
        .map_err(|error| match error {
            QueryError::EmptyIndex => index_empty(),
            QueryError::NoBaselines => no_baselines(generation, rank_by.name()),
            QueryError::NothingScored => nothing_scored(limit),
            QueryError::Pipeline(error) => error.into(),
        })?;
    let warnings = context.warnings.list();
    drop(context);
    let stages = watch.end();
    for (stage, took) in &stages {
        metrics::time_stage(*stage, *took);
    }
    let best = outcome.classes.first();
    metrics::count_answer(outcome.none_of_these, best.and_then(|class| class.p_value));
    let question = Question {
        name: &mesh.name,
        pose: pose.map(PoseDto::from),
        format,
        rank_by,
        top: options.top,
        details: options.details,
    };
    let mut answer = question.answered(index, outcome);
    answer.generation = generation.number;
    answer.warnings.splice(0..0, warnings);
    answer.timings_ms = timings(&stages, work.waited, began.elapsed());
    Ok(answer)
}

/// A problem of reading, or that of a query whose time was over meanwhile.
fn in_time(problem: Problem, limit: Option<&TimeView>) -> Problem {
    match limit {
        Some(limit) if problem.code == Code::Cancelled => limit.nothing_scored(),
        _ => problem,
    }
}

fn nothing_scored(limit: Option<&TimeView>) -> Problem {
    let error = || Problem::internal("a query without a time limit ended at one");
    limit.map_or_else(error, TimeView::nothing_scored)
}

fn no_baselines(generation: &Generation, rank_by: &str) -> Problem {
    let mut classes = generation.classes.iter();
    if classes.all(|class| class.origin == Origin::Imported) {
        baselines_not_imported(rank_by)
    } else {
        baselines_missing(rank_by)
    }
}

fn timings(stages: &BTreeMap<Stage, Duration>, waited: Duration, total: Duration) -> BTreeMap<String, f64> {
    let mut timings: BTreeMap<String, f64> = stages
        .iter()
        .map(|(stage, took)| (stage.name().to_owned(), milliseconds(*took)))
        .collect();
    timings.insert("wait".to_owned(), milliseconds(waited));
    timings.insert("total".to_owned(), milliseconds(waited + total));
    timings
}
