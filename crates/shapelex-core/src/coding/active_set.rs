//! The Lasso of one signal by an active set (feature-sign search; Lee, Battle, Raina, Ng 2006, Algorithm 1).
//!
//! Held throughout: an active set of atoms with a sign each, the Cholesky factor of its Gram matrix, and values that
//! minimise ½‖s − Da‖² + λ Σ sign_i a_i over the set or lie on the way there. A step adds the atoms that violate
//! optimality most, moves towards the new minimiser and stops where a value reaches zero, whose atom leaves. Every
//! pass lowers the objective strictly and a set with its signs has one minimiser, so no set comes twice and the
//! search ends at the exact solution. Rounding can break the argument where atoms depend on each other; a step limit
//! catches that, and the caller falls back to coordinate descent.

use super::cholesky::Factor;
use super::dot::dot;
use super::homotopy::{Homotopy, Outcome};
use super::problem::{Problem, column};
use super::rows::{Lanes, pieces};
use super::scan::{largest_magnitude, place_of, residual_gradient, step_along};

/// Atoms added per look at the gradient: more saves looks, fewer saves atoms that must leave again.
const ADDED_AT_ONCE: usize = 4;

/// The active set of the signal at hand.
#[derive(Clone, Debug, Default)]
pub(super) struct ActiveSet {
    /// Atoms in the set, in the order of the factor's rows.
    pub atoms: Vec<usize>,
    /// Value of each atom in the set.
    pub values: Vec<f64>,
    signs: Vec<f64>,
    factor: Factor,
    /// The search starts with what the homotopy ends with.
    pub homotopy: Homotopy,
    /// The gradient at the code last looked at.
    gradient: Vec<Lanes>,
    /// Whether correlations are taken at full precision; the search begins with the rough ones.
    exact: bool,
    /// max |q_j| over the atoms outside the set, at the last look.
    largest: f64,
    /// d_jᵀs of the atoms met so far, valid where `known` holds the number of the signal.
    correlation: Vec<f64>,
    known: Vec<u64>,
    signal: u64,
    target: Vec<f64>,
    /// F⁻¹ (c_A − λ sign), row by row valid as far as it reaches.
    forward: Vec<f64>,
    column: Vec<f64>,
    /// Atoms to add, and the value each would take alone.
    added: Vec<(usize, f64)>,
    /// Atoms whose rough gradient does not tell.
    doubtful: Vec<usize>,
    /// Atoms given up on for this signal because they depend on the set and rounding hides a way to exchange them.
    refused: Vec<usize>,
}

impl ActiveSet {
    /// Empties the set, for a dictionary of `atoms` atoms.
    pub fn reset(&mut self, atoms: usize) {
        self.empty();
        self.refused.clear();
        self.homotopy.reset(atoms);
        self.gradient.resize(pieces(atoms), Lanes::default());
        self.correlation.resize(atoms, 0.0);
        self.known.resize(atoms, 0);
    }

    /// Takes all atoms out.
    #[inline(always)]
    fn empty(&mut self) {
        self.atoms.clear();
        self.values.clear();
        self.signs.clear();
        self.factor.clear();
        self.forward.clear();
    }

    /// Solves `problem` from nothing. True where the homotopy's path has the solution; otherwise the set is one to go on
    /// from.
    #[inline(always)]
    pub fn solve_by_homotopy(&mut self, problem: &Problem<'_>) -> bool {
        if self.homotopy.follow(problem) == Outcome::Solved {
            return true;
        }
        self.empty();
        for k in 0..self.homotopy.path.count {
            let path = &self.homotopy.path;
            let (j, value, sign) = (path.atoms[k], path.values[k], path.signs[k]);
            if !self.append(problem, j, value, sign) {
                break;
            }
        }
        false
    }

    /// Solves `problem` from the set at hand. False where the step limit was met first.
    #[inline(always)]
    pub fn solve(&mut self, problem: &Problem<'_>) -> bool {
        let limit = 100 + 8 * problem.atoms.ncols();
        self.refused.clear();
        self.signal += 1;
        self.forward.clear();
        self.exact = false;
        self.descend(problem);
        for _ in 0..limit {
            self.update_gradient(problem);
            let norm1 = self.values.iter().map(|a| a.abs()).sum();
            let error = problem.gradient_error(self.atoms.len(), norm1);
            if !self.find_violations(problem, error) {
                if !self.exact {
                    let shift = self.sharpen(problem);
                    if self.largest + error + shift <= problem.lambda + problem.tolerance {
                        return self.refused_are_optimal(problem);
                    }
                    continue;
                }
                if !self.settle_doubts(problem, error) {
                    return self.refused_are_optimal(problem);
                }
            }
            self.extend(problem);
            self.descend(problem);
        }
        false
    }

    /// Goes over to exact correlations. Returns by how much that changed any d_jᵀDa with ‖d_j‖ ≤ 1, at most: the
    /// length of the change of F⁻¹(c_A − λ sign), as ‖D_A x‖ = ‖Fᵀx‖; infinity where the set changed.
    #[inline(always)]
    fn sharpen(&mut self, problem: &Problem<'_>) -> f64 {
        self.exact = true;
        let rough = std::mem::take(&mut self.forward);
        self.solve_target(problem);
        let shift2: f64 = rough
            .iter()
            .zip(&self.forward)
            .map(|(x, y)| (x - y) * (x - y))
            .sum();
        let kept = self
            .target
            .iter()
            .zip(&self.signs)
            .all(|(x, sign)| x * sign > 0.0);
        if kept {
            self.values.copy_from_slice(&self.target);
            return shift2.sqrt() * 1.0001;
        }
        self.descend(problem);
        f64::INFINITY
    }

    #[inline(always)]
    fn refused_are_optimal(&mut self, problem: &Problem<'_>) -> bool {
        let bound = problem.lambda + problem.tolerance;
        let refused = std::mem::take(&mut self.refused);
        refused
            .iter()
            .all(|&j| self.exact_gradient(problem, j).abs() <= bound)
    }

    /// d_jᵀs.
    #[inline(always)]
    pub fn correlation(&mut self, problem: &Problem<'_>, j: usize) -> f64 {
        if !self.exact {
            return f64::from(problem.rough_correlation.as_flattened()[j]);
        }
        if self.known[j] != self.signal {
            self.known[j] = self.signal;
            self.correlation[j] = dot(column(problem.atoms, j), problem.signal);
        }
        self.correlation[j]
    }

    #[inline(always)]
    fn exact_gradient(&mut self, problem: &Problem<'_>, j: usize) -> f64 {
        let mut gradient = self.correlation(problem, j);
        for (&i, value) in self.atoms.iter().zip(&self.values) {
            gradient -= problem.product(i, j) * value;
        }
        gradient
    }

    /// target ← (G_AA)⁻¹ (c_A − λ sign). Only the rows of the factor that are new are solved forwards again.
    #[inline(always)]
    fn solve_target(&mut self, problem: &Problem<'_>) {
        for k in self.forward.len()..self.atoms.len() {
            let correlation = self.correlation(problem, self.atoms[k]);
            let value = correlation - problem.lambda * self.signs[k];
            let value = self.factor.solve_row(k, &self.forward, value);
            self.forward.push(value);
        }
        self.target.clone_from(&self.forward);
        self.factor.solve_upper(&mut self.target);
    }

    /// gradient ← c − G a, at single precision.
    #[inline(always)]
    fn update_gradient(&mut self, problem: &Problem<'_>) {
        residual_gradient(
            &mut self.gradient,
            problem.rough_correlation,
            problem.rough_gram,
            &self.atoms,
            &self.values,
        );
    }

    /// Fills `added` with atoms outside the set that surely violate |q_j| ≤ λ: the worst, then the worst after the
    /// gradient's change by a step of coordinate descent along the first, and so on. Atoms much like the first are
    /// no longer among them then.
    #[inline(always)]
    fn find_violations(&mut self, problem: &Problem<'_>, error: f64) -> bool {
        let surely = problem.lambda + problem.tolerance + error;
        self.added.clear();
        for &j in self.atoms.iter().chain(&self.refused) {
            // Not a number compares as no violation, whatever is added to it.
            self.gradient.as_flattened_mut()[j] = f32::NAN;
        }
        let mut largest = largest_magnitude(&self.gradient);
        self.largest = f64::from(largest);
        while f64::from(largest) > surely && self.added.len() < ADDED_AT_ONCE {
            let Some(j) = place_of(&self.gradient, largest) else {
                break;
            };
            let gradient = f64::from(self.gradient.as_flattened()[j]);
            let rough = problem.rough_gram.row(j);
            let step = (gradient - problem.lambda * gradient.signum()) / f64::from(rough.as_flattened()[j]);
            self.added.push((j, step));
            self.gradient.as_flattened_mut()[j] = f32::NAN;
            if self.added.len() < ADDED_AT_ONCE {
                largest = step_along(&mut self.gradient, rough, step as f32);
            }
        }
        !self.added.is_empty()
    }

    /// Fills `added` with atoms whose rough gradient does not tell and whose exact one violates.
    #[inline(always)]
    fn settle_doubts(&mut self, problem: &Problem<'_>, error: f64) -> bool {
        let bound = problem.lambda + problem.tolerance;
        let perhaps = (bound - error) as f32;
        if self.largest <= f64::from(perhaps) {
            return false;
        }
        self.doubtful.clear();
        let count = problem.atoms.ncols();
        for (j, q) in self.gradient.as_flattened()[..count].iter().enumerate() {
            if q.abs() > perhaps {
                self.doubtful.push(j);
            }
        }
        let mut worst = bound;
        for n in 0..self.doubtful.len() {
            let j = self.doubtful[n];
            let gradient = self.exact_gradient(problem, j);
            if gradient.abs() > worst {
                worst = gradient.abs();
                let step = (gradient - problem.lambda * gradient.signum()) / problem.squares[j];
                self.added.clear();
                self.added.push((j, step));
            }
        }
        !self.added.is_empty()
    }

    /// Puts the atoms of `added` into the set, each with its value.
    #[inline(always)]
    fn extend(&mut self, problem: &Problem<'_>) {
        for n in 0..self.added.len() {
            let (j, value) = self.added[n];
            let sign = value.signum();
            if self.append(problem, j, value, sign) {
                continue;
            }
            // The steps after this one assume that it was taken.
            if n == 0 && !self.exchange(problem, j, sign) {
                self.refused.push(j);
            }
            break;
        }
    }

    #[inline(always)]
    fn append(&mut self, problem: &Problem<'_>, j: usize, value: f64, sign: f64) -> bool {
        self.column.clear();
        if let Some(gram) = problem.gram {
            let products = column(gram, j);
            self.column.extend(self.atoms.iter().map(|&i| products[i]));
        } else {
            for &i in &self.atoms {
                self.column.push(problem.product(i, j));
            }
        }
        if !self.factor.push(&mut self.column, problem.squares[j]) {
            return false;
        }
        self.atoms.push(j);
        self.values.push(value);
        self.signs.push(sign);
        true
    }

    /// Brings in atom `j` that is a combination of the set, d_j = D_A w: along (−w, 1) the residual does not change
    /// and the violation says that ‖a‖₁ falls, so move until a value of the set reaches zero and let `j` take its
    /// place. False where rounding leaves no such value. `column` still holds F⁻¹ G_Aj from the attempt to append.
    #[inline(always)]
    fn exchange(&mut self, problem: &Problem<'_>, j: usize, sign: f64) -> bool {
        self.factor.solve_upper(&mut self.column);
        let mut step = f64::INFINITY;
        let mut leaving = None;
        for (k, (value, w)) in self.values.iter().zip(&self.column).enumerate() {
            let rate = -w * sign;
            if rate * value < 0.0 && -value / rate < step {
                step = -value / rate;
                leaving = Some(k);
            }
        }
        let Some(k) = leaving else { return false };
        for (value, w) in self.values.iter_mut().zip(&self.column) {
            *value -= step * sign * w;
        }
        self.drop_atom(k);
        self.append(problem, j, step * sign, sign)
    }

    /// Moves the values to the minimiser over the set; whoever would change sign on the way leaves at zero.
    #[inline(always)]
    fn descend(&mut self, problem: &Problem<'_>) {
        loop {
            self.solve_target(problem);
            let mut step = 1.0;
            let mut leaving = None;
            for k in 0..self.atoms.len() {
                if self.target[k] * self.signs[k] <= 0.0 {
                    let (from, to) = (self.values[k], self.target[k]);
                    // An atom that came in at zero and would go the wrong way leaves at once.
                    let crossing = if from == to { 0.0 } else { from / (from - to) };
                    if crossing < step || leaving.is_none() {
                        step = crossing.clamp(0.0, 1.0);
                        leaving = Some(k);
                    }
                }
            }
            let Some(k) = leaving else {
                self.values.copy_from_slice(&self.target);
                return;
            };
            for (value, target) in self.values.iter_mut().zip(&self.target) {
                *value += step * (target - *value);
            }
            self.drop_atom(k);
        }
    }

    #[inline(always)]
    fn drop_atom(&mut self, k: usize) {
        self.factor.remove(k);
        self.forward.truncate(k);
        self.atoms.remove(k);
        self.signs.remove(k);
        self.values.remove(k);
        if k < self.target.len() {
            self.target.remove(k);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coding::prepared::Prepared;
    use faer::Mat;

    #[test]
    fn an_atom_that_depends_on_the_set_takes_the_place_of_another() {
        // d_3 = 0.6 (d_1 + d_2) reaches the signal (1, 1) at a lower ‖a‖₁ than the first two together.
        let identity = |i, j| if i == j { 1.0 } else { 0.0 };
        let atoms = Mat::from_fn(2, 3, |i, j| if j == 2 { 0.6 } else { identity(i, j) });
        let dictionary = Prepared::new(atoms).unwrap();
        let mut rough = [Lanes::default()];
        rough[0][..3].copy_from_slice(&[1.0, 1.0, 1.2]);
        let problem = Problem {
            atoms: dictionary.atoms().as_ref(),
            squares: dictionary.squares(),
            gram: dictionary.known_gram(),
            rough_gram: &dictionary.screen().gram,
            rough_gram_error: 0.0,
            signal: &[1.0, 1.0],
            norm: 2f64.sqrt(),
            rough_correlation: &rough,
            error: 1e-6,
            lambda: 0.05,
            tolerance: 1e-11,
        };
        let mut set = ActiveSet::default();
        set.reset(3);
        assert!(set.append(&problem, 0, 0.5, 1.0) && set.append(&problem, 1, 0.5, 1.0));
        assert!(set.solve(&problem));
        assert_eq!(set.atoms, [2]);
    }
}
