//! One unit of a benchmark: one method under one protocol over one category.

use super::evaluate::{LabelledShape, Models, Trial, run_rounds};
use super::measures::RetrievalMeasures;
use super::method::Method;
use super::nearest::{Inputs, nearest_rounds, nearest_scores};
use super::protocol::Round;
use super::query_result::{QueryResult, counts_as};
use super::report::{Count, DistanceHistogram, Mistake};
use super::retrieval::{RetrievalOutcome, coding_scores, judge_retrieval};
use super::robustness::{Member, Robustness, robustness_rounds};
use super::specimen::{Specimen, Wanted};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use shapelex_core::baseline::shape_dna::EIGENVALUES;
use shapelex_core::baseline::{SignatureDistances, sample_distances, shape_dna};
use shapelex_core::cancel::Cancel;
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::{PipelineError, learn_model};
use shapelex_core::signature::{Descriptor, DescriptorParameters, Signatures, describe_vertices};
use shapelex_core::spectral::SpectralError;
use std::sync::Arc;

/// Runs of Signature Distance Distribution whose mean is reported, as in the paper.
const RUNS: u64 = 5;
/// Length of the baselines' WKS and HKS.
const VALUES: usize = 100;
/// Frequencies of their SI-HKS, as in its paper's section 4.
const FREQUENCIES: usize = 6;

/// A method with its parameters.
#[derive(Clone, Debug)]
pub struct Setting {
    /// The method.
    pub method: Method,
    /// The parameters; those of a baseline only say what its mesh and spectrum are.
    pub parameters: Parameters,
    /// For a coding method, the place of its parameters among those the specimens were described for.
    pub place: usize,
}

/// A category's shapes: the null shapes first.
pub struct Shapes<'a> {
    /// Class and strength of each.
    pub members: Vec<Member>,
    /// The description of each; `None` where a deformed mesh could not be described.
    pub specimens: Vec<Option<&'a Specimen>>,
    /// The classes in order.
    pub classes: &'a [String],
    /// The category's name.
    pub category: &'a str,
    /// Groups of classes that count as one another's right answer.
    pub same: &'a [Vec<String>],
}

/// What a unit found out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Right answers and queries; a shape that could not be described is a wrong answer.
    pub count: Count,
    /// Mean score of the queries of class i under class j; empty for retrieval.
    pub matrix: Vec<Vec<f64>>,
    /// Wrong answers.
    pub mistakes: Vec<Mistake>,
    /// Means over all queries, for retrieval.
    pub measures: Option<RetrievalMeasures>,
    /// Histograms of distances, for Signature Distance Distribution under `null`.
    pub histograms: Vec<DistanceHistogram>,
}

/// Learns a dictionary of every null shape alone, which `null`, `retrieval` and `similarity_holes_range` share.
///
/// # Errors
/// The first error of describing or learning.
pub fn null_models(setting: &Setting, nulls: &[&Specimen], cancel: &Cancel) -> Result<Models, PipelineError> {
    let wanted = Wanted {
        training: true,
        query: false,
    };
    nulls
        .par_iter()
        .enumerate()
        .map(|(i, null)| {
            let (training, _) = null.descriptions(setting.place, &setting.parameters, wanted)?;
            let model = learn_model(&[&training], &setting.parameters, cancel, &|_, _| ())?;
            Ok((vec![i], Arc::new(model)))
        })
        .collect()
}

/// Runs a unit. `nulls` are the models of [`null_models`], by the null's place in `shapes`; baselines need none.
///
/// # Errors
/// The first error of describing, learning or ranking.
pub fn run_unit(
    setting: &Setting,
    protocol: Robustness,
    shapes: &Shapes<'_>,
    nulls: &Models,
    cancel: &Cancel,
) -> Result<Outcome, PipelineError> {
    // Rounds are laid over those that could be described, then over their places among all.
    let present: Vec<usize> = (0..shapes.members.len())
        .filter(|&i| shapes.specimens[i].is_some())
        .collect();
    let kept = Shapes {
        members: present.iter().map(|&i| shapes.members[i].clone()).collect(),
        specimens: present.iter().map(|&i| shapes.specimens[i]).collect(),
        ..*shapes
    };
    let rounds = robustness_rounds(protocol, &kept.members);
    let mut outcome = match setting.method {
        Method::Coding(_) => coding(setting, protocol, &kept, &rounds, nulls, cancel)?,
        method => baseline(method, setting, protocol, &kept, &rounds)?,
    };
    for member in shapes
        .members
        .iter()
        .zip(&shapes.specimens)
        .filter(|(_, s)| s.is_none())
    {
        outcome.count.total += 1;
        outcome
            .mistakes
            .push(mistake(shapes.category, member.0, "not described"));
    }
    Ok(outcome)
}

fn coding(
    setting: &Setting,
    protocol: Robustness,
    shapes: &Shapes<'_>,
    rounds: &[Round],
    nulls: &Models,
    cancel: &Cancel,
) -> Result<Outcome, PipelineError> {
    let parameters = &setting.parameters;
    let only_nulls = matches!(protocol, Robustness::Null | Robustness::SimilarityHolesRange);
    let labelled = shapes
        .members
        .par_iter()
        .zip(&shapes.specimens)
        .filter_map(|(member, specimen)| specimen.map(|s| (member, s)))
        .map(|(member, specimen)| {
            let wanted = Wanted {
                training: !only_nulls,
                query: !only_nulls || member.strength > 0,
            };
            let (training, query) = specimen.descriptions(setting.place, parameters, wanted)?;
            Ok(LabelledShape {
                class: member.class.clone(),
                name: member.strength.to_string(),
                training,
                query,
            })
        })
        .collect::<Result<Vec<_>, PipelineError>>()?;
    if protocol == Robustness::Retrieval {
        let scores = coding_scores(&labelled, parameters, nulls, cancel, &|_, _| ())?;
        return Ok(of_retrieval(&scores, shapes));
    }
    let trial = Trial {
        rounds,
        same: shapes.same,
        given: nulls,
    };
    let queries = run_rounds(&labelled, &trial, parameters, cancel, &|_, _| ())?;
    Ok(of_queries(&[queries], shapes))
}

fn baseline(
    method: Method,
    setting: &Setting,
    protocol: Robustness,
    shapes: &Shapes<'_>,
    rounds: &[Round],
) -> Result<Outcome, PipelineError> {
    let seed = setting.parameters.seed;
    let (runs, signatures): (Vec<(u64, Inputs)>, Vec<Signatures>) = match method {
        Method::Coding(_) => (Vec::new(), Vec::new()),
        Method::ShapeDna { relative } => {
            let dna = |s: &&Specimen| {
                let values = s.literal().map_or(&[][..], |l| &l.values);
                shape_dna(values, EIGENVALUES, relative)
            };
            let vectors = shapes.specimens.iter().flatten().map(dna).collect();
            (vec![(seed, Inputs::Vectors(vectors))], Vec::new())
        }
        Method::SignatureDistances(descriptor) => {
            let signatures = raw_signatures(shapes, descriptor)?;
            let runs = (0..RUNS)
                .map(|run| {
                    let seed = seed.wrapping_add(run);
                    (seed, Inputs::distances(&signatures, seed))
                })
                .collect();
            (runs, signatures)
        }
        Method::BagOfWords(descriptor) => {
            let signatures = raw_signatures(shapes, descriptor)?;
            (vec![(seed, Inputs::Words(signatures))], Vec::new())
        }
    };
    if protocol == Robustness::Retrieval {
        let outcomes: Vec<Outcome> = runs
            .par_iter()
            .map(|(seed, inputs)| of_retrieval(&nearest_scores(inputs, shapes.members.len(), *seed), shapes))
            .collect();
        return Ok(mean_of(outcomes));
    }
    let answers: Vec<Vec<QueryResult>> = runs
        .par_iter()
        .map(|(seed, inputs)| nearest_rounds(&shapes.members, inputs, rounds, shapes.same, *seed))
        .collect();
    let mut outcome = of_queries(&answers, shapes);
    if protocol == Robustness::Null && matches!(method, Method::SignatureDistances(_)) {
        outcome.histograms = histograms(method, shapes, &signatures, seed);
    }
    Ok(outcome)
}

/// Signatures of all vertices, not normalised, as the paper's comparison takes them.
fn raw_signatures(shapes: &Shapes<'_>, descriptor: Descriptor) -> Result<Vec<Signatures>, SpectralError> {
    let parameters = DescriptorParameters {
        descriptor,
        dimension: match descriptor {
            Descriptor::SiHks => FREQUENCIES,
            Descriptor::Wks | Descriptor::Hks => VALUES,
        },
        ..Parameters::default().descriptor_parameters()
    };
    shapes
        .specimens
        .par_iter()
        .flatten()
        .filter_map(|s| s.literal())
        .map(|spectrum| {
            let vertices: Vec<u32> = (0..spectrum.vertices()).collect();
            describe_vertices(&spectrum.eigenpairs(), &vertices, &parameters)
        })
        .collect()
}

/// The null shapes' histograms, and of every class the mean over the category's strengths; the nulls choose the range.
fn histograms(
    method: Method,
    shapes: &Shapes<'_>,
    signatures: &[Signatures],
    seed: u64,
) -> Vec<DistanceHistogram> {
    let distances: Vec<Vec<f64>> = signatures.par_iter().map(|s| sample_distances(s, seed)).collect();
    let of = |class: &str, null: bool| -> Vec<&[f64]> {
        let chosen = shapes.members.iter().zip(&distances);
        chosen
            .filter(|(m, _)| m.class == class && (m.strength == 0) == null)
            .map(|(_, d)| d.as_slice())
            .collect()
    };
    let nulls: Vec<&[f64]> = shapes.classes.iter().flat_map(|c| of(c, true)).collect();
    let range = SignatureDistances::fit_distances(&nulls);
    let mut all = Vec::new();
    for class in shapes.classes {
        for null in [true, false] {
            let members = of(class, null);
            let mut shares: Vec<f64> = Vec::new();
            for d in &members {
                let histogram = range.histogram(d);
                shares.resize(histogram.len(), 0.0);
                let weight = 1.0 / members.len() as f64;
                shares
                    .iter_mut()
                    .zip(histogram)
                    .for_each(|(sum, h)| *sum += weight * h);
            }
            if !members.is_empty() {
                all.push(DistanceHistogram {
                    method: method.name().to_owned(),
                    class: class.clone(),
                    category: (!null).then(|| shapes.category.to_owned()),
                    largest: range.largest,
                    shares,
                });
            }
        }
    }
    all
}

fn mistake(category: &str, member: &Member, answered: &str) -> Mistake {
    Mistake {
        category: category.to_owned(),
        class: member.class.clone(),
        strength: member.strength,
        answered: answered.to_owned(),
    }
}

/// Counts, mistakes (of the first run) and class matrix (of the first run) of the answers of one or more runs.
fn of_queries(runs: &[Vec<QueryResult>], shapes: &Shapes<'_>) -> Outcome {
    let Some(first) = runs.first() else {
        return Outcome::default();
    };
    let place = |class: &str| shapes.classes.iter().position(|c| c == class);
    let n = shapes.classes.len();
    let mut sums = vec![vec![0.0; n]; n];
    let mut counts = vec![0usize; n];
    for query in first {
        if let Some(i) = place(&query.class) {
            counts[i] += 1;
            for (class, score) in &query.ranked {
                if let Some(j) = place(class) {
                    sums[i][j] += score;
                }
            }
        }
    }
    for (row, count) in sums.iter_mut().zip(counts) {
        row.iter_mut().for_each(|v| *v /= count.max(1) as f64);
    }
    let mistakes = first
        .iter()
        .filter(|q| !q.correct)
        .map(|q| Mistake {
            category: shapes.category.to_owned(),
            class: q.class.clone(),
            strength: q.name.parse().unwrap_or(0),
            answered: q.ranked.first().map(|r| r.0.clone()).unwrap_or_default(),
        })
        .collect();
    let correct: usize = runs.iter().flatten().filter(|q| q.correct).count();
    Outcome {
        count: Count {
            correct: rounded_mean(correct, runs.len()),
            total: first.len(),
        },
        matrix: sums,
        mistakes,
        ..Outcome::default()
    }
}

fn of_retrieval(scores: &[Vec<f64>], shapes: &Shapes<'_>) -> Outcome {
    let classes: Vec<&str> = shapes.members.iter().map(|m| m.class.as_str()).collect();
    let RetrievalOutcome {
        correct,
        total,
        measures,
        nearest,
    } = judge_retrieval(scores, &classes, shapes.same);
    let wrong = |(i, j): (usize, Option<usize>)| {
        let answered = classes[j?];
        let right = counts_as(classes[i], answered, shapes.same);
        (!right).then(|| mistake(shapes.category, &shapes.members[i], answered))
    };
    Outcome {
        count: Count { correct, total },
        mistakes: nearest.into_iter().enumerate().filter_map(wrong).collect(),
        measures: Some(measures),
        ..Outcome::default()
    }
}

/// The mean over runs; lists are the first's.
fn mean_of(mut runs: Vec<Outcome>) -> Outcome {
    let measures: Vec<RetrievalMeasures> = runs.iter().filter_map(|r| r.measures.clone()).collect();
    let correct = runs.iter().map(|r| r.count.correct).sum();
    let mut mean = RetrievalMeasures::mean(&measures);
    mean.queries /= runs.len().max(1);
    let count = runs.len();
    if runs.is_empty() {
        return Outcome::default();
    }
    let mut first = runs.swap_remove(0);
    first.count.correct = rounded_mean(correct, count);
    first.measures = Some(mean);
    first
}

fn rounded_mean(sum: usize, count: usize) -> usize {
    (sum as f64 / count.max(1) as f64).round() as usize
}
