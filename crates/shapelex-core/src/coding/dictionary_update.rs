//! The dictionary half of online learning: running sums, block-coordinate descent on the atoms, and what replaces
//! atoms of no use (Mairal et al. 2010, Algorithm 2 and Section 3.4).

use super::Codes;
use super::dispatch::{Kernel, fastest};
use super::dot::dot;
use super::initialise::jittered;
use super::prepared::Prepared;
use super::problem::column;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

/// Atoms whose directions agree to more than this are one.
const COHERENT: f64 = 1.0 - 1e-6;
/// An atom has been idle for long once this many signals per atom have passed it by.
const IDLE_SIGNALS_PER_ATOM: usize = 4;

/// ρ of Section 3.4.1: the power of β by which old codes fade. A compromise, from one class of shapes: against 1 it
/// lowers the objective of `sqrt_unit` and raw signals and raises that of unit ones a little; 3 is best for raw ones.
const FADING: i32 = 2;
/// Atoms whose residuals are formed together.
const TOGETHER: usize = 32;
/// From one non-zero in this many on, the product with A is formed as a dense one.
const DENSE: usize = 12;

struct Step<'a> {
    update: &'a mut DictionaryUpdate,
    batch: MatRef<'a, f64>,
    codes: &'a Codes,
}

impl Kernel for Step<'_> {
    type Output = Vec<usize>;

    #[inline(always)]
    fn run(self) -> Vec<usize> {
        self.update.take_in(self.batch, self.codes)
    }
}

#[inline(always)]
fn subtract(from: &mut [f64], weight: f64, values: &[f64]) {
    for (x, v) in from.iter_mut().zip(values) {
        *x -= weight * v;
    }
}

/// Atoms and running sums between mini-batches. The sums are stored by columns, one after the other.
pub(super) struct DictionaryUpdate {
    dimension: usize,
    batch: usize,
    /// D, M × L. What it holds beside the atoms is that of the atoms last handed out.
    dictionary: Prepared,
    /// A = Σ aaᵀ, L × L, faded.
    code_sums: Vec<f64>,
    /// B = Σ saᵀ, M × L, faded.
    signal_sums: Vec<f64>,
    /// Signals coded since the atom was last used.
    idle: Vec<usize>,
    iteration: usize,
    replaced: usize,
    /// Whether atoms have moved since D was last handed out.
    moved: bool,
    residual: Vec<f64>,
    difference: Vec<f64>,
}

impl DictionaryUpdate {
    /// From initial atoms.
    pub fn new(dictionary: Prepared, batch: usize) -> Self {
        let (dimension, count) = (dictionary.dimension(), dictionary.len());
        Self {
            dimension,
            batch,
            signal_sums: vec![0.0; dimension * count],
            dictionary,
            code_sums: vec![0.0; count * count],
            idle: vec![0; count],
            iteration: 0,
            replaced: 0,
            moved: false,
            residual: Vec::new(),
            difference: Vec::new(),
        }
    }

    /// D, given up.
    pub fn into_atoms(self) -> Mat<f64> {
        self.dictionary.into_atoms()
    }

    /// Atoms replaced so far.
    pub fn replaced(&self) -> usize {
        self.replaced
    }

    /// D as it stands, ready to code.
    pub fn dictionary(&mut self) -> &Prepared {
        if self.moved {
            self.dictionary.renew();
            self.moved = false;
        }
        &self.dictionary
    }

    /// Takes in a mini-batch (M × η) coded under the dictionary last handed out, and moves the atoms.
    pub fn step(&mut self, batch: MatRef<'_, f64>, codes: &Codes, random: &mut ChaCha8Rng) {
        let useless = fastest(Step {
            update: self,
            batch,
            codes,
        });
        self.moved = true;
        self.replace(&useless, batch, codes, random);
    }

    /// [`Self::step`] but for the replacement of the atoms it returns.
    #[inline(always)]
    fn take_in(&mut self, batch: MatRef<'_, f64>, codes: &Codes) -> Vec<usize> {
        self.iteration += 1;
        self.fade();
        self.accumulate(batch, codes);
        let mut useless = self.merge_duplicates();
        let count = self.idle.len();
        for j in 0..count {
            if self.idle[j] >= IDLE_SIGNALS_PER_ATOM * count {
                useless.push(j);
            }
        }
        useless.sort_unstable();
        useless.dedup();
        for first in (0..count).step_by(TOGETHER) {
            self.move_atoms(first..count.min(first + TOGETHER));
        }
        useless
    }

    #[inline(always)]
    fn fade(&mut self) {
        let (t, eta) = (self.iteration as f64, self.batch as f64);
        let theta = if t < eta { t * eta } else { eta * eta + t - eta };
        let beta = ((theta + 1.0 - eta) / (theta + 1.0)).powi(FADING);
        self.code_sums.iter_mut().for_each(|v| *v *= beta);
        self.signal_sums.iter_mut().for_each(|v| *v *= beta);
    }

    #[inline(always)]
    fn accumulate(&mut self, batch: MatRef<'_, f64>, codes: &Codes) {
        let count = self.idle.len();
        self.idle.iter_mut().for_each(|idle| *idle += batch.ncols());
        for i in 0..batch.ncols() {
            let signal = column(batch, i);
            let code = codes.offsets[i]..codes.offsets[i + 1];
            let (atoms, values) = (&codes.atoms[code.clone()], &codes.values[code]);
            for (&j, &a) in atoms.iter().zip(values) {
                let j = j as usize;
                self.idle[j] = 0;
                let sums = &mut self.signal_sums[j * self.dimension..][..self.dimension];
                for (b, s) in sums.iter_mut().zip(signal) {
                    *b += a * s;
                }
                let sums = &mut self.code_sums[j * count..][..count];
                for (&k, &other) in atoms.iter().zip(values) {
                    sums[k as usize] += a * other;
                }
            }
        }
    }

    /// Hands the sums of an atom that nearly equals an earlier one over to that one; returns the atoms left over.
    #[inline(always)]
    fn merge_duplicates(&mut self) -> Vec<usize> {
        let dictionary = &self.dictionary;
        let screen = dictionary.screen();
        let count = self.idle.len();
        let mut duplicates = Vec::new();
        let product = |i: usize, j: usize| {
            let atoms = dictionary.atoms();
            dot(atoms.col_as_slice(i), atoms.col_as_slice(j))
        };
        let norms: Vec<f64> = (0..count).map(|j| product(j, j).sqrt()).collect();
        // Where single precision sees that none is near, none is.
        let near = COHERENT - 2.0 * screen.gram_error - 2.0 * f64::from(f32::EPSILON);
        let rough_norms: Vec<f32> = norms.iter().map(|norm| (near * norm) as f32).collect();
        for j in 0..count {
            let products = &screen.gram.row(j).as_flattened()[..j];
            let norm = norms[j] as f32;
            let mut any = false;
            for (product, rough) in products.iter().zip(&rough_norms) {
                any |= *product > norm * rough;
            }
            if !any {
                continue;
            }
            let twin = (0..j).find(|&i| {
                products[i] > norm * rough_norms[i] && product(i, j) > COHERENT * norms[j] * norms[i]
            });
            let Some(i) = twin.filter(|i| !duplicates.contains(i)) else {
                continue;
            };
            duplicates.push(j);
            // d_i takes the codes a_i + a_j: row and column j of A are added to row and column i.
            for k in 0..count {
                let value = std::mem::take(&mut self.code_sums[j * count + k]);
                self.code_sums[i * count + k] += value;
            }
            for k in 0..count {
                let value = std::mem::take(&mut self.code_sums[k * count + j]);
                self.code_sums[k * count + i] += value;
            }
            for m in 0..self.dimension {
                let value = std::mem::take(&mut self.signal_sums[j * self.dimension + m]);
                self.signal_sums[i * self.dimension + m] += value;
            }
        }
        duplicates
    }

    /// d_j ← d_j + (b_j − D A_j)/A_jj, then onto the unit ball (Algorithm 2), for the atoms of `block` one after the
    /// other.
    #[inline(always)]
    fn move_atoms(&mut self, block: Range<usize>) {
        let (m, count) = (self.dimension, self.idle.len());
        let weights = &self.code_sums[block.start * count..block.end * count];
        let atoms = self.dictionary.atoms_mut();
        // (B − D A) of the block under the atoms as they are before the block.
        self.residual.clear();
        self.residual
            .extend_from_slice(&self.signal_sums[block.start * m..block.end * m]);
        let pairs = weights.iter().filter(|a| **a != 0.0).count();
        if DENSE * pairs > weights.len() {
            let residual = MatMut::from_column_major_slice_mut(&mut self.residual, m, block.len());
            let weights = MatRef::from_column_major_slice(weights, count, block.len());
            matmul(residual, Accum::Add, atoms.as_ref(), weights, -1.0, Par::Seq);
        } else {
            for (residual, weights) in self.residual.chunks_exact_mut(m).zip(weights.chunks_exact(count)) {
                for (k, &a) in weights.iter().enumerate() {
                    if a != 0.0 {
                        subtract(residual, a, atoms.col_as_slice(k));
                    }
                }
            }
        }
        for j in block.clone() {
            let weight = self.code_sums[j * count + j];
            if weight <= f64::MIN_POSITIVE {
                continue;
            }
            let residual = &self.residual[(j - block.start) * m..][..m];
            let atom = atoms.col_as_slice_mut(j);
            self.difference.clear();
            self.difference
                .extend(residual.iter().zip(atom.iter()).map(|(r, d)| r + weight * d));
            let norm = dot(&self.difference, &self.difference).sqrt();
            // (b_j − Σ_{k≠j} A_kj d_k)/A_jj, shortened to unit norm where it is longer.
            let scale = if norm > weight { 1.0 / norm } else { 1.0 / weight };
            if !scale.is_finite() {
                continue;
            }
            for (d, u) in atom.iter_mut().zip(&mut self.difference) {
                let new = scale * *u;
                *u = new - *d;
                *d = new;
            }
            // The atoms after this one in the block see it where it is now.
            for k in j + 1..block.end {
                let a = self.code_sums[k * count + j];
                if a != 0.0 {
                    subtract(
                        &mut self.residual[(k - block.start) * m..][..m],
                        a,
                        &self.difference,
                    );
                }
            }
        }
    }

    /// Puts the signals coded worst in the place of `useless` atoms, as many as there are, no two nearly equal.
    fn replace(&mut self, useless: &[usize], batch: MatRef<'_, f64>, codes: &Codes, random: &mut ChaCha8Rng) {
        if useless.is_empty() {
            return;
        }
        let (dimension, count) = (self.dimension, self.idle.len());
        let mut worst: Vec<usize> = (0..batch.ncols()).collect();
        worst.sort_by(|&a, &b| codes.objective[b].total_cmp(&codes.objective[a]).then(a.cmp(&b)));
        let mut taken: Vec<Vec<f64>> = Vec::new();
        for i in worst {
            if taken.len() == useless.len() {
                break;
            }
            let atom = jittered(column(batch, i), random);
            if taken.iter().any(|other| dot(other, &atom) > COHERENT) {
                continue;
            }
            let j = useless[taken.len()];
            self.dictionary
                .atoms_mut()
                .col_as_slice_mut(j)
                .copy_from_slice(&atom);
            self.signal_sums[j * dimension..][..dimension].fill(0.0);
            self.code_sums[j * count..][..count].fill(0.0);
            for k in 0..count {
                self.code_sums[k * count + j] = 0.0;
            }
            self.idle[j] = 0;
            taken.push(atom);
        }
        self.replaced += taken.len();
    }
}
