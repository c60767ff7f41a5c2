//! Codes of many signals one after the other, in memory that each thread keeps.

use super::active_set::ActiveSet;
use super::coordinate_descent::coordinate_descent;
use super::dispatch::{Kernel, fastest};
use super::dot::dot;
use super::prepared::Prepared;
use super::problem::{Problem, column};
use super::rows::pieces;
use super::screen::ScreenMemory;
use super::{CodeScore, Codes, CodingError, Signals};
use crate::cancel::Cancel;
use std::cell::RefCell;
use std::ops::Range;

/// Signals per product DᵀS: large enough for the product to run at full speed, small enough for it to stay in cache.
const BLOCK: usize = 256;
/// All products of atoms are computed at once when a 64th of their number have been computed one by one.
const SHARE: usize = 64;
/// Signals between two looks at the cancel flag.
const CANCEL_EVERY: usize = 32;
/// Optimality is met to this share of λ (plus the rounding of the products): max_j |d_jᵀ(s − Da)| ≤ λ (1 + 1e-9).
const KKT_TOLERANCE: f64 = 1e-9;
/// Coordinate descent, which comes last, may leave this many times as much.
const FALL_BACK: f64 = 1e3;
/// Below this share of ‖s‖² the residual is computed in full, because its short form would lose digits.
const SMALL_RESIDUAL: f64 = 1e-4;

/// Non-zeros whose memory a thread keeps (4 MB).
const KEPT: usize = 1 << 18;

thread_local! {
    static ENCODER: RefCell<Encoder> = RefCell::default();
}

/// Sums over a code: ‖a‖₁ and cᵀa, c the correlations of the atoms with the signal.
#[derive(Clone, Copy)]
struct Sums {
    norm1: f64,
    product: f64,
}

/// Memory that coding reuses from call to call; the results do not depend on what it was used for before.
#[derive(Clone, Debug, Default)]
pub(super) struct Encoder {
    screen: ScreenMemory,
    set: ActiveSet,
    code: Vec<f64>,
    residual: Vec<f64>,
    /// Codes of all signals, one after the other.
    arena: Vec<(u32, f64)>,
    /// Where each signal's code ends in `arena`, and what it cost.
    solved: Vec<(usize, CodeScore)>,
    /// Products of two atoms that the codes of the run took, about.
    products: usize,
}

/// Lends the thread's encoder out.
///
/// A query codes its signals under one dictionary after the other, for a fraction of a millisecond each; memory given
/// back to the system and asked for anew costs page faults.
pub(super) fn with_kept<T>(work: impl FnOnce(&mut Encoder) -> T) -> T {
    ENCODER.with_borrow_mut(|encoder| {
        let outcome = work(encoder);
        if encoder.arena.capacity().max(encoder.solved.capacity()) > KEPT {
            *encoder = Encoder::default();
        }
        outcome
    })
}

struct CodeBlock<'a> {
    encoder: &'a mut Encoder,
    dictionary: &'a Prepared,
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
            encoder,
            dictionary,
            signals,
            block,
            lambda,
            cancel,
        } = self;
        encoder.code_block(dictionary, signals, block, lambda, cancel)
    }
}

impl Encoder {
    /// Codes all signals.
    pub fn run(
        &mut self,
        dictionary: &Prepared,
        signals: &Signals<'_>,
        lambda: f64,
        cancel: &Cancel,
    ) -> Result<(), CodingError> {
        self.set.reset(dictionary.len());
        self.arena.clear();
        self.solved.clear();
        self.products = 0;
        for first in (0..signals.len()).step_by(BLOCK) {
            cancel.check()?;
            let block = first..signals.len().min(first + BLOCK);
            dictionary
                .screen()
                .correlate(signals, block.clone(), &mut self.screen);
            fastest(CodeBlock {
                encoder: self,
                dictionary,
                signals,
                block,
                lambda,
                cancel,
            })?;
        }
        Ok(())
    }

    /// The codes of the last run.
    pub fn codes(&self) -> Codes {
        let n = self.solved.len();
        let mut codes = Codes {
            offsets: Vec::with_capacity(n + 1),
            atoms: Vec::with_capacity(self.arena.len()),
            values: Vec::with_capacity(self.arena.len()),
            objective: Vec::with_capacity(n),
            residual2: Vec::with_capacity(n),
        };
        codes.offsets.push(0);
        for &(atom, value) in &self.arena {
            codes.atoms.push(atom);
            codes.values.push(value);
        }
        for &(end, score) in &self.solved {
            codes.offsets.push(end);
            codes.objective.push(score.objective);
            codes.residual2.push(score.residual2);
        }
        codes
    }

    /// What each signal of the last run cost.
    pub fn scores(&self) -> Vec<CodeScore> {
        self.solved.iter().map(|&(_, score)| score).collect()
    }

    /// Codes the signals `block`, whose correlations are in `screen`.
    #[inline(always)]
    fn code_block(
        &mut self,
        dictionary: &Prepared,
        signals: &Signals<'_>,
        block: Range<usize>,
        lambda: f64,
        cancel: &Cancel,
    ) -> Result<(), CodingError> {
        let width = pieces(dictionary.len());
        let first = block.start;
        let mut gram = dictionary.known_gram();
        for i in block {
            if i % CANCEL_EVERY == 0 {
                cancel.check()?;
            }
            let norm2 = signals.norms2[i];
            let rough = std::mem::take(&mut self.screen.correlations);
            if gram.is_none() && self.products > dictionary.len() * dictionary.len() / SHARE {
                gram = Some(dictionary.gram().as_ref());
            }
            let problem = Problem {
                atoms: dictionary.atoms().as_ref(),
                squares: dictionary.squares(),
                gram,
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
            let solved = self.set.solve_by_homotopy(&problem);
            self.products += self.set.homotopy.path.count * self.set.homotopy.path.count / 2;
            if solved {
                let score = self.path_score(&problem, norm2, i)?;
                self.solved.push((self.arena.len(), score));
                self.screen.correlations = rough;
                continue;
            }
            let solved = self.set.solve(&problem);
            self.products += self.set.atoms.len() * self.set.atoms.len() / 2;
            if solved {
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
        let path = &self.set.homotopy.path;
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
        let sums = Sums { norm1, product };
        self.cost(problem, norm2, start, number, sums)
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
        let sums = Sums { norm1, product };
        self.cost(problem, norm2, start, number, sums)
    }

    #[inline(always)]
    fn cost(
        &mut self,
        problem: &Problem<'_>,
        norm2: f64,
        start: usize,
        number: usize,
        Sums { norm1, product }: Sums,
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

    /// Where the homotopy failed: the active set from nothing, then coordinate descent.
    #[cold]
    #[inline(never)]
    fn fall_back(
        &mut self,
        problem: &Problem<'_>,
        dictionary: &Prepared,
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
