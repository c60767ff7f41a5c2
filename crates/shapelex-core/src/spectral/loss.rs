//! How much orthogonality the block recurrence has lost, estimated without reading the basis.
//!
//! Multiply the recurrence for block j from the left by V_kᵀ, the one for block k by V_jᵀ, and subtract: the products
//! Ω_{k,j} = V_kᵀV_j obey a recurrence of their own (Simon 1984, in its block form),
//!
//! Ω_{k,j+1} R_j = R_kᵀ Ω_{k+1,j} + A_k Ω_{k,j} + R_{k−1} Ω_{k−1,j} − Ω_{k,j} A_j − Ω_{k,j−1} R_{j−1}ᵀ + rounding.
//!
//! The size of the rounding term depends on the mesh and the factorisation; it is learnt from what each
//! re-orthogonalisation finds.

use super::block_qr::{Small, product, transposed, upper_inverse};

/// The estimate at which the basis is re-orthogonalised: the square root of the machine precision, rounded down.
const LIMIT: f64 = 1e-8;

/// Ω of a block just orthogonalised.
const FRESH: f64 = 1e-15;

/// Estimates of Ω_{k,j} for the last two blocks.
pub struct Loss<const B: usize> {
    previous: Vec<Small<B>>,
    current: Vec<Small<B>>,
    next: Vec<Small<B>>,
    /// Rounding of one step over ‖OP‖ times the machine precision.
    noise: f64,
    operator_norm: f64,
    /// Largest entry of the last estimate.
    estimate: f64,
}

fn constant<const B: usize>(value: f64) -> Small<B> {
    [[value; B]; B]
}

fn identity<const B: usize>() -> Small<B> {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }))
}

fn accumulate<const B: usize>(sum: &mut Small<B>, term: &Small<B>, sign: f64) {
    for (s, t) in sum.iter_mut().flatten().zip(term.iter().flatten()) {
        *s += sign * t;
    }
}

impl<const B: usize> Loss<B> {
    /// Before the first step: one block.
    pub fn new() -> Self {
        Self {
            previous: Vec::new(),
            current: vec![identity()],
            next: Vec::new(),
            noise: 4.0,
            operator_norm: 0.0,
            estimate: 0.0,
        }
    }

    /// Takes step j, where `diagonal` and `below` hold A and R of the steps before it and `a`, `r` are its own.
    /// Returns whether the new block is to be re-orthogonalised.
    pub fn advance(&mut self, diagonal: &[Small<B>], below: &[Small<B>], a: &Small<B>, r: &Small<B>) -> bool {
        let j = diagonal.len();
        let norm = a.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        self.operator_norm = self.operator_norm.max(norm);
        let rounding = self.noise * f64::EPSILON * self.operator_norm;
        let r_inverse = upper_inverse(r);
        self.next.clear();
        self.estimate = 0.0;
        // The neighbours j−1 and j have just been orthogonalised against.
        for k in 0..j.saturating_sub(1) {
            let mut sum = product(&transposed(&below[k]), &self.current[k + 1]);
            accumulate(&mut sum, &product(&diagonal[k], &self.current[k]), 1.0);
            if k > 0 {
                accumulate(&mut sum, &product(&below[k - 1], &self.current[k - 1]), 1.0);
            }
            accumulate(&mut sum, &product(&self.current[k], a), -1.0);
            accumulate(
                &mut sum,
                &product(&self.previous[k], &transposed(&below[j - 1])),
                -1.0,
            );
            for x in sum.iter_mut().flatten() {
                *x += rounding.copysign(*x);
            }
            let omega = product(&sum, &r_inverse);
            self.estimate = omega.iter().flatten().fold(self.estimate, |m, x| m.max(x.abs()));
            self.next.push(omega);
        }
        self.next.resize(j + 1, constant(FRESH));
        self.next.push(identity());
        std::mem::swap(&mut self.previous, &mut self.current);
        std::mem::swap(&mut self.current, &mut self.next);
        // A NaN asks for re-orthogonalisation too.
        self.estimate.is_nan() || self.estimate > LIMIT
    }

    /// After the current and the new block of step j were re-orthogonalised, `found` the largest product seen.
    pub fn reset_both(&mut self, j: usize, found: f64) {
        if self.estimate.is_finite() && self.estimate > 0.0 {
            // Aim at twice what is found, halfway on a logarithmic scale.
            let ratio = (2.0 * found / self.estimate).clamp(1e-4, 1e4);
            self.noise = (self.noise * ratio.sqrt()).clamp(1e-2, 1e6);
        }
        self.previous.clear();
        self.previous.resize(j, constant(FRESH));
        self.previous.push(identity());
        self.reset_current(j);
    }

    /// After the new block of step j alone was orthogonalised against the whole basis.
    pub fn reset_new(&mut self, j: usize) {
        std::mem::swap(&mut self.previous, &mut self.current);
        self.reset_current(j);
    }

    fn reset_current(&mut self, j: usize) {
        self.current.clear();
        self.current.resize(j + 1, constant(FRESH));
        self.current.push(identity());
    }
}
