//! Signature Distance Distribution (the paper's SDD, section 4): a histogram of the distances between the signatures
//! of random pairs of vertices.

use crate::signature::Signatures;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Repetitions of the random choice of vertices, and pairs in each: about 10⁴ distances.
const REPETITIONS: usize = 10;
const PAIRS: usize = 1000;
/// Bins of the histogram.
const BINS: usize = 100;
/// The histogram ends where this share of the training shapes' distances does.
const COVERED: f64 = 0.995;

/// A histogram's range, shared by all shapes that are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignatureDistances {
    /// Upper end of the last bin; larger distances fall into it.
    pub largest: f64,
}

impl SignatureDistances {
    /// Chooses the range by training shapes.
    pub fn fit(training: &[&Signatures], seed: u64) -> Self {
        let all: Vec<Vec<f64>> = training.iter().map(|s| sample_distances(s, seed)).collect();
        let slices: Vec<&[f64]> = all.iter().map(Vec::as_slice).collect();
        Self::fit_distances(&slices)
    }

    /// As [`SignatureDistances::fit`], from distances that [`sample_distances`] gave.
    pub fn fit_distances(training: &[&[f64]]) -> Self {
        let mut all = training.concat();
        let at = ((all.len() as f64 * COVERED) as usize).min(all.len().saturating_sub(1));
        let largest = if all.is_empty() {
            1.0
        } else {
            *all.select_nth_unstable_by(at, f64::total_cmp).1
        };
        Self {
            largest: if largest > 0.0 { largest } else { 1.0 },
        }
    }

    /// The histogram of one shape: 100 shares that sum to 1.
    pub fn describe(&self, signatures: &Signatures, seed: u64) -> Vec<f64> {
        self.histogram(&sample_distances(signatures, seed))
    }

    /// As [`SignatureDistances::describe`], from distances that [`sample_distances`] gave.
    pub fn histogram(&self, distances: &[f64]) -> Vec<f64> {
        let mut histogram = vec![0.0; BINS];
        for d in distances {
            let bin = (d / self.largest * BINS as f64) as usize;
            histogram[bin.min(BINS - 1)] += 1.0 / distances.len() as f64;
        }
        histogram
    }
}

/// Euclidean distances between the signatures of 10⁴ random pairs of different vertices, the same pairs for the same
/// number of vertices and seed.
pub fn sample_distances(signatures: &Signatures, seed: u64) -> Vec<f64> {
    let n = signatures.len();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    if n < 2 {
        return vec![0.0];
    }
    let matrix = &signatures.matrix;
    (0..REPETITIONS * PAIRS)
        .map(|_| {
            let a = rng.random_range(0..n);
            let b = (a + rng.random_range(1..n)) % n;
            let squares = matrix.col(a).iter().zip(matrix.col(b).iter());
            squares.map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baseline::distance;
    use faer::Mat;

    #[test]
    fn histograms_tell_spread_shapes_from_narrow_ones() {
        let shape = |width: f64| Signatures {
            matrix: Mat::from_fn(4, 50, |i, j| width * ((i * 7 + j * 3) % 11) as f64),
            vertices: (0..50).collect(),
        };
        let (narrow, wide) = (shape(0.2), shape(1.0));
        let sdd = SignatureDistances::fit(&[&narrow, &wide], 1);
        let (a, b) = (sdd.describe(&narrow, 1), sdd.describe(&wide, 1));
        assert!((a.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(distance(&a, &b) > 5.0 * distance(&a, &sdd.describe(&narrow, 2)));
    }
}
