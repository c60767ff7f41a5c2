//! The Lasso of one signal by an active set (feature-sign search; Lee, Battle, Raina, Ng 2006, Algorithm 1).
//!
//! Held throughout: an active set of atoms with a sign each, the Cholesky factor of its Gram matrix, and values that
//! minimise ½‖s − Da‖² + λ Σ sign_i a_i over the set or lie on the way there. A step adds the atoms that violate
//! optimality most, moves towards the new minimiser and stops where a value reaches zero, whose atom leaves. Every
//! pass lowers the objective strictly and a set with its signs has one minimiser, so no set comes twice and the
//! search ends at the exact solution. Rounding can break the argument where atoms depend on each other; a step limit
//! catches that, and the caller falls back to coordinate descent.

use super::cholesky::Factor;
use super::lasso::column;
use faer::MatRef;

/// Atoms added per look at the gradient: more saves looks, fewer saves atoms that must leave again.
const ADDED_AT_ONCE: usize = 3;

/// One Lasso: its data in terms of the dictionary.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    /// DᵀD, L × L, columns contiguous.
    pub gram: MatRef<'a, f64>,
    /// Dᵀs, L values.
    pub correlation: &'a [f64],
    pub lambda: f64,
    /// How far |d_jᵀ(s − Da)| may exceed λ.
    pub tolerance: f64,
}

impl<'a> Problem<'a> {
    pub fn gram_column(&self, j: usize) -> &'a [f64] {
        column(self.gram, j)
    }
}

/// The active set of the signal at hand; what it holds after one signal starts the next.
#[derive(Clone, Debug, Default)]
pub(super) struct ActiveSet {
    /// Atoms in the set, in the order of the factor's rows.
    pub atoms: Vec<usize>,
    /// Value of each atom in the set.
    pub values: Vec<f64>,
    signs: Vec<f64>,
    factor: Factor,
    member: Vec<bool>,
    gradient: Vec<f64>,
    target: Vec<f64>,
    column: Vec<f64>,
    added: Vec<usize>,
    /// Atoms given up on for this signal because they depend on the set and rounding hides a way to exchange them.
    refused: Vec<usize>,
}

impl ActiveSet {
    /// Empties the set, for a dictionary of `atoms` atoms.
    pub fn reset(&mut self, atoms: usize) {
        self.atoms.clear();
        self.values.clear();
        self.signs.clear();
        self.factor.clear();
        self.refused.clear();
        self.member.clear();
        self.member.resize(atoms, false);
        self.gradient.resize(atoms, 0.0);
    }

    /// Solves `problem` from the set at hand. False where the step limit was met first.
    pub fn solve(&mut self, problem: &Problem<'_>) -> bool {
        let limit = 100 + 8 * problem.correlation.len();
        self.refused.clear();
        self.restart(problem);
        for _ in 0..limit {
            self.update_gradient(problem);
            if !self.find_violations(problem) {
                let bound = problem.lambda + problem.tolerance;
                return self.refused.iter().all(|&j| self.gradient[j].abs() <= bound);
            }
            self.extend(problem);
            self.descend(problem);
        }
        false
    }

    /// Takes the set of another signal over: drops the atoms whose value has the wrong sign until none has.
    fn restart(&mut self, problem: &Problem<'_>) {
        loop {
            self.solve_target(problem);
            let before = self.atoms.len();
            for k in (0..before).rev() {
                if self.target[k] * self.signs[k] <= 0.0 {
                    self.drop_atom(k);
                }
            }
            if self.atoms.len() == before {
                self.values.copy_from_slice(&self.target);
                return;
            }
        }
    }

    /// target ← (G_AA)⁻¹ (c_A − λ sign).
    fn solve_target(&mut self, problem: &Problem<'_>) {
        self.target.clear();
        for (&j, sign) in self.atoms.iter().zip(&self.signs) {
            self.target.push(problem.correlation[j] - problem.lambda * sign);
        }
        self.factor.solve_lower(&mut self.target);
        self.factor.solve_upper(&mut self.target);
    }

    /// gradient ← c − G a.
    fn update_gradient(&mut self, problem: &Problem<'_>) {
        let gradient = &mut self.gradient[..];
        gradient.copy_from_slice(problem.correlation);
        let pairs = self.atoms.chunks_exact(4).zip(self.values.chunks_exact(4));
        for (atoms, values) in pairs {
            let [g0, g1, g2, g3] = [0, 1, 2, 3].map(|k| problem.gram_column(atoms[k]));
            let columns = g0.iter().zip(g1).zip(g2.iter().zip(g3));
            for (q, ((a, b), (c, d))) in gradient.iter_mut().zip(columns) {
                *q -= (values[0] * a + values[1] * b) + (values[2] * c + values[3] * d);
            }
        }
        let rest = self.atoms.len() / 4 * 4;
        for (&j, value) in self.atoms[rest..].iter().zip(&self.values[rest..]) {
            for (q, g) in gradient.iter_mut().zip(problem.gram_column(j)) {
                *q -= value * g;
            }
        }
    }

    /// Fills `added` with the atoms outside the set that violate |q_j| ≤ λ most, worst first.
    fn find_violations(&mut self, problem: &Problem<'_>) -> bool {
        let bound = problem.lambda + problem.tolerance;
        self.added.clear();
        for (j, q) in self.gradient.iter().enumerate() {
            let q = q.abs();
            if q <= bound || self.member[j] || self.refused.contains(&j) {
                continue;
            }
            let gradient = &self.gradient;
            let place = self.added.partition_point(|&i| gradient[i].abs() >= q);
            if place < ADDED_AT_ONCE {
                self.added.truncate(ADDED_AT_ONCE - 1);
                self.added.insert(place, j);
            }
        }
        !self.added.is_empty()
    }

    /// Puts the atoms of `added` into the set, with value zero and the sign of their gradient.
    fn extend(&mut self, problem: &Problem<'_>) {
        for n in 0..self.added.len() {
            let j = self.added[n];
            let sign = self.gradient[j].signum();
            if self.append(problem, j, 0.0, sign) {
                continue;
            }
            if n > 0 {
                // The atom depends on the set only since the ones before it came in: its time is the next look.
                continue;
            }
            if !self.exchange(problem, j, sign) {
                self.refused.push(j);
            }
        }
    }

    fn append(&mut self, problem: &Problem<'_>, j: usize, value: f64, sign: f64) -> bool {
        let gram = problem.gram_column(j);
        self.column.clear();
        self.column.extend(self.atoms.iter().map(|&i| gram[i]));
        if !self.factor.push(&mut self.column, gram[j]) {
            return false;
        }
        self.atoms.push(j);
        self.values.push(value);
        self.signs.push(sign);
        self.member[j] = true;
        true
    }

    /// Brings in atom `j` that is a combination of the set, d_j = D_A w: along (−w, 1) the residual does not change
    /// and the violation says that ‖a‖₁ falls, so move until a value of the set reaches zero and let `j` take its
    /// place. False where rounding leaves no such value. `column` still holds F⁻¹ G_Aj from the attempt to append.
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

    fn drop_atom(&mut self, k: usize) {
        self.factor.remove(k);
        self.member[self.atoms[k]] = false;
        self.atoms.remove(k);
        self.signs.remove(k);
        self.values.remove(k);
        if k < self.target.len() {
            self.target.remove(k);
        }
    }
}
