//! Bag of words over local signatures (Bronstein, Bronstein, Guibas, Ovsjanikov 2011): how often each of k typical
//! signatures occurs on a shape.

use crate::signature::Signatures;
use faer::Mat;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Rounds of Lloyd's algorithm at most.
const ROUNDS: usize = 30;
/// Signatures used at most to find the words.
const SIGNATURES: usize = 4000;

/// k words, the centres of k-means clusters.
#[derive(Clone, Debug)]
pub struct Vocabulary {
    /// M × k, one word per column.
    pub words: Mat<f64>,
}

impl Vocabulary {
    /// Finds `k` words by k-means, started by k-means++ (Arthur, Vassilvitskii 2007).
    pub fn learn(training: &[&Signatures], k: usize, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let signals = subset(training, &mut rng);
        let norms = squared_norms(&signals);
        let n = signals.ncols();
        let mut words = Mat::zeros(signals.nrows(), k.min(n));
        let mut nearest = vec![f64::INFINITY; n];
        let mut next = if n > 0 { rng.random_range(0..n) } else { 0 };
        for w in 0..words.ncols() {
            words.col_mut(w).copy_from(signals.col(next));
            let chosen = Mat::from_fn(signals.nrows(), 1, |i, _| signals[(i, next)]);
            for (best, d) in nearest
                .iter_mut()
                .zip(squared_distances(&chosen, &signals, &norms))
            {
                *best = best.min(d);
            }
            let total: f64 = nearest.iter().sum();
            let mut threshold = rng.random::<f64>() * total;
            next = nearest
                .iter()
                .position(|d| {
                    threshold -= d;
                    threshold <= 0.0
                })
                .unwrap_or(n.saturating_sub(1));
        }
        let mut vocabulary = Self { words };
        let mut assigned = vec![usize::MAX; n];
        for _ in 0..ROUNDS {
            let now = vocabulary.assign(&signals, &norms);
            if now == assigned {
                break;
            }
            assigned = now;
            vocabulary.move_to_means(&signals, &assigned);
        }
        vocabulary
    }

    /// How often each word is the nearest: k shares that sum to 1.
    pub fn describe(&self, signatures: &Signatures) -> Vec<f64> {
        let mut histogram = vec![0.0; self.words.ncols()];
        for word in self.assign(&signatures.matrix, &squared_norms(&signatures.matrix)) {
            histogram[word] += 1.0 / signatures.len() as f64;
        }
        histogram
    }

    /// The nearest word of every column; `norms` are the columns' squared norms.
    fn assign(&self, signals: &Mat<f64>, norms: &[f64]) -> Vec<usize> {
        let k = self.words.ncols();
        let distances = squared_distances(&self.words, signals, norms);
        distances
            .chunks_exact(k.max(1))
            .map(|row| {
                row.iter()
                    .enumerate()
                    .min_by(|a, b| a.1.total_cmp(b.1))
                    .map_or(0, |(w, _)| w)
            })
            .collect()
    }

    /// Every word becomes the mean of its signals; one without signals stays.
    fn move_to_means(&mut self, signals: &Mat<f64>, assigned: &[usize]) {
        let mut sums = Mat::<f64>::zeros(self.words.nrows(), self.words.ncols());
        let mut counts = vec![0usize; self.words.ncols()];
        for (j, &w) in assigned.iter().enumerate() {
            counts[w] += 1;
            let mut sum = sums.col_mut(w);
            sum += signals.col(j);
        }
        for (w, &count) in counts.iter().enumerate().filter(|(_, c)| **c > 0) {
            for i in 0..sums.nrows() {
                self.words[(i, w)] = sums[(i, w)] / count as f64;
            }
        }
    }
}

/// ‖s‖² of every column.
fn squared_norms(signals: &Mat<f64>) -> Vec<f64> {
    (0..signals.ncols())
        .map(|j| signals.col(j).squared_norm_l2())
        .collect()
}

/// ‖w − s‖² of every word (M × k) and signal (M × N, of squared norms `norms`): N rows of k, one after the other.
fn squared_distances(words: &Mat<f64>, signals: &Mat<f64>, norms: &[f64]) -> Vec<f64> {
    let products = words.transpose() * signals;
    let word_norms = squared_norms(words);
    let mut distances = Vec::with_capacity(words.ncols() * signals.ncols());
    for (j, own) in norms.iter().enumerate() {
        distances.extend(
            word_norms
                .iter()
                .enumerate()
                .map(|(w, n)| (own + n - 2.0 * products[(w, j)]).max(0.0)),
        );
    }
    distances
}

/// All signatures side by side, or a random subset of them.
fn subset(training: &[&Signatures], rng: &mut ChaCha8Rng) -> Mat<f64> {
    let mut columns: Vec<(usize, usize)> = training
        .iter()
        .enumerate()
        .flat_map(|(s, sig)| (0..sig.len()).map(move |j| (s, j)))
        .collect();
    while columns.len() > SIGNATURES {
        let gone = rng.random_range(0..columns.len());
        columns.swap_remove(gone);
    }
    let dimension = training.first().map_or(0, |s| s.dimension());
    Mat::from_fn(dimension, columns.len(), |i, j| {
        let (shape, column) = columns[j];
        training[shape].matrix[(i, column)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_the_centres_of_clusters() {
        // Three tight clusters at 0, 10 and 20 with 30, 20 and 10 members.
        let sizes = [30, 20, 10];
        let centre = |j: usize| {
            if j < 30 {
                0.0
            } else if j < 50 {
                10.0
            } else {
                20.0
            }
        };
        let matrix = Mat::from_fn(2, 60, |i, j| centre(j) + 0.01 * ((i + j) % 5) as f64);
        let signatures = Signatures {
            matrix,
            vertices: (0..60).collect(),
        };
        let vocabulary = Vocabulary::learn(&[&signatures], 3, 4);
        let mut shares = vocabulary.describe(&signatures);
        shares.sort_by(f64::total_cmp);
        for (share, size) in shares.iter().zip(sizes.iter().rev()) {
            assert!((share - f64::from(*size) / 60.0).abs() < 1e-12, "{shares:?}");
        }
    }
}
