//! A query's signals as mixtures of a few anchors.

use super::coarse::{SUMMARY, Summary, group_means, summaries};
use faer::{Mat, MatRef};

/// Anchors a signal is mixed from, at most.
const MIXED: usize = 6;
/// Steps to the best mixture; it need not be exact.
const STEPS: usize = 40;

/// K anchors c_g and N signals s_i ≈ Σ_g w_ig c_g with weights w ≥ 0 that sum to 1, as far as sums over the signals
/// need them.
#[derive(Clone, Debug)]
pub(super) struct Anchors {
    /// The anchors, M × K.
    pub points: Mat<f64>,
    /// (1/N) Σ_i w_ig s_i in column g, M × K.
    pub sums: Mat<f64>,
    /// Every signal's anchors g and weights w_ig.
    pub mixtures: Vec<Vec<(u32, f64)>>,
    /// g ≤ h and (1/N) Σ_i w_ig w_ih, counted twice where g < h, for the pairs where that is not zero.
    pub pairs: Vec<(u32, u32, f64)>,
}

/// Anchors for every number in `sizes` (ascending): the means of groups of signals that are alike.
pub(super) fn anchors(signals: MatRef<'_, f64>, sizes: &[usize]) -> Vec<Anchors> {
    let of_signals = summaries(signals);
    group_means(signals, &of_signals, sizes)
        .into_iter()
        .map(|points| {
            let of_points = summaries(points.as_ref());
            let (m, n, k) = (signals.nrows(), signals.ncols(), points.ncols());
            let share = (n as f64).recip();
            let mut sums = Mat::zeros(m, k);
            let mut products = vec![0.0; k * k];
            let mut mixtures = Vec::with_capacity(n);
            for (i, summary) in of_signals.iter().enumerate() {
                let mixture = mixture(summary, &of_points);
                for &(g, weight) in &mixture {
                    for (sum, s) in sums.col_as_slice_mut(g).iter_mut().zip(signals.col(i).iter()) {
                        *sum += share * weight * s;
                    }
                    for &(h, other) in &mixture {
                        products[g.min(h) * k + g.max(h)] += share * weight * other;
                    }
                }
                mixtures.push(mixture.into_iter().map(|(g, w)| (g as u32, w)).collect());
            }
            let pairs = (0..k * k)
                .filter(|at| products[*at] > 0.0)
                .map(|at| ((at / k) as u32, (at % k) as u32, products[at]));
            Anchors {
                pairs: pairs.collect(),
                points,
                sums,
                mixtures,
            }
        })
        .collect()
}

/// Weights ≥ 0 that sum to 1 and bring Σ w_g c_g near the signal: of its nearest anchors, by moving weight from the
/// one that errs most to the one that helps most (sequential minimal optimisation of ‖s − Σ w_g c_g‖²).
fn mixture(signal: &Summary, points: &[Summary]) -> Vec<(usize, f64)> {
    let mut nearest: Vec<(f64, usize)> = points
        .iter()
        .enumerate()
        .map(|(g, point)| (distance2(signal, point), g))
        .collect();
    let count = MIXED.min(nearest.len());
    if count < nearest.len() {
        nearest.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.truncate(count);
    }
    nearest.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let offset = |a: usize, k: usize| points[nearest[a].1][k] - signal[k];
    let mut gram = [[0.0; MIXED]; MIXED];
    for (a, row) in gram.iter_mut().enumerate().take(count) {
        for (b, product) in row.iter_mut().enumerate().take(count) {
            *product = (0..SUMMARY).map(|k| offset(a, k) * offset(b, k)).sum();
        }
    }
    let mut weights = [0.0; MIXED];
    weights[0] = 1.0;
    // Half the gradient of wᵀGw.
    let mut gradient = gram[0];
    for _ in 0..STEPS {
        let (mut to, mut from) = (0, usize::MAX);
        for a in 0..count {
            if gradient[a] < gradient[to] {
                to = a;
            }
            if weights[a] > 0.0 && (from == usize::MAX || gradient[a] > gradient[from]) {
                from = a;
            }
        }
        if from == usize::MAX || from == to || gradient[from] - gradient[to] <= 1e-3 * gram[0][0] {
            break;
        }
        let curvature = gram[to][to] + gram[from][from] - 2.0 * gram[to][from];
        if curvature <= 0.0 {
            break;
        }
        let step = ((gradient[from] - gradient[to]) / curvature).min(weights[from]);
        weights[to] += step;
        weights[from] -= step;
        for a in 0..count {
            gradient[a] += step * (gram[a][to] - gram[a][from]);
        }
    }
    (0..count)
        .filter(|a| weights[*a] > 0.0)
        .map(|a| (nearest[a].1, weights[a]))
        .collect()
}

fn distance2(a: &Summary, b: &Summary) -> f64 {
    let mut sum = 0.0;
    for k in 0..SUMMARY {
        sum += (a[k] - b[k]) * (a[k] - b[k]);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixtures_are_convex_and_meet_signals_between_anchors() {
        let signals = Mat::from_fn(32, 400, |i, j| {
            (i as f64 * 0.2 + j as f64 * 0.005).sin() + 0.1 * (j % 7) as f64
        });
        for anchors in anchors(signals.as_ref(), &[4, 32]) {
            let k = anchors.points.ncols();
            let total: f64 = anchors.pairs.iter().map(|(_, _, w)| w).sum();
            assert!(
                (total - 1.0).abs() < 1e-12,
                "squares of weights that sum to 1: {total}"
            );
            for i in 0..32 {
                let mean: f64 = (0..k).map(|g| anchors.sums[(i, g)]).sum();
                let expected: f64 = signals.row(i).iter().sum::<f64>() / 400.0;
                assert!((mean - expected).abs() < 1e-12);
            }
        }
        let corner = |x: f64| std::array::from_fn(|k| if k < 2 { x * (k as f64 + 1.0) } else { 0.0 });
        let mixed = mixture(&corner(0.25), &[corner(0.0), corner(1.0)]);
        assert_eq!(mixed.len(), 2);
        assert!((mixed[0].1 - 0.75).abs() < 1e-9 && (mixed[1].1 - 0.25).abs() < 1e-9);
    }
}
