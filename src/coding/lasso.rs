//! The Lasso of every signal against one dictionary (method, step 6; Eq. 1).

use super::active_set::{ActiveSet, Problem};
use super::cholesky::dot;
use super::kkt::coordinate_descent;
use super::{CodingError, Dictionary};
use crate::cancel::Cancel;
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// Signals per product DᵀS: large enough for the product to run at full speed, small enough for it to stay in cache.
const BLOCK: usize = 512;
/// Signals between two looks at the cancel flag.
const CANCEL_EVERY: usize = 32;
/// Optimality is met to this share of λ (plus the rounding of the products): max_j |d_jᵀ(s − Da)| ≤ λ (1 + 1e-9).
const KKT_TOLERANCE: f64 = 1e-9;
/// Below this share of ‖s‖² the residual is computed in full, because its short form would lose digits.
const SMALL_RESIDUAL: f64 = 1e-4;

/// Sparse codes of N signals under one dictionary of L atoms, and what they cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Codes {
    /// N + 1 offsets into `atoms` and `values`: the code of signal i is `offsets[i]..offsets[i + 1]`.
    pub offsets: Vec<usize>,
    /// Atom of each non-zero, ascending within a signal.
    pub atoms: Vec<u32>,
    /// Value of each non-zero.
    pub values: Vec<f64>,
    /// N values ½‖s − Da‖² + λ‖a‖₁.
    pub objective: Vec<f64>,
    /// N values ‖s − Da‖².
    pub residual2: Vec<f64>,
}

/// What coding one signal cost, without the code itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CodeScore {
    /// ½‖s − Da‖² + λ‖a‖₁.
    pub objective: f64,
    /// ‖s − Da‖².
    pub residual2: f64,
    /// Non-zeros of a.
    pub nonzeros: usize,
}

/// Memory that coding reuses from call to call; the results do not depend on what it was used for before.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    correlations: Vec<f64>,
    set: ActiveSet,
    order: Vec<(usize, usize)>,
    code: Vec<f64>,
    gradient: Vec<f64>,
    residual: Vec<f64>,
    arena: Vec<(usize, f64)>,
    solved: Vec<(usize, usize, CodeScore)>,
}

/// Codes every column of `signals` (M × N): argmin_a ½‖s − D a‖² + λ‖a‖₁.
///
/// Exact up to rounding: an active set with a Cholesky factor ends at the optimality conditions, which hold to 1e-9 λ.
/// Signals are taken in an order in which those alike follow each other, each starting from the code before it; the
/// order depends on the signals alone. An atom that is zero or a copy of another is harmless. λ above max |Dᵀs| gives
/// an empty code.
///
/// # Errors
/// [`CodingError::DimensionMismatch`] where M differs, [`CodingError::BadParameter`] where λ is not positive and
/// finite, [`CodingError::NotFinite`] for NaN or infinity in the signals, [`CodingError::Cancelled`], and
/// [`CodingError::NotConverged`] where neither the active set nor coordinate descent reached the conditions.
pub fn encode(
    dictionary: &Dictionary,
    signals: MatRef<'_, f64>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Codes, CodingError> {
    encode_with(&mut Workspace::default(), dictionary, signals, lambda, cancel)
}

/// As [`encode`], in memory of the caller's.
pub fn encode_with(
    workspace: &mut Workspace,
    dictionary: &Dictionary,
    signals: MatRef<'_, f64>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Codes, CodingError> {
    let n = signals.ncols();
    let mut codes = Codes {
        offsets: Vec::with_capacity(n + 1),
        objective: Vec::with_capacity(n),
        residual2: Vec::with_capacity(n),
        ..Codes::default()
    };
    codes.offsets.push(0);
    run(workspace, dictionary, signals, lambda, cancel, |code, score| {
        for &(atom, value) in code {
            // L atoms of M values each are in memory, so their number fits 32 bits on any machine of today.
            codes.atoms.push(atom as u32);
            codes.values.push(value);
        }
        codes.offsets.push(codes.atoms.len());
        codes.objective.push(score.objective);
        codes.residual2.push(score.residual2);
    })?;
    Ok(codes)
}

/// As [`encode_with`], but keeps only what each signal cost: N scores in the order of the signals.
pub fn score_with(
    workspace: &mut Workspace,
    dictionary: &Dictionary,
    signals: MatRef<'_, f64>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Vec<CodeScore>, CodingError> {
    let mut scores = Vec::with_capacity(signals.ncols());
    run(workspace, dictionary, signals, lambda, cancel, |_, score| {
        scores.push(score)
    })?;
    Ok(scores)
}

pub(super) fn check_lambda(lambda: f64) -> Result<(), CodingError> {
    if lambda > 0.0 && lambda.is_finite() {
        return Ok(());
    }
    Err(CodingError::BadParameter {
        name: "lambda",
        expected: "positive and finite",
        found: format!("{lambda}"),
    })
}

/// Column `j` of a column-major matrix.
pub(super) fn column(matrix: MatRef<'_, f64>, j: usize) -> &[f64] {
    // Callers make sure of the layout; an empty slice would be met by the checks of dimensions in front.
    matrix
        .col(j)
        .try_as_col_major()
        .map_or(&[], |column| column.as_slice())
}

/// Runs `work` on the same values with adjacent columns; copies them only where they are not.
pub(super) fn with_column_major<T>(signals: MatRef<'_, f64>, work: impl FnOnce(MatRef<'_, f64>) -> T) -> T {
    if signals.row_stride() == 1 {
        work(signals)
    } else {
        work(signals.to_owned().as_ref())
    }
}

fn run(
    workspace: &mut Workspace,
    dictionary: &Dictionary,
    signals: MatRef<'_, f64>,
    lambda: f64,
    cancel: &Cancel,
    mut sink: impl FnMut(&[(usize, f64)], CodeScore),
) -> Result<(), CodingError> {
    check_lambda(lambda)?;
    if signals.nrows() != dictionary.dimension() {
        return Err(CodingError::DimensionMismatch {
            signature: signals.nrows(),
            atoms: dictionary.dimension(),
        });
    }
    with_column_major(signals, |signals| {
        workspace.set.reset(dictionary.len());
        for first in (0..signals.ncols()).step_by(BLOCK) {
            let width = BLOCK.min(signals.ncols() - first);
            let block = signals.subcols(first, width);
            workspace.code_block(dictionary, block, first, lambda, cancel)?;
            for &(start, end, score) in &workspace.solved {
                sink(&workspace.arena[start..end], score);
            }
        }
        Ok(())
    })
}

impl Workspace {
    /// Codes up to [`BLOCK`] signals into `arena` and `solved`; `first` is the number of the block's first signal.
    fn code_block(
        &mut self,
        dictionary: &Dictionary,
        signals: MatRef<'_, f64>,
        first: usize,
        lambda: f64,
        cancel: &Cancel,
    ) -> Result<(), CodingError> {
        cancel.check()?;
        let (atoms, width) = (dictionary.len(), signals.ncols());
        let mut correlations = std::mem::take(&mut self.correlations);
        correlations.resize(atoms * width, 0.0);
        let product = MatMut::from_column_major_slice_mut(&mut correlations, atoms, width);
        matmul(
            product,
            Accum::Replace,
            dictionary.atoms().transpose(),
            signals,
            1.0,
            Par::Seq,
        );

        // Signals alike share the atom they correlate with most.
        self.order.clear();
        for i in 0..width {
            self.order.push((largest(&correlations[i * atoms..][..atoms]), i));
        }
        self.order.sort_unstable();

        self.arena.clear();
        self.solved.clear();
        self.solved.resize(width, (0, 0, CodeScore::default()));
        for n in 0..width {
            if n % CANCEL_EVERY == 0 {
                cancel.check()?;
            }
            let i = self.order[n].1;
            let signal = column(signals, i);
            let correlation = &correlations[i * atoms..][..atoms];
            let start = self.arena.len();
            let score = self.code_signal(dictionary, signal, correlation, first + i, lambda)?;
            self.solved[i] = (start, self.arena.len(), score);
        }
        self.correlations = correlations;
        Ok(())
    }

    /// Codes one signal, appends its code to `arena`.
    fn code_signal(
        &mut self,
        dictionary: &Dictionary,
        signal: &[f64],
        correlation: &[f64],
        number: usize,
        lambda: f64,
    ) -> Result<CodeScore, CodingError> {
        let norm2 = dot(signal, signal);
        if !norm2.is_finite() {
            return Err(CodingError::NotFinite { what: "signature" });
        }
        let problem = Problem {
            gram: dictionary.gram().as_ref(),
            correlation,
            lambda,
            tolerance: KKT_TOLERANCE * lambda + 1e-14 * norm2.sqrt(),
        };
        let start = self.arena.len();
        if self.set.solve(&problem) {
            let pairs = self.set.atoms.iter().zip(&self.set.values);
            self.arena.extend(pairs.map(|(&j, &a)| (j, a)));
        } else {
            self.fall_back(&problem, number)?;
        }
        let code = &mut self.arena[start..];
        code.sort_unstable_by_key(|&(j, _)| j);
        let (mut norm1, mut product) = (0.0, 0.0);
        for &(j, a) in code.iter() {
            norm1 += a.abs();
            product += correlation[j] * a;
        }
        // At the optimum aᵀGa = cᵀa − λ‖a‖₁.
        let mut residual2 = norm2 - product - lambda * norm1;
        if residual2 < SMALL_RESIDUAL * norm2 {
            self.residual.clear();
            self.residual.extend_from_slice(signal);
            for &(j, a) in code.iter() {
                for (r, d) in self
                    .residual
                    .iter_mut()
                    .zip(column(dictionary.atoms().as_ref(), j))
                {
                    *r -= a * d;
                }
            }
            residual2 = dot(&self.residual, &self.residual);
        }
        let score = CodeScore {
            objective: 0.5 * residual2 + lambda * norm1,
            residual2,
            nonzeros: code.len(),
        };
        if !score.objective.is_finite() {
            return Err(CodingError::NotConverged {
                signal: number,
                violation: f64::INFINITY,
            });
        }
        Ok(score)
    }

    /// Where the active set from the neighbour's code failed: once more from nothing, then coordinate descent.
    fn fall_back(&mut self, problem: &Problem<'_>, number: usize) -> Result<(), CodingError> {
        self.set.reset(problem.correlation.len());
        let solved = self.set.solve(problem);
        if !solved {
            self.code.clear();
            self.code.resize(problem.correlation.len(), 0.0);
            for (&j, &a) in self.set.atoms.iter().zip(&self.set.values) {
                self.code[j] = a;
            }
            let violation = coordinate_descent(problem, &mut self.code, &mut self.gradient);
            let accepted = violation <= 1e3 * problem.tolerance;
            if !accepted {
                return Err(CodingError::NotConverged {
                    signal: number,
                    violation,
                });
            }
            let code = self.code.iter().enumerate().filter(|(_, a)| **a != 0.0);
            self.arena.extend(code.map(|(j, &a)| (j, a)));
            self.set.reset(problem.correlation.len());
            return Ok(());
        }
        let pairs = self.set.atoms.iter().zip(&self.set.values);
        self.arena.extend(pairs.map(|(&j, &a)| (j, a)));
        Ok(())
    }
}

/// Where the largest magnitude is; the first of equals.
fn largest(values: &[f64]) -> usize {
    let mut best = (0, -1.0);
    for (j, value) in values.iter().enumerate() {
        if value.abs() > best.1 {
            best = (j, value.abs());
        }
    }
    best.0
}
