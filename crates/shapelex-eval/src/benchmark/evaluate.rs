//! Accuracy on labelled shapes: who was taken for whom.

use super::class_measures::ClassMeasures;
use super::protocol::{Protocol, Round, rounds};
use super::query_result::{QueryResult, counts_as};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use shapelex_core::cancel::Cancel;
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::{Description, Model, PipelineError, learn_model};
use shapelex_core::ranking::{Index, IndexedClass, rank};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A shape whose class is known, described both ways.
#[derive(Clone, Debug)]
pub struct LabelledShape {
    /// Its class.
    pub class: String,
    /// Its name, unique within the class.
    pub name: String,
    /// As a training shape.
    pub training: Description,
    /// As a query.
    pub query: Description,
}

/// The outcome of a protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// The protocol.
    pub protocol: Protocol,
    /// Queries answered with the right class.
    pub correct: usize,
    /// Queries.
    pub total: usize,
    /// Nearest neighbour, first tier and DCG of the lists of classes.
    pub measures: ClassMeasures,
    /// Every query, the worst first.
    pub queries: Vec<QueryResult>,
    /// True class → answered class → count.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Shapes that could not be queried, because no other shape of their class trains.
    pub not_queried: usize,
}

impl Evaluation {
    /// Share of queries answered with the right class, 0 to 1.
    pub fn top1(&self) -> f64 {
        if self.total == 0 {
            0.0
        } else {
            self.correct as f64 / self.total as f64
        }
    }
}

/// Runs a protocol over labelled shapes. Classes in one group of `same` count as one another's right answer (two men,
/// two cats), though each keeps its own dictionary. `progress(done, total)` counts dictionaries and queries.
///
/// # Errors
/// The first error of learning or ranking.
pub fn evaluate(
    shapes: &[LabelledShape],
    protocol: Protocol,
    parameters: &Parameters,
    same: &[Vec<String>],
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Evaluation, PipelineError> {
    let classes: Vec<&str> = shapes.iter().map(|s| s.class.as_str()).collect();
    let names: Vec<&str> = shapes.iter().map(|s| s.name.as_str()).collect();
    let rounds = rounds(protocol, &classes, &names);
    let trial = Trial {
        rounds: &rounds,
        same,
        given: &Models::new(),
    };
    let queries = run_rounds(shapes, &trial, parameters, cancel, progress)?;
    let single = match protocol {
        Protocol::LeaveOneOut | Protocol::KFold { .. } => {
            shapes.len() - rounds.iter().map(|r| r.query.len()).sum::<usize>()
        }
        Protocol::TrainQuery { queries: asked } => asked - queries.len(),
        Protocol::EvenOdd | Protocol::OneShot { .. } => 0,
    };
    Ok(sum_up(protocol, queries, single, same))
}

/// Models by the shapes they were learnt from.
pub type Models = HashMap<Vec<usize>, Arc<Model>>;

/// What [`run_rounds`] runs.
#[derive(Clone, Copy)]
pub struct Trial<'a> {
    /// Which shapes train and which are queried, round by round.
    pub rounds: &'a [Round],
    /// Classes that count as one.
    pub same: &'a [Vec<String>],
    /// Models that are learnt already.
    pub given: &'a Models,
}

/// Learns what the rounds need, beyond what is `given`, and answers their queries. `progress(done, total)` counts
/// dictionaries and queries.
///
/// # Errors
/// The first error of learning or ranking.
pub fn run_rounds(
    shapes: &[LabelledShape],
    trial: &Trial<'_>,
    parameters: &Parameters,
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Vec<QueryResult>, PipelineError> {
    let Trial { rounds, same, given } = *trial;
    let mut uses: HashMap<&[usize], usize> = HashMap::new();
    for members in rounds.iter().flat_map(|r| r.train.values()) {
        *uses.entry(members).or_default() += 1;
    }
    // A dictionary that several rounds use is learnt once and kept; one that a single round uses lives only in it,
    // which bounds the memory of leave-one-out to a dictionary per class and thread.
    let mut shared: Vec<&[usize]> = uses
        .iter()
        .filter(|&(members, &n)| n > 1 && !given.contains_key(*members))
        .map(|(&members, _)| members)
        .collect();
    shared.sort_unstable();
    let total = shared.len() + rounds.iter().map(|r| r.query.len()).sum::<usize>();
    let done = AtomicUsize::new(0);
    let tick = || progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
    let learn = |members: &[usize]| {
        let training: Vec<&Description> = members.iter().map(|&i| &shapes[i].training).collect();
        learn_model(&training, parameters, cancel, &|_, _| ()).map(Arc::new)
    };
    let kept: HashMap<&[usize], Arc<Model>> = shared
        .par_iter()
        .map(|&members| {
            let model = learn(members)?;
            tick();
            Ok((members, model))
        })
        .collect::<Result<_, PipelineError>>()?;
    let answer = |round: &Round| -> Result<Vec<QueryResult>, PipelineError> {
        let classes = round
            .train
            .par_iter()
            .map(|(class, members)| {
                let known = given.get(members).or_else(|| kept.get(members.as_slice()));
                let model = match known {
                    Some(model) => model.clone(),
                    None => learn(members)?,
                };
                Ok(IndexedClass {
                    label: class.clone(),
                    dictionaries: model.dictionaries.clone(),
                    shapes: Vec::new(),
                })
            })
            .collect::<Result<Vec<_>, PipelineError>>()?;
        let index = Index {
            parameters: parameters.clone(),
            classes,
        };
        round
            .query
            .par_iter()
            .map(|&i| {
                let ranking = rank(&shapes[i].query.views, &index, parameters.rank_by, cancel)?;
                let ranked = ranking.classes.into_iter().map(|c| (c.label, c.score)).collect();
                tick();
                Ok(judge(&shapes[i].class, &shapes[i].name, ranked, same))
            })
            .collect()
    };
    let answers = rounds
        .par_iter()
        .map(answer)
        .collect::<Result<Vec<_>, PipelineError>>()?;
    Ok(answers.into_iter().flatten().collect())
}

/// Compares a ranking of classes, best first, with the truth.
pub fn judge(class: &str, name: &str, ranked: Vec<(String, f64)>, same: &[Vec<String>]) -> QueryResult {
    let is_true = |label: &str| counts_as(class, label, same);
    let true_rank = ranked
        .iter()
        .position(|(label, _)| is_true(label))
        .map_or(ranked.len() + 1, |p| p + 1);
    let best = |truth: bool| {
        ranked
            .iter()
            .find(|(label, _)| is_true(label) == truth)
            .map(|(_, score)| *score)
    };
    let error_margin = match (best(true), best(false)) {
        (Some(t), Some(f)) if f > 0.0 => (t - f) / f,
        _ => 0.0,
    };
    QueryResult {
        class: class.to_owned(),
        name: name.to_owned(),
        correct: true_rank == 1,
        ranked,
        true_rank,
        error_margin,
    }
}

fn sum_up(
    protocol: Protocol,
    mut queries: Vec<QueryResult>,
    not_queried: usize,
    same: &[Vec<String>],
) -> Evaluation {
    let measures = ClassMeasures::of(&queries, same);
    queries.sort_by(|a, b| {
        b.error_margin
            .total_cmp(&a.error_margin)
            .then_with(|| (&a.class, &a.name).cmp(&(&b.class, &b.name)))
    });
    let mut confusion: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for query in &queries {
        if let Some((answered, _)) = query.ranked.first() {
            *confusion
                .entry(query.class.clone())
                .or_default()
                .entry(answered.clone())
                .or_default() += 1;
        }
    }
    let correct = queries.iter().filter(|q| q.correct).count();
    Evaluation {
        protocol,
        correct,
        total: queries.len(),
        measures,
        queries,
        confusion,
        not_queried,
    }
}
