//! How well queries of no indexed class are told from the others, and whether the sets of possible classes hold what
//! they promise.

use super::evaluate::LabelledShape;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use shapelex_core::cancel::Cancel;
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::{Description, HeldOutScores, PipelineError, held_out_scores, learn_model};
use shapelex_core::ranking::{
    Calibration, Candidate, HeldOut, Index, IndexedClass, SIGNIFICANCE, Verdict, rank,
};
use std::collections::{BTreeMap, BTreeSet};

/// Some of some.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Share {
    /// How many.
    pub count: usize,
    /// Of how many.
    pub total: usize,
}

impl Share {
    /// count / total, 0 of none.
    pub fn value(&self) -> f64 {
        if self.total == 0 {
            0.0
        } else {
            self.count as f64 / self.total as f64
        }
    }

    fn add(&mut self, hit: bool) {
        self.count += usize::from(hit);
        self.total += 1;
    }
}

/// Levels that the sets of possible classes are tried at, beside the one that counts.
const LEVELS: [f64; 9] = [0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5];

/// What came of an open-set evaluation at one level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AtLevel {
    /// A class is possible while its p-value is above this.
    pub level: f64,
    /// Queries of indexed classes whose set of possible classes holds the true one; 1 − level of them is promised.
    pub covered: Share,
}

/// What came of an open-set evaluation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OpenSet {
    /// Queries of indexed classes whose set of possible classes holds the true one; 95 % is promised.
    pub covered: Share,
    /// Queries of indexed classes answered "none of these".
    pub refused_known: Share,
    /// Queries answered "none of these" while their class, and those that count as the same, were left out of the index.
    pub refused_unknown: Share,
    /// The latter by class.
    pub refused_by_class: BTreeMap<String, Share>,
    /// Mean number of possible classes of a query of an indexed class.
    pub mean_set_size: f64,
    /// Coverage at other levels, ascending.
    pub by_level: Vec<AtLevel>,
    /// Queries of indexed classes whose verdict names classes and has a probability, and those of them for which one of
    /// the named classes is the true one.
    #[serde(default)]
    pub named_right: Share,
    /// Sum of these verdicts' probabilities, for comparison with the count of right ones: it is meant to be no larger.
    #[serde(default)]
    pub promised_right: f64,
    /// Classes left out because they have fewer than three shapes.
    pub left_out: Vec<String>,
}

impl OpenSet {
    /// Adds the counts of another split of the same shapes.
    pub fn add(&mut self, other: &Self) {
        let sum = |a: &mut Share, b: &Share| {
            a.count += b.count;
            a.total += b.total;
        };
        let sets = self.mean_set_size * self.covered.total as f64;
        let other_sets = other.mean_set_size * other.covered.total as f64;
        sum(&mut self.covered, &other.covered);
        sum(&mut self.refused_known, &other.refused_known);
        sum(&mut self.named_right, &other.named_right);
        self.promised_right += other.promised_right;
        sum(&mut self.refused_unknown, &other.refused_unknown);
        for (class, share) in &other.refused_by_class {
            sum(self.refused_by_class.entry(class.clone()).or_default(), share);
        }
        self.by_level.resize(other.by_level.len(), AtLevel::default());
        for (own, at) in self.by_level.iter_mut().zip(&other.by_level) {
            own.level = at.level;
            sum(&mut own.covered, &at.covered);
        }
        self.mean_set_size = (sets + other_sets) / self.covered.total.max(1) as f64;
        self.left_out.clone_from(&other.left_out);
    }
}

/// Half of every class trains, drawn by the seed, and the other half is queried. Then one class after the other is left
/// out of the index and all its shapes are queried. Open shapes train but are not queried, as no answer about them is
/// judged. Groups of `same` count as one class and are left out together.
/// `None` where too few shapes train to calibrate anything.
///
/// # Errors
/// The first error of learning or ranking.
pub fn evaluate_open_set(
    shapes: &[LabelledShape],
    parameters: &Parameters,
    same: &[Vec<String>],
    seed: u64,
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Option<OpenSet>, PipelineError> {
    let mut members: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (i, shape) in shapes.iter().enumerate() {
        members.entry(&shape.class).or_default().push(i);
    }
    let left_out: Vec<String> = members
        .iter()
        .filter(|(_, list)| list.len() < 3)
        .map(|(class, _)| (*class).to_owned())
        .collect();
    members.retain(|_, list| list.len() >= 3);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut train: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (class, list) in &members {
        let mut dealt = list.clone();
        dealt.shuffle(&mut rng);
        dealt.truncate(list.len().div_ceil(2));
        dealt.sort_unstable();
        train.insert(class, dealt);
    }
    let judged = |i: &usize| !shapes[*i].query.report.is_open();
    let queried: Vec<usize> = members.values().flatten().copied().filter(judged).collect();
    let total = train.len() + queried.len();
    let done = std::sync::atomic::AtomicUsize::new(0);
    let tick = || progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1, total);
    let learnt: Vec<(IndexedClass, HeldOutScores)> = train
        .par_iter()
        .map(|(class, list)| {
            let training: Vec<&Description> = list.iter().map(|&i| &shapes[i].training).collect();
            let class = IndexedClass {
                label: (*class).to_owned(),
                dictionaries: learn_model(&training, parameters, cancel, &|_, _| ())?.dictionaries,
                shapes: Vec::new(),
            };
            let held_out = held_out_scores(&training, parameters, cancel)?;
            tick();
            Ok((class, held_out))
        })
        .collect::<Result<_, PipelineError>>()?;
    let held_out: BTreeMap<String, HeldOutScores> = learnt
        .iter()
        .map(|(class, scores)| (class.label.clone(), scores.clone()))
        .collect();
    let index = Index {
        parameters: parameters.clone(),
        classes: learnt.into_iter().map(|(class, _)| class).collect(),
    };
    let rankings: Vec<Vec<(String, f64)>> = queried
        .par_iter()
        .map(|&i| {
            let ranking = rank(&shapes[i].query.views, &index, parameters.rank_by, cancel)?;
            tick();
            Ok(ranking.classes.into_iter().map(|c| (c.label, c.score)).collect())
        })
        .collect::<Result<_, PipelineError>>()?;
    let group = |class: &str| -> BTreeSet<String> {
        same.iter()
            .filter(|g| g.iter().any(|c| c == class))
            .flatten()
            .cloned()
            .chain([class.to_owned()])
            .collect()
    };
    let calibration = |without: &BTreeSet<String>| {
        Calibration::fit(
            held_out
                .iter()
                .filter(|(class, _)| !without.contains(*class))
                .map(|(class, scores)| HeldOut {
                    label: class,
                    scores: &scores.distinct,
                    copies: &scores.copies,
                }),
        )
        .ok()
    };
    let Some(full) = calibration(&BTreeSet::new()) else {
        return Ok(None);
    };
    let mut result = OpenSet {
        by_level: LEVELS
            .map(|level| AtLevel {
                level,
                ..AtLevel::default()
            })
            .to_vec(),
        left_out,
        ..OpenSet::default()
    };
    let mut possible = 0;
    for (&i, ranked) in queried.iter().zip(&rankings) {
        let class = shapes[i].class.as_str();
        if train[class].contains(&i) {
            continue;
        }
        let truth = group(class);
        let verdict = full.judge(ranked.iter().map(|(label, score)| (label.as_str(), *score)));
        let possible_at = |level: f64| -> Vec<&str> {
            let judged = ranked.iter().zip(&verdict.p_values);
            let kept = judged.filter(|(_, p)| p.is_err() || p.is_ok_and(|p| p > level));
            kept.map(|((label, _), _)| label.as_str()).collect()
        };
        let set = possible_at(SIGNIFICANCE);
        for at in &mut result.by_level {
            let set = possible_at(at.level);
            at.covered.add(set.iter().any(|label| truth.contains(*label)));
        }
        possible += set.len();
        result.covered.add(set.iter().any(|label| truth.contains(*label)));
        result.refused_known.add(verdict.none_of_these);
        let candidates: Vec<Candidate<'_>> = ranked
            .iter()
            .zip(verdict.p_values)
            .map(|((name, _), p_value)| Candidate { name, p_value })
            .collect();
        let verdict = Verdict::of(&candidates, full.least_p_value());
        if let (false, Some(probability)) = (verdict.named.is_empty(), verdict.probability) {
            let right = verdict.named.iter().any(|&i| truth.contains(candidates[i].name));
            result.named_right.add(right);
            result.promised_right += probability;
        }
    }
    result.mean_set_size = possible as f64 / result.covered.total.max(1) as f64;
    for class in members.keys() {
        let without = group(class);
        let Some(calibration) = calibration(&without) else {
            continue;
        };
        let mut share = Share::default();
        let own = queried
            .iter()
            .zip(&rankings)
            .filter(|(i, _)| shapes[**i].class == **class);
        for (_, ranked) in own {
            let others = ranked
                .iter()
                .filter(|(label, _)| !without.contains(label))
                .map(|(label, score)| (label.as_str(), *score));
            share.add(calibration.judge(others).none_of_these);
        }
        result.refused_unknown.count += share.count;
        result.refused_unknown.total += share.total;
        result.refused_by_class.insert((*class).to_owned(), share);
    }
    Ok(Some(result))
}
