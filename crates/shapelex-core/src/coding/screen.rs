//! Products DᵀS at single precision with a bound on their error: enough to see which atoms cannot be active.
//!
//! Atoms are smooth and coherent, so few directions hold nearly all of them: D = QR + T with orthonormal Q (M × r) and
//! small columns of T. Then d_jᵀs = r_jᵀ(Qᵀs) + t_jᵀs, and as t_j is orthogonal to Q the part left out is at most
//! ‖t_j‖ · ‖s − QQᵀs‖, a product of two small numbers.

use super::Signals;
use super::dispatch::{Kernel, fastest};
use super::rows::{Lanes, Rows, padded};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use std::ops::Range;

/// The largest ‖t_j‖ of an atom against the largest atom.
const TAIL: f64 = 1e-3;
/// The projection is used where it takes at most this share of the operations.
const WORTHWHILE: f64 = 0.7;

/// More than what products lose that are too small for single precision.
const UNDERFLOW: f64 = 1e-34;

/// A dictionary at single precision.
#[derive(Clone, Debug)]
pub(super) struct Screen {
    /// Q, M × r; `None` where D itself is multiplied.
    basis: Option<Mat<f32>>,
    /// QᵀD, r × L, or D, padded by columns of zeros.
    atoms: Mat<f32>,
    /// DᵀD, L × L.
    pub gram: Rows,
    /// Bound on the error of its entries beyond their own rounding, for atoms of unit length.
    pub gram_error: f64,
    /// max ‖t_j‖, 0 without projection.
    tail: f64,
}

/// What [`Screen::correlate`] reuses.
#[derive(Clone, Debug, Default)]
pub(super) struct ScreenMemory {
    /// The signals at single precision.
    signals: Vec<f32>,
    projections: Vec<f32>,
    /// Dᵀs of each signal of the block, L values each, padded.
    pub correlations: Vec<Lanes>,
    /// Bound on the error of each signal's correlations.
    pub errors: Vec<f64>,
}

/// At single precision, with at least `columns` columns; those added are zero.
fn single(matrix: &Mat<f64>, columns: usize) -> Mat<f32> {
    let mut rounded = Mat::zeros(matrix.nrows(), columns);
    round(matrix, &mut rounded);
    rounded
}

fn round(matrix: &Mat<f64>, rounded: &mut Mat<f32>) {
    for j in 0..matrix.ncols() {
        for (to, from) in rounded.col_as_slice_mut(j).iter_mut().zip(matrix.col_as_slice(j)) {
            *to = *from as f32;
        }
    }
}

fn rounded_gram(gram: &Mat<f64>) -> Rows {
    Rows::new((0..gram.ncols()).map(|j| gram.col_as_slice(j)))
}

/// What a sum of so many terms loses at single precision, against the product of the lengths. Rounding in sums of m terms
/// grows with √m (Higham and Mary 2019); 8 standard deviations.
fn rounding_of_sums(terms: usize) -> f64 {
    8.0 * f64::from(f32::EPSILON) * (terms as f64).sqrt()
}

impl Screen {
    /// Without projection: for a dictionary that codes few signals.
    pub fn direct(atoms: &Mat<f64>) -> Self {
        let rounded = single(atoms, padded(atoms.ncols()));
        Self {
            basis: None,
            gram: Rows::gram(rounded.subcols(0, atoms.ncols())),
            gram_error: rounding_of_sums(atoms.nrows()),
            atoms: rounded,
            tail: 0.0,
        }
    }

    /// [`Screen::direct`] of as many atoms as before, in its place.
    pub fn renew(&mut self, atoms: &Mat<f64>) {
        round(atoms, &mut self.atoms);
        self.gram.renew_gram(self.atoms.subcols(0, atoms.ncols()));
    }

    /// With projection where it pays: for a dictionary that codes many signals.
    pub fn new(atoms: &Mat<f64>, gram: &Mat<f64>) -> Self {
        let (m, l) = (atoms.nrows(), atoms.ncols());
        let largest = (0..l).map(|j| gram[(j, j)]).fold(0.0, f64::max);
        let most = (WORTHWHILE * (m * l) as f64 / (m + l).max(1) as f64) as usize;
        let Some(pivots) = fastest(SpanningAtoms {
            gram,
            tail2: TAIL * TAIL * largest,
            most: most.min(m),
        }) else {
            return Self {
                gram: rounded_gram(gram),
                gram_error: 0.0,
                ..Self::direct(atoms)
            };
        };
        let mut chosen = Mat::zeros(m, pivots.len());
        for (k, &j) in pivots.iter().enumerate() {
            chosen.col_as_slice_mut(k).copy_from_slice(atoms.col_as_slice(j));
        }
        let basis = chosen.qr().compute_thin_Q();
        let mut projected = Mat::zeros(basis.ncols(), l);
        matmul(
            projected.as_mut(),
            Accum::Replace,
            basis.transpose(),
            atoms.as_ref(),
            1.0,
            Par::Seq,
        );
        // ‖t_j‖² = ‖d_j‖² − ‖r_j‖², with its rounding on top.
        let tail2 = (0..l)
            .map(|j| gram[(j, j)] - projected.col(j).squared_norm_l2())
            .fold(0.0, f64::max);
        Self {
            tail: (tail2 + 1e-13 * largest).sqrt(),
            atoms: single(&projected, padded(l)),
            basis: Some(single(&basis, basis.ncols())),
            gram: rounded_gram(gram),
            gram_error: 0.0,
        }
    }

    /// Approximate Dᵀs for the signals `block`.
    pub fn correlate(&self, signals: &Signals<'_>, block: Range<usize>, memory: &mut ScreenMemory) {
        let (m, n, l) = (signals.dimension(), block.len(), self.atoms.ncols());
        let norms2 = &signals.norms2[block.clone()];
        memory.signals.resize(m * n, 0.0);
        fastest(Round {
            signals,
            block,
            rounded: &mut memory.signals,
        });
        let signals = MatRef::from_column_major_slice(&memory.signals, m, n);
        let r = self.atoms.nrows();
        memory
            .correlations
            .resize(l * n / Lanes::default().len(), Lanes::default());
        memory.errors.clear();
        let rounding = rounding_of_sums(m) + rounding_of_sums(r);
        let product = MatMut::from_column_major_slice_mut(memory.correlations.as_flattened_mut(), l, n);
        let Some(basis) = &self.basis else {
            matmul(
                product,
                Accum::Replace,
                self.atoms.transpose(),
                signals,
                1.0,
                Par::Seq,
            );
            memory
                .errors
                .extend(norms2.iter().map(|norm2| rounding * norm2.sqrt() + UNDERFLOW));
            return;
        };
        memory.projections.resize(r * n, 0.0);
        let projections = MatMut::from_column_major_slice_mut(&mut memory.projections, r, n);
        matmul(
            projections,
            Accum::Replace,
            basis.transpose(),
            signals,
            1.0,
            Par::Seq,
        );
        let projections = MatRef::from_column_major_slice(&memory.projections, r, n);
        matmul(
            product,
            Accum::Replace,
            self.atoms.transpose(),
            projections,
            1.0,
            Par::Seq,
        );
        fastest(Errors {
            norms2,
            projections: &memory.projections,
            dimension: r,
            tail: self.tail,
            rounding,
            errors: &mut memory.errors,
        });
    }
}

/// Bounds on the errors of projected correlations.
struct Errors<'a> {
    norms2: &'a [f64],
    projections: &'a [f32],
    dimension: usize,
    tail: f64,
    rounding: f64,
    errors: &'a mut Vec<f64>,
}

impl Kernel for Errors<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let projections = self.projections.chunks_exact(self.dimension);
        for (norm2, projection) in self.norms2.iter().zip(projections) {
            let kept = energy(projection);
            // What single precision cannot tell from zero counts as left out.
            let left_out = (norm2 - f64::from(kept)).max(0.0) + 1e-4 * norm2;
            self.errors
                .push(self.tail * left_out.sqrt() + self.rounding * norm2.sqrt() + UNDERFLOW);
        }
    }
}

/// Signals at single precision, one after the other.
struct Round<'a> {
    signals: &'a Signals<'a>,
    block: Range<usize>,
    rounded: &'a mut [f32],
}

impl Kernel for Round<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let length = self.signals.dimension();
        for (i, rounded) in self.block.zip(self.rounded.chunks_exact_mut(length.max(1))) {
            for (to, from) in rounded.iter_mut().zip(self.signals.signal(i)) {
                *to = *from as f32;
            }
        }
    }
}

/// Σ y², in eight sums side by side.
#[inline(always)]
fn energy(values: &[f32]) -> f32 {
    let (chunks, rest) = values.as_chunks::<8>();
    let mut lanes = [0f32; 8];
    for chunk in chunks {
        for (lane, y) in lanes.iter_mut().zip(chunk) {
            *lane += y * y;
        }
    }
    lanes.iter().sum::<f32>() + rest.iter().map(|y| y * y).sum::<f32>()
}

/// Atoms that span all atoms to within `tail2` of squared distance, by pivoted Cholesky of their Gram matrix; `None`
/// where `most` do not suffice.
struct SpanningAtoms<'a> {
    gram: &'a Mat<f64>,
    tail2: f64,
    most: usize,
}

impl Kernel for SpanningAtoms<'_> {
    type Output = Option<Vec<usize>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { gram, tail2, most } = self;
        let l = gram.nrows();
        let mut left: Vec<f64> = (0..l).map(|j| gram[(j, j)]).collect();
        let mut pivots = Vec::new();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        loop {
            let mut pivot = 0;
            for j in 1..l {
                if left[j] > left[pivot] {
                    pivot = j;
                }
            }
            if l == 0 || left[pivot] <= tail2 {
                return (!pivots.is_empty()).then_some(pivots);
            }
            if pivots.len() == most {
                return None;
            }
            let mut column = gram.col_as_slice(pivot).to_vec();
            for other in &columns {
                let weight = other[pivot];
                for (c, o) in column.iter_mut().zip(other) {
                    *c -= weight * o;
                }
            }
            let scale = left[pivot].sqrt().recip();
            for (c, rest) in column.iter_mut().zip(&mut left) {
                *c *= scale;
                *rest -= *c * *c;
            }
            left[pivot] = 0.0;
            pivots.push(pivot);
            columns.push(column);
        }
    }
}
