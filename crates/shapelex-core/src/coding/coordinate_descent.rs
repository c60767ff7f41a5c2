//! Cyclic coordinate descent: a slow way to the optimum that does not fail.

use super::dot::dot;
use super::optimality::violation;
use super::problem::{Problem, column};
use faer::MatRef;

/// Cyclic coordinate descent on `code` (L values, any start), until no condition is violated by more than the
/// problem's tolerance. Converges for every dictionary (Tseng 2001), slowly for coherent ones. Returns the violation
/// that is left.
pub(super) fn coordinate_descent(problem: &Problem<'_>, gram: MatRef<'_, f64>, code: &mut [f64]) -> f64 {
    const SWEEPS: usize = 20_000;
    let correlation: Vec<f64> = (0..code.len())
        .map(|j| dot(column(problem.atoms, j), problem.signal))
        .collect();
    let mut gradient = correlation.clone();
    let mut left = f64::INFINITY;
    for sweep in 0..SWEEPS {
        if sweep % 50 == 0 {
            // Afresh now and then: the updates below add up rounding.
            gradient.copy_from_slice(&correlation);
            for (j, &value) in code.iter().enumerate() {
                if value != 0.0 {
                    for (q, g) in gradient.iter_mut().zip(column(gram, j)) {
                        *q -= value * g;
                    }
                }
            }
            let pairs = gradient.iter().zip(code.iter());
            left = pairs
                .map(|(q, a)| violation(*q, *a, problem.lambda))
                .fold(0.0, f64::max);
            if left <= problem.tolerance {
                break;
            }
        }
        for j in 0..code.len() {
            let column = column(gram, j);
            if column[j] <= 0.0 {
                continue;
            }
            let free = gradient[j] + column[j] * code[j];
            let value = free.signum() * (free.abs() - problem.lambda).max(0.0) / column[j];
            let change = value - code[j];
            if change != 0.0 {
                code[j] = value;
                for (q, g) in gradient.iter_mut().zip(column) {
                    *q -= change * g;
                }
            }
        }
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::Cancel;
    use crate::coding::encode;
    use crate::coding::prepared::Prepared;
    use crate::coding::rows::Rows;
    use faer::Mat;

    #[test]
    fn coordinate_descent_ends_where_the_active_set_does() {
        let wave = |i: usize, j: usize| ((i * (j + 2)) as f64 * 0.37).sin() / 5.0;
        let dictionary = Prepared::new(Mat::from_fn(20, 12, wave)).unwrap();
        let signals = Mat::from_fn(20, 1, |i, _| (i as f64 * 0.9).cos() + 0.3);
        let codes = encode(&dictionary.clone().into(), signals.as_ref(), 0.05, &Cancel::new()).unwrap();
        let problem = Problem {
            atoms: dictionary.atoms().as_ref(),
            squares: dictionary.squares(),
            gram: None,
            rough_gram: &Rows::default(),
            rough_gram_error: 0.0,
            signal: signals.col_as_slice(0),
            norm: signals.norm_l2(),
            rough_correlation: &[],
            error: 0.0,
            lambda: 0.05,
            tolerance: 1e-11,
        };
        let mut code = vec![0.0; 12];
        assert!(coordinate_descent(&problem, dictionary.gram().as_ref(), &mut code) <= 1e-11);
        let nonzero: Vec<u32> = (0..12).filter(|&j| code[j as usize] != 0.0).collect();
        assert_eq!(nonzero, codes.atoms);
        assert!(nonzero.len() > 3);
        for (&j, value) in codes.atoms.iter().zip(&codes.values) {
            assert!((code[j as usize] - value).abs() < 1e-8);
        }
    }
}
