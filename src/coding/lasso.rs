//! The Lasso of every signal against one dictionary (method, step 6; Eq. 1).

use super::active_set::{ActiveSet, Problem};
use super::cholesky::dot;
use super::dispatch::{Kernel, fastest};
use super::kkt::coordinate_descent;
use super::path::REACH;
use super::scan::pieces;
use super::screen::ScreenMemory;
use super::{CodingError, Dictionary, Signals};
use crate::cancel::Cancel;
use faer::MatRef;
use std::ops::Range;

/// Signals per product DᵀS: large enough for the product to run at full speed, small enough for it to stay in cache.
const BLOCK: usize = 256;
/// Signals between two looks at the cancel flag.
const CANCEL_EVERY: usize = 32;
/// Optimality is met to this share of λ (plus the rounding of the products): max_j |d_jᵀ(s − Da)| ≤ λ (1 + 1e-9).
const KKT_TOLERANCE: f64 = 1e-9;
/// Coordinate descent, which comes last, may leave this many times as much.
const FALL_BACK: f64 = 1e3;
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
    screen: ScreenMemory,
    set: ActiveSet,
    code: Vec<f64>,
    residual: Vec<f64>,
    /// Codes of all signals, one after the other.
    arena: Vec<(u32, f64)>,
    /// Where each signal's code ends in `arena`, and what it cost.
    solved: Vec<(usize, CodeScore)>,
}

/// Codes every column of `signals` (M × N): argmin_a ½‖s − D a‖² + λ‖a‖₁.
///
/// Exact up to rounding: an active set with a Cholesky factor ends at the optimality conditions, which hold to 1e-9 λ.
/// Each signal starts from nothing along the Lasso path and, where its code has many non-zeros, goes on from there at λ,
/// so a code does not depend on the other signals. An atom that is zero or a copy of another is harmless. λ above max |Dᵀs| gives
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
    encode_signals(workspace, dictionary, &Signals::new(signals)?, lambda, cancel)
}

/// As [`encode_with`], for signals made ready once and coded under many dictionaries.
pub fn encode_signals(
    workspace: &mut Workspace,
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Codes, CodingError> {
    workspace.run(dictionary, signals, lambda, cancel)?;
    let n = signals.len();
    let mut codes = Codes {
        offsets: Vec::with_capacity(n + 1),
        atoms: Vec::with_capacity(workspace.arena.len()),
        values: Vec::with_capacity(workspace.arena.len()),
        objective: Vec::with_capacity(n),
        residual2: Vec::with_capacity(n),
    };
    codes.offsets.push(0);
    for &(atom, value) in &workspace.arena {
        codes.atoms.push(atom);
        codes.values.push(value);
    }
    for &(end, score) in &workspace.solved {
        codes.offsets.push(end);
        codes.objective.push(score.objective);
        codes.residual2.push(score.residual2);
    }
    Ok(codes)
}

/// As [`encode_signals`], but keeps only what each signal cost: N scores in the caller's order of the signals.
pub fn score_signals(
    workspace: &mut Workspace,
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<Vec<CodeScore>, CodingError> {
    workspace.run(dictionary, signals, lambda, cancel)?;
    Ok(workspace.solved.iter().map(|&(_, score)| score).collect())
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
#[inline(always)]
pub(super) fn column<T>(matrix: MatRef<'_, T>, j: usize) -> &[T] {
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

struct CodeBlock<'a> {
    workspace: &'a mut Workspace,
    dictionary: &'a Dictionary,
    signals: &'a Signals<'a>,
    block: Range<usize>,
    lambda: f64,
    cancel: &'a Cancel,
}

impl Kernel for CodeBlock<'_> {
    type Output = Result<(), CodingError>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self {
            workspace,
            dictionary,
            signals,
            block,
            lambda,
            cancel,
        } = self;
        workspace.code_block(dictionary, signals, block, lambda, cancel)
    }
}

impl Workspace {
    /// Codes all signals into `arena` and `solved`.
    fn run(
        &mut self,
        dictionary: &Dictionary,
        signals: &Signals<'_>,
        lambda: f64,
        cancel: &Cancel,
    ) -> Result<(), CodingError> {
        check_lambda(lambda)?;
        if signals.dimension() != dictionary.dimension() {
            return Err(CodingError::DimensionMismatch {
                signature: signals.dimension(),
                atoms: dictionary.dimension(),
            });
        }
        self.set.reset(dictionary.len());
        self.arena.clear();
        self.solved.clear();
        for first in (0..signals.len()).step_by(BLOCK) {
            cancel.check()?;
            let block = first..signals.len().min(first + BLOCK);
            dictionary
                .screen()
                .correlate(signals, block.clone(), &mut self.screen);
            fastest(CodeBlock {
                workspace: self,
                dictionary,
                signals,
                block,
                lambda,
                cancel,
            })?;
        }
        Ok(())
    }

    /// Codes the signals `block`, whose correlations are in `screen`.
    #[inline(always)]
    fn code_block(
        &mut self,
        dictionary: &Dictionary,
        signals: &Signals<'_>,
        block: Range<usize>,
        lambda: f64,
        cancel: &Cancel,
    ) -> Result<(), CodingError> {
        let width = pieces(dictionary.len());
        let first = block.start;
        for i in block {
            if i % CANCEL_EVERY == 0 {
                cancel.check()?;
            }
            let norm2 = signals.norms2[i];
            let rough = std::mem::take(&mut self.screen.correlations);
            let mut problem = Problem {
                atoms: dictionary.atoms().as_ref(),
                gram: dictionary.known_gram(),
                rough_gram: &dictionary.screen().gram,
                rough_gram_error: dictionary.screen().gram_error,
                signal: signals.signal(i),
                norm: norm2.sqrt(),
                rough_correlation: &rough[(i - first) * width..][..width],
                error: self.screen.errors[i - first],
                lambda,
                tolerance: KKT_TOLERANCE * lambda + 1e-14 * norm2.sqrt(),
            };
            let start = self.arena.len();
            if self.set.solve_by_path(&problem) {
                let score = self.path_score(&problem, norm2, i)?;
                self.solved.push((self.arena.len(), score));
                self.screen.correlations = rough;
                continue;
            }
            if self.set.path.count == REACH {
                // Codes of many non-zeros take nearly all products of atoms.
                problem.gram = Some(dictionary.gram().as_ref());
            }
            if self.set.solve(&problem) {
                let pairs = self.set.atoms.iter().zip(&self.set.values);
                // L atoms of M values each are in memory, so their i fits 32 bits.
                self.arena.extend(pairs.map(|(&j, &a)| (j as u32, a)));
            } else {
                self.fall_back(&problem, dictionary, i)?;
            }
            let score = self.score(&problem, norm2, start, i)?;
            self.solved.push((self.arena.len(), score));
            self.screen.correlations = rough;
        }
        Ok(())
    }

    /// Takes the code over that the path has ended with and says what it costs.
    #[inline(always)]
    fn path_score(
        &mut self,
        problem: &Problem<'_>,
        norm2: f64,
        number: usize,
    ) -> Result<CodeScore, CodingError> {
        let path = &self.set.path;
        let start = self.arena.len();
        let (mut norm1, mut product) = (0.0, 0.0);
        for k in 0..path.count {
            norm1 += path.values[k].abs();
            product += path.correlations[k] * path.values[k];
            self.arena.push((path.atoms[k] as u32, path.values[k]));
        }
        if path.count > 1 {
            self.arena[start..].sort_unstable_by_key(|&(j, _)| j);
        }
        self.cost(problem, norm2, start, number, norm1, product)
    }

    /// Sorts the code that starts at `start` and says what it costs.
    #[inline(always)]
    fn score(
        &mut self,
        problem: &Problem<'_>,
        norm2: f64,
        start: usize,
        number: usize,
    ) -> Result<CodeScore, CodingError> {
        let code = &mut self.arena[start..];
        code.sort_unstable_by_key(|&(j, _)| j);
        let (mut norm1, mut product) = (0.0, 0.0);
        for &(j, a) in code.iter() {
            norm1 += a.abs();
            product += self.set.correlation(problem, j as usize) * a;
        }
        self.cost(problem, norm2, start, number, norm1, product)
    }

    #[inline(always)]
    fn cost(
        &mut self,
        problem: &Problem<'_>,
        norm2: f64,
        start: usize,
        number: usize,
        norm1: f64,
        product: f64,
    ) -> Result<CodeScore, CodingError> {
        let code = &self.arena[start..];
        // At the optimum aᵀGa = cᵀa − λ‖a‖₁.
        let mut residual2 = norm2 - product - problem.lambda * norm1;
        if residual2 < SMALL_RESIDUAL * norm2 {
            self.residual.clear();
            self.residual.extend_from_slice(problem.signal);
            for &(j, a) in code.iter() {
                for (r, d) in self.residual.iter_mut().zip(column(problem.atoms, j as usize)) {
                    *r -= a * d;
                }
            }
            residual2 = dot(&self.residual, &self.residual);
        }
        let score = CodeScore {
            objective: 0.5 * residual2 + problem.lambda * norm1,
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
    #[cold]
    #[inline(never)]
    fn fall_back(
        &mut self,
        problem: &Problem<'_>,
        dictionary: &Dictionary,
        number: usize,
    ) -> Result<(), CodingError> {
        let count = dictionary.len();
        self.set.reset(count);
        if self.set.solve(problem) {
            let pairs = self.set.atoms.iter().zip(&self.set.values);
            self.arena.extend(pairs.map(|(&j, &a)| (j as u32, a)));
            return Ok(());
        }
        self.code.clear();
        self.code.resize(count, 0.0);
        for (&j, &a) in self.set.atoms.iter().zip(&self.set.values) {
            self.code[j] = a;
        }
        let violation = coordinate_descent(problem, dictionary.gram().as_ref(), &mut self.code);
        if violation > FALL_BACK * problem.tolerance {
            return Err(CodingError::NotConverged {
                signal: number,
                violation,
            });
        }
        let code = self.code.iter().enumerate().filter(|(_, a)| **a != 0.0);
        self.arena.extend(code.map(|(j, &a)| (j as u32, a)));
        self.set.reset(count);
        Ok(())
    }
}
