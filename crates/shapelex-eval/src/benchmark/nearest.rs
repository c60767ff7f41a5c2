//! The baselines in a benchmark: every shape one vector, the class of the nearest training shape the answer.

use super::evaluate::judge;
use super::protocol::Round;
use super::query_result::QueryResult;
use super::robustness::Member;
use rayon::prelude::*;
use shapelex_core::baseline::{SignatureDistances, Vocabulary, distance, sample_distances};
use shapelex_core::signature::Signatures;

/// Words of a bag of words.
pub const WORDS: usize = 64;

/// What a baseline makes its vectors from, one entry per shape.
#[derive(Clone, Debug)]
pub enum Inputs {
    /// The vectors themselves, such as Shape DNA.
    Vectors(Vec<Vec<f64>>),
    /// Distances between random pairs of signatures.
    Distances(Vec<Vec<f64>>),
    /// Signatures that become words.
    Words(Vec<Signatures>),
}

impl Inputs {
    /// The distances of one run of Signature Distance Distribution; `seed` draws the pairs.
    pub fn distances(signatures: &[Signatures], seed: u64) -> Self {
        let all = signatures.par_iter().map(|s| sample_distances(s, seed));
        Self::Distances(all.collect())
    }

    /// One vector per shape; ranges and words are chosen by the training shapes alone.
    pub fn vectors(&self, training: &[usize], seed: u64) -> Vec<Vec<f64>> {
        match self {
            Self::Vectors(vectors) => vectors.clone(),
            Self::Distances(distances) => {
                let chosen: Vec<&[f64]> = training.iter().map(|&i| distances[i].as_slice()).collect();
                let range = SignatureDistances::fit_distances(&chosen);
                distances.iter().map(|d| range.histogram(d)).collect()
            }
            Self::Words(signatures) => {
                let chosen: Vec<&Signatures> = training.iter().map(|&i| &signatures[i]).collect();
                let words = Vocabulary::learn(&chosen, WORDS, seed);
                signatures.par_iter().map(|s| words.describe(s)).collect()
            }
        }
    }
}

/// Answers the queries of all rounds; a class's score is the distance of its nearest training shape.
pub fn nearest_rounds(
    members: &[Member],
    inputs: &Inputs,
    rounds: &[Round],
    same: &[Vec<String>],
    seed: u64,
) -> Vec<QueryResult> {
    rounds
        .par_iter()
        .flat_map_iter(|round| {
            let training: Vec<usize> = round.train.values().flatten().copied().collect();
            let vectors = inputs.vectors(&training, seed);
            round
                .query
                .iter()
                .map(|&q| {
                    let mut ranked: Vec<(String, f64)> = round
                        .train
                        .iter()
                        .map(|(class, list)| {
                            let nearest = list
                                .iter()
                                .map(|&t| distance(&vectors[q], &vectors[t]))
                                .fold(f64::INFINITY, f64::min);
                            (class.clone(), nearest)
                        })
                        .collect();
                    ranked.sort_by(|a, b| a.1.total_cmp(&b.1).then_with(|| a.0.cmp(&b.0)));
                    judge(&members[q].class, &members[q].strength.to_string(), ranked, same)
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

/// Distances of all pairs of shapes; ranges and words are chosen by all of them.
pub fn nearest_scores(inputs: &Inputs, shapes: usize, seed: u64) -> Vec<Vec<f64>> {
    let all: Vec<usize> = (0..shapes).collect();
    let vectors = inputs.vectors(&all, seed);
    vectors
        .iter()
        .map(|a| vectors.iter().map(|b| distance(a, b)).collect())
        .collect()
}
