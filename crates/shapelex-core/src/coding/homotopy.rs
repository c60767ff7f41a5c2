//! From nothing to a signal's code along the Lasso path (Osborne, Presnell, Turlach 2000; Efron, Hastie, Johnstone,
//! Tibshirani 2004), for codes of few non-zeros.
//!
//! At the level ℓ = max |d_jᵀs| the code is zero. As ℓ falls to λ, the values of the atoms in the set move on straight
//! lines that keep |q_j| = ℓ for them; an atom enters where its |q_j| meets ℓ and leaves where its value meets zero. For
//! few non-zeros that is hardly more looks at the gradient than the code has atoms, and it needs no start.

use super::dot::dot;
use super::problem::{Problem, column};
use super::rows::{Lanes, pieces};
use super::scan::{first_crossing, largest_magnitude, move_towards, place_of, residual_gradient};

/// Atoms that the path may hold. Beyond about so many the active set, which takes in several atoms at a look, is faster.
pub(super) const MAX_ACTIVE: usize = 8;
/// Steps after which rounding must have led the path in a circle.
const MAX_STEPS: usize = 4 * MAX_ACTIVE;
/// The smallest pivot, relative to an atom's squared norm, that the path goes on with.
const DEPENDENT: f64 = 1e-10;

/// The set on the path, with its Cholesky factor, in arrays of fixed size.
#[derive(Clone, Debug, Default)]
pub(super) struct Path {
    /// Atoms in the set; the arrays hold nothing beyond.
    pub count: usize,
    pub atoms: [usize; MAX_ACTIVE],
    /// The code at the level reached.
    pub values: [f64; MAX_ACTIVE],
    pub signs: [f64; MAX_ACTIVE],
    /// d_jᵀs, as exactly as it is known.
    pub correlations: [f64; MAX_ACTIVE],
    /// The code at λ if the set stays as it is.
    target: [f64; MAX_ACTIVE],
    /// F⁻¹ (c_A − λ sign).
    forward: [f64; MAX_ACTIVE],
    /// Lower, by rows, F Fᵀ = G_AA; the diagonal apart, as reciprocals.
    factor: [[f64; MAX_ACTIVE]; MAX_ACTIVE],
    inverse_diagonal: [f64; MAX_ACTIVE],
}

/// How far the path came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Outcome {
    /// At the exact solution.
    Solved,
    /// At a set that may still be wrong, each value on the side of its sign or zero.
    Truncated,
}

impl Path {
    /// Appends a row to the factor; false where the atom depends on the set.
    #[inline(always)]
    fn append(&mut self, problem: &Problem<'_>, j: usize, sign: f64, correlation: f64) -> bool {
        let n = self.count;
        self.atoms[n] = j;
        self.signs[n] = sign;
        self.values[n] = 0.0;
        self.correlations[n] = correlation;
        if !self.factorise(problem, n) {
            return false;
        }
        self.count = n + 1;
        true
    }

    /// Row `n` of the factor, from the rows before it.
    #[inline(always)]
    fn factorise(&mut self, problem: &Problem<'_>, n: usize) -> bool {
        let j = self.atoms[n];
        let diagonal = problem.squares[j];
        let mut pivot = diagonal;
        let mut row = [0.0; MAX_ACTIVE];
        for i in 0..n {
            let mut value = problem.product(self.atoms[i], j);
            for (above, x) in self.factor[i][..i].iter().zip(&row) {
                value -= above * x;
            }
            row[i] = value * self.inverse_diagonal[i];
            pivot -= row[i] * row[i];
        }
        if pivot.is_nan() || pivot <= DEPENDENT * diagonal {
            return false;
        }
        self.factor[n] = row;
        self.inverse_diagonal[n] = pivot.sqrt().recip();
        self.solve_forwards(problem, n);
        true
    }

    /// Entry `n` of `forward`, from those before it.
    #[inline(always)]
    fn solve_forwards(&mut self, problem: &Problem<'_>, n: usize) {
        let mut value = self.correlations[n] - problem.lambda * self.signs[n];
        for k in 0..n {
            value -= self.factor[n][k] * self.forward[k];
        }
        self.forward[n] = value * self.inverse_diagonal[n];
    }

    /// target ← F⁻ᵀ forward.
    #[inline(always)]
    fn solve_backwards(&mut self) {
        for i in (0..self.count).rev() {
            let mut value = self.forward[i];
            for k in i + 1..self.count {
                value -= self.factor[k][i] * self.target[k];
            }
            self.target[i] = value * self.inverse_diagonal[i];
        }
    }

    /// Takes the `k`-th atom out; false where rounding makes the others depend on each other.
    #[inline(always)]
    fn remove(&mut self, problem: &Problem<'_>, k: usize) -> bool {
        for i in k + 1..self.count {
            self.atoms[i - 1] = self.atoms[i];
            self.signs[i - 1] = self.signs[i];
            self.values[i - 1] = self.values[i];
            self.correlations[i - 1] = self.correlations[i];
        }
        self.count -= 1;
        (k..self.count).all(|n| self.factorise(problem, n))
    }

    /// Where on the way to the target the first value meets zero: its place in the set, and the share of the way.
    #[inline(always)]
    fn first_zero(&self) -> Option<(usize, f64)> {
        let mut first = None;
        for k in 0..self.count {
            let (from, to) = (self.values[k], self.target[k]);
            if to * self.signs[k] <= 0.0 {
                let share = if from == to { 0.0 } else { from / (from - to) }.clamp(0.0, 1.0);
                if first.is_none_or(|(_, least)| share < least) {
                    first = Some((k, share));
                }
            }
        }
        first
    }

    /// Goes over to exact correlations. Returns by how much that changed any d_jᵀDa with ‖d_j‖ ≤ 1, at most, as
    /// `ActiveSet::sharpen` does; infinity where a value left the side of its sign.
    #[inline(always)]
    fn sharpen(&mut self, problem: &Problem<'_>) -> f64 {
        let mut shift2 = 0.0;
        for k in 0..self.count {
            self.correlations[k] = dot(column(problem.atoms, self.atoms[k]), problem.signal);
            let rough = self.forward[k];
            self.solve_forwards(problem, k);
            shift2 += (self.forward[k] - rough) * (self.forward[k] - rough);
        }
        self.solve_backwards();
        for k in 0..self.count {
            if self.target[k] * self.signs[k] <= 0.0 {
                return f64::INFINITY;
            }
        }
        self.values = self.target;
        shift2.sqrt() * 1.0001
    }
}

/// Follows the path, in memory that it keeps.
#[derive(Clone, Debug, Default)]
pub(super) struct Homotopy {
    /// What the last path ended with.
    pub path: Path,
    /// The gradient at λ if the set stays as it is.
    gradient: Vec<Lanes>,
    /// The gradient at the level that the path has reached.
    gradient_at_level: Vec<Lanes>,
    /// Where on the rest of the path each |q_j| meets the level.
    crossings: Vec<Lanes>,
}

impl Homotopy {
    /// Makes room for a dictionary of `atoms` atoms.
    pub fn reset(&mut self, atoms: usize) {
        let rows = [
            &mut self.gradient,
            &mut self.gradient_at_level,
            &mut self.crossings,
        ];
        for row in rows {
            row.resize(pieces(atoms), Lanes::default());
        }
    }

    /// Follows the path of `problem` to λ. What it ends with is in `path`.
    #[inline(always)]
    pub fn follow(&mut self, problem: &Problem<'_>) -> Outcome {
        let Self {
            path,
            gradient,
            gradient_at_level: here,
            crossings,
        } = self;
        path.count = 0;
        let rough = problem.rough_correlation;
        let largest = largest_magnitude(rough);
        let mut level = f64::from(largest);
        if level + problem.error <= problem.lambda {
            return Outcome::Solved;
        }
        let mut next = place_of(rough, largest).map(|j| (j, f64::from(rough.as_flattened()[j])));
        for step in 0..MAX_STEPS {
            if let Some((j, gradient)) = next {
                let correlation = f64::from(rough.as_flattened()[j]);
                if path.count == MAX_ACTIVE || !path.append(problem, j, gradient.signum(), correlation) {
                    return Outcome::Truncated;
                }
            }
            path.solve_backwards();
            let count = path.count;
            let largest = residual_gradient(
                gradient,
                rough,
                problem.rough_gram,
                &path.atoms[..count],
                &path.target[..count],
            );
            let norm1: f64 = path.target[..count].iter().map(|a| a.abs()).sum();
            let error = problem.gradient_error(count, norm1);
            let zero = path.first_zero();
            let limit = problem.lambda + problem.tolerance + error;
            // The set's own are as large as λ, to within the error.
            if f64::from(largest) <= limit && zero.is_none() {
                let outside = gradient.as_flattened_mut();
                for &j in &path.atoms[..count] {
                    outside[j] = 0.0;
                }
                let largest = f64::from(largest_magnitude(gradient));
                let shift = path.sharpen(problem);
                if largest + error + shift <= problem.lambda + problem.tolerance {
                    return Outcome::Solved;
                }
                return Outcome::Truncated;
            }
            let from: &[_] = if step == 0 { rough } else { here };
            let bounds = [level, problem.lambda, limit].map(|x| x as f32);
            let mut share = first_crossing(crossings, from, gradient, bounds);
            next = None;
            if f64::from(share) < zero.map_or(1.5, |(_, leaves)| leaves) {
                next = place_of(crossings, share).map(|j| (j, f64::from(gradient.as_flattened()[j])));
            }
            let way = match (next, zero) {
                (Some(_), _) => f64::from(share),
                (None, Some((_, leaves))) => leaves,
                (None, None) => return Outcome::Truncated,
            };
            share = way as f32;
            for k in 0..count {
                path.values[k] += way * (path.target[k] - path.values[k]);
            }
            level += way * (problem.lambda - level);
            // The atoms of the set are held at the level, whatever rounding says.
            for (j, sign) in path.atoms[..count].iter().zip(&path.signs) {
                gradient.as_flattened_mut()[*j] = (problem.lambda * sign) as f32;
            }
            if step == 0 {
                here.copy_from_slice(rough);
            }
            move_towards(here, gradient, share);
            if next.is_none() {
                let Some((k, _)) = zero else {
                    return Outcome::Truncated;
                };
                if !path.remove(problem, k) || path.count == 0 {
                    return Outcome::Truncated;
                }
            }
        }
        Outcome::Truncated
    }
}
