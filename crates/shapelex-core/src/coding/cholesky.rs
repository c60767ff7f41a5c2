//! A Cholesky factor that grows and shrinks by one row: the Gram matrix of an active set.

use super::packed::start;

/// The smallest pivot, relative to the new atom's squared norm, with which an atom still counts as independent of
/// the set. Rounding leaves about 1e-14 where an atom is an exact combination of the others.
const DEPENDENT: f64 = 1e-12;

/// Lower factor F of a symmetric positive definite matrix, G = F Fᵀ, by packed rows: row i has i + 1 entries, so all
/// loops run over adjacent memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Factor {
    rows: Vec<f64>,
    inverse_diagonal: Vec<f64>,
    /// Cosines and sines of the rotations of the deletion under way, by column.
    rotations: Vec<(f64, f64)>,
}

/// xᵀy of equally many values: the eights in eight sums side by side, then what is left, one after the other.
///
/// The last value of a row's solution was written just before it is read here. Read on its own it comes from the
/// processor's store buffer; as part of a vector it would have to be waited for.
#[inline(always)]
fn short_dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (x8, y8) = (x.chunks_exact(8), y.chunks_exact(8));
    let mut tail = 0.0;
    for (a, b) in x8.remainder().iter().zip(y8.remainder()) {
        tail += a * b;
    }
    for (a, b) in x8.zip(y8) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    for width in [4, 2, 1] {
        for k in 0..width {
            sums[k] += sums[k + width];
        }
    }
    sums[0] + tail
}

impl Factor {
    /// Number of rows.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.inverse_diagonal.len()
    }

    /// Forgets all rows, keeps the memory.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.rows.clear();
        self.inverse_diagonal.clear();
    }

    /// Appends a row: `column` holds the new row of G up to, not including, its diagonal, and is overwritten by the
    /// new row of F. False, and nothing changed but `column`, where the new row depends on the others.
    #[inline(always)]
    pub fn push(&mut self, column: &mut [f64], diagonal: f64) -> bool {
        self.solve_lower(column);
        let pivot = diagonal - short_dot(column, column);
        if pivot.is_nan() || pivot <= DEPENDENT * diagonal {
            return false;
        }
        let root = pivot.sqrt();
        self.rows.extend_from_slice(column);
        self.rows.push(root);
        self.inverse_diagonal.push(root.recip());
        true
    }

    /// Deletes row and column `k` of G, by Givens rotations: O((len − k)²).
    #[inline(always)]
    pub fn remove(&mut self, k: usize) {
        let len = self.len();
        self.rotations.clear();
        // The rows below lose column k of G; each keeps one entry too many, which rotations of neighbouring columns
        // carry to the right and out. Row i goes to row i − 1, which starts i entries earlier.
        for i in k + 1..len {
            let (from, to) = (start(i), start(i - 1));
            let mut carried = self.rows[from + k];
            self.rows.copy_within(from..from + k, to);
            for j in k..i - 1 {
                // The rotation that was fixed when row j + 1 of the old factor came by.
                let (c, s) = self.rotations[j - k];
                let next = self.rows[from + j + 1];
                self.rows[to + j] = c * carried + s * next;
                carried = c * next - s * carried;
            }
            let next = self.rows[from + i];
            let root = (carried * carried + next * next).sqrt();
            self.rows[to + i - 1] = root;
            self.inverse_diagonal[i - 1] = root.recip();
            self.rotations.push((carried / root, next / root));
        }
        self.rows.truncate(start(len - 1));
        self.inverse_diagonal.truncate(len - 1);
    }

    /// x ← F⁻¹ x.
    #[inline(always)]
    pub fn solve_lower(&self, x: &mut [f64]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx512f") {
            // SAFETY: the function needs nothing but AVX-512F, which was just detected.
            return unsafe { super::wide_factor::solve_lower(&self.rows, &self.inverse_diagonal, x) };
        }
        self.solve_lower_portably(x);
    }

    #[inline(always)]
    fn solve_lower_portably(&self, x: &mut [f64]) {
        for i in 0..x.len() {
            let (done, rest) = x.split_at_mut(i);
            rest[0] = self.solve_row(i, done, rest[0]);
        }
    }

    /// Entry `i` of F⁻¹ b, from b_i = `value` and the entries before it.
    #[inline(always)]
    pub fn solve_row(&self, i: usize, before: &[f64], value: f64) -> f64 {
        let row = &self.rows[start(i)..start(i) + i];
        (value - short_dot(row, before)) * self.inverse_diagonal[i]
    }

    /// x ← F⁻ᵀ x.
    #[inline(always)]
    pub fn solve_upper(&self, x: &mut [f64]) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx512f") {
            // SAFETY: the function needs nothing but AVX-512F, which was just detected.
            return unsafe { super::wide_factor::solve_upper(&self.rows, &self.inverse_diagonal, x) };
        }
        self.solve_upper_portably(x);
    }

    #[inline(always)]
    fn solve_upper_portably(&self, x: &mut [f64]) {
        for i in (0..x.len()).rev() {
            let (before, rest) = x.split_at_mut(i);
            let value = rest[0] * self.inverse_diagonal[i];
            rest[0] = value;
            let row = &self.rows[start(i)..start(i) + i];
            for (b, r) in before.iter_mut().zip(row) {
                *b -= value * r;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gram matrix of the points' Gaussian kernel: positive definite, neighbours 0.9 alike.
    fn gram(i: usize, j: usize) -> f64 {
        (-0.1 * (i as f64 - j as f64).powi(2)).exp()
    }

    fn push(factor: &mut Factor, kept: &mut Vec<usize>, point: usize) {
        let mut column: Vec<f64> = kept.iter().map(|&i| gram(i, point)).collect();
        assert!(factor.push(&mut column, 1.0));
        kept.push(point);
    }

    #[test]
    fn rows_come_and_go_and_the_factor_still_solves() {
        let (mut factor, mut kept) = (Factor::default(), Vec::new());
        for point in 0..24 {
            push(&mut factor, &mut kept, point * 7 % 24);
            if point % 3 == 2 {
                let k = point * 5 % kept.len();
                factor.remove(k);
                kept.remove(k);
            }
            let wanted: Vec<f64> = kept.iter().map(|&i| i as f64 - 3.0).collect();
            let mut x: Vec<f64> = kept
                .iter()
                .map(|&i| kept.iter().zip(&wanted).map(|(&j, w)| gram(i, j) * w).sum())
                .collect();
            factor.solve_lower(&mut x);
            factor.solve_upper(&mut x);
            for (found, wanted) in x.iter().zip(&wanted) {
                assert!((found - wanted).abs() < 1e-6, "{found} against {wanted}");
            }
        }
        assert_eq!(factor.len(), 16);
        for k in [15, 0, 7] {
            factor.remove(k);
        }
        assert_eq!(factor.len(), 13);
    }

    #[test]
    fn all_forms_of_the_solves_give_the_same_to_the_last_bit() {
        let (mut factor, mut kept) = (Factor::default(), Vec::new());
        for size in 0..35 {
            let b: Vec<f64> = (0..size).map(|i| (1.7 * f64::from(i)).sin()).collect();
            let (mut fast, mut portable) = (b.clone(), b);
            factor.solve_lower(&mut fast);
            factor.solve_lower_portably(&mut portable);
            assert_eq!(fast, portable, "{size}");
            factor.solve_upper(&mut fast);
            factor.solve_upper_portably(&mut portable);
            assert_eq!(fast, portable, "{size}");
            push(&mut factor, &mut kept, 3 * size as usize);
        }
    }

    #[test]
    fn a_dependent_row_is_refused_and_leaves_the_factor_as_it_was() {
        let mut factor = Factor::default();
        assert!(factor.push(&mut [], 1.0));
        assert!(!factor.push(&mut [1.0], 1.0));
        assert!(!factor.push(&mut [0.0], 0.0));
        assert!(!factor.push(&mut [f64::NAN], 1.0));
        assert_eq!(factor.len(), 1);
        assert!(factor.push(&mut [0.5], 1.0));
    }
}
