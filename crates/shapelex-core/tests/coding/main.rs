//! The Lasso and dictionary learning against golden values, optimality conditions and known answers.

mod golden;
mod lasso;
mod learning;

use faer::Mat;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Smooth non-negative signals of unit norm, sums of Gaussian bumps: coherent as Wave Kernel Signatures are.
pub fn bumps(dimension: usize, count: usize, seed: u64) -> Mat<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut signals = Mat::zeros(dimension, count);
    for j in 0..count {
        let shape: Vec<(f64, f64, f64)> = (0..6)
            .map(|_| {
                (
                    random.random_range(0.0..1.0),
                    random.random_range(0.03..0.2),
                    random.random_range(0.0..1.0),
                )
            })
            .collect();
        for i in 0..dimension {
            let x = i as f64 / dimension as f64;
            signals[(i, j)] = 1.0
                + shape
                    .iter()
                    .map(|(at, width, height)| height * (-((x - at) / width).powi(2)).exp())
                    .sum::<f64>();
        }
        let norm = signals.col(j).norm_l2();
        signals.col_mut(j).iter_mut().for_each(|v| *v /= norm);
    }
    signals
}
