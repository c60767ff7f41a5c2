//! Block Lanczos on (S − c I)⁻¹ with partial re-orthogonalisation.
//!
//! Golub and Underwood's block recurrence, OP V_j = V_{j−1} R_{j−1}ᵀ + V_j A_j + V_{j+1} R_j, with OP the shifted inverse,
//! in the order of the factor. Rounding makes new blocks lean back towards old ones; as long as the lean stays below
//! the square root of the machine precision, the projection is right to full precision (Simon 1984). How far it has
//! grown follows from the recurrence itself ([`loss`](super::loss)), so the basis is read only when it is due, and then
//! for two blocks at once (Grimes, Lewis and Simon 1994).

use super::SpectralError;
use super::basis::Basis;
use super::block_qr::{Small, add_product, cholesky_qr, inner, negated, product, transposed};
use super::dense;
use super::loss::Loss;
use super::normalised::NullSpace;
use super::shift_invert::Factor;
use super::simd::Simd;
use faer::Mat;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// The state of the recurrence.
pub struct Lanczos<'a, const B: usize> {
    factor: &'a Factor,
    null: &'a NullSpace,
    simd: Simd,
    rng: ChaCha8Rng,
    /// Orthonormal columns; the last B of them are outside the projection.
    basis: Basis,
    previous: Vec<[f64; B]>,
    current: Vec<[f64; B]>,
    /// Projection of OP on the basis: diagonal blocks A_j and the blocks R_j below them.
    diagonal: Vec<Small<B>>,
    below: Vec<Small<B>>,
    loss: Loss<B>,
}

/// Eigenpairs of the projected operator.
pub struct Ritz {
    /// Ritz values of OP, ascending.
    pub theta: Vec<f64>,
    /// m × m, one eigenvector per column.
    pub vectors: Mat<f64>,
    /// B × m: R_last times the last B rows of `vectors`; the norm of a column is the residual of OP.
    pub tail: Mat<f64>,
}

impl<'a, const B: usize> Lanczos<'a, B> {
    /// Starts from a random block. `capacity` columns of basis are reserved, a multiple of B.
    pub fn new(
        n: usize,
        factor: &'a Factor,
        null: &'a NullSpace,
        capacity: usize,
        mut rng: ChaCha8Rng,
    ) -> Result<Self, SpectralError> {
        let mut start: Vec<[f64; B]> = vec![[0.0; B]; n];
        for value in start.iter_mut().flatten() {
            *value = rng.random::<f64>() - 0.5;
        }
        let mut lanczos = Self {
            factor,
            null,
            simd: Simd::detect(),
            rng,
            basis: Basis::new(n, capacity + B),
            previous: Vec::new(),
            current: Vec::new(),
            diagonal: Vec::new(),
            below: Vec::new(),
            loss: Loss::new(),
        };
        remove_null_space(null, &mut start);
        if cholesky_qr::<B>(lanczos.simd, &mut start, 0.0).is_none() {
            lanczos.column_by_column(&mut start, 0.0)?;
        }
        lanczos.basis.append(&start);
        lanczos.current = start;
        Ok(lanczos)
    }

    /// Dimension of the projection.
    pub fn dimension(&self) -> usize {
        self.diagonal.len() * B
    }

    /// Whether another step fits the basis reserved.
    pub fn has_room(&self) -> bool {
        self.basis.has_room(B)
    }

    /// One step: B more columns.
    pub fn step(&mut self) -> Result<(), SpectralError> {
        let mut w = self.current.clone();
        self.factor.solve::<B>(&mut w);
        let scale = w.iter().flatten().fold(0.0f64, |s, x| s + x * x).sqrt();
        if !scale.is_finite() {
            return Err(SpectralError::NotConverged {
                detail: "the shifted solve overflowed".into(),
            });
        }
        remove_null_space(self.null, &mut w);
        if let Some(r) = self.below.last() {
            add_product::<B>(self.simd, &mut w, &self.previous, &negated(&transposed(r)));
        }
        let a = inner::<B>(self.simd, &self.current, &w);
        let a: Small<B> = std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (a[i][j] + a[j][i])));
        add_product::<B>(self.simd, &mut w, &self.current, &negated(&a));
        // Once more against the two neighbours: what cancellation left of them.
        if !self.below.is_empty() {
            let h = inner::<B>(self.simd, &self.previous, &w);
            add_product::<B>(self.simd, &mut w, &self.previous, &negated(&h));
        }
        let h = inner::<B>(self.simd, &self.current, &w);
        add_product::<B>(self.simd, &mut w, &self.current, &negated(&h));

        let rounding = 1e-13 * scale;
        let r = match cholesky_qr::<B>(self.simd, &mut w, rounding) {
            Some(r) => {
                let due = self.loss.advance(&self.diagonal, &self.below, &a, &r);
                if due { self.reorthogonalise(&mut w, &r)? } else { r }
            }
            None => {
                let r = self.column_by_column(&mut w, rounding)?;
                self.loss.reset_new(self.below.len());
                r
            }
        };
        self.diagonal.push(a);
        self.below.push(r);
        self.basis.append(&w);
        self.previous = std::mem::replace(&mut self.current, w);
        Ok(())
    }

    /// Removes the older basis from the current block and from the new one W = Q (with factor `r`), in one pass;
    /// returns the new factor.
    fn reorthogonalise(&mut self, w: &mut [[f64; B]], r: &Small<B>) -> Result<Small<B>, SpectralError> {
        let older = self.basis.columns() - B;
        let mut pair: Vec<[[f64; B]; 2]> = self.current.iter().zip(w.iter()).map(|(c, w)| [*c, *w]).collect();
        let found = self.basis.project_out::<B, 2>(self.simd, older, &mut pair);
        // Beyond this one pass is not enough.
        if found > 1e-4 {
            self.basis.project_out::<B, 2>(self.simd, older, &mut pair);
        }
        for ((c, w), p) in self.current.iter_mut().zip(w.iter_mut()).zip(&pair) {
            *c = p[0];
            *w = p[1];
        }
        self.loss.reset_both(self.below.len(), found);
        self.basis.overwrite_last(&self.current);
        let h = inner::<B>(self.simd, &self.current, w);
        add_product::<B>(self.simd, w, &self.current, &negated(&h));
        match cholesky_qr::<B>(self.simd, w, 0.0) {
            Some(correction) => Ok(product(&correction, r)),
            None => Err(SpectralError::NotConverged {
                detail: "orthogonality was lost".into(),
            }),
        }
    }

    /// Gram-Schmidt against the whole basis with replacement, for a block that has (nearly) lost rank: columns that
    /// vanish are replaced by random ones with zeros in R.
    fn column_by_column(&mut self, w: &mut [[f64; B]], rounding: f64) -> Result<Small<B>, SpectralError> {
        let norm = |column: &[[[f64; 1]; 1]]| column.iter().map(|x| x[0][0] * x[0][0]).sum::<f64>().sqrt();
        let mut r = [[0.0; B]; B];
        for c in 0..B {
            let mut column: Vec<[[f64; 1]; 1]> = w.iter().map(|row| [[row[c]]]).collect();
            let mut replaced = 0;
            loop {
                let before = norm(&column);
                if before <= rounding || before == 0.0 {
                    replaced += 1;
                    if replaced > 3 {
                        return Err(SpectralError::NotConverged {
                            detail: "the Krylov basis cannot be extended".into(),
                        });
                    }
                    let mut fresh: Vec<[f64; 1]> =
                        column.iter().map(|_| [self.rng.random::<f64>() - 0.5]).collect();
                    remove_null_space(self.null, &mut fresh);
                    column = fresh.into_iter().map(|x| [x]).collect();
                    continue;
                }
                self.basis
                    .project_out::<1, 1>(self.simd, self.basis.columns(), &mut column);
                for k in 0..c {
                    let h: f64 = column.iter().zip(w.iter()).map(|(x, row)| x[0][0] * row[k]).sum();
                    for (x, row) in column.iter_mut().zip(w.iter()) {
                        x[0][0] -= h * row[k];
                    }
                    if replaced == 0 {
                        r[k][c] += h;
                    }
                }
                // Half the norm left means that rounding is no longer amplified.
                if norm(&column) > 0.5 * before {
                    break;
                }
            }
            let length = norm(&column);
            r[c][c] = if replaced > 0 { 0.0 } else { length };
            for (x, row) in column.iter().zip(w.iter_mut()) {
                row[c] = x[0][0] / length;
            }
        }
        Ok(r)
    }

    /// The eigenpairs of the projection.
    pub fn ritz(&self) -> Result<Ritz, SpectralError> {
        let m = self.dimension();
        let mut t = Mat::<f64>::zeros(m, m);
        for (j, (a, r)) in self.diagonal.iter().zip(&self.below).enumerate() {
            for i in 0..B {
                for k in 0..B {
                    t[(j * B + i, j * B + k)] = a[i][k];
                    if (j + 1) * B < m {
                        t[((j + 1) * B + i, j * B + k)] = r[i][k];
                        t[(j * B + k, (j + 1) * B + i)] = r[i][k];
                    }
                }
            }
        }
        let (theta, vectors) = dense::symmetric_eigen(t.as_ref())?;
        let last = self.below.last().map_or([[0.0; B]; B], |r| *r);
        let last = Mat::<f64>::from_fn(B, B, |i, j| last[i][j]);
        let tail = &last * vectors.as_ref().submatrix(m - B, 0, B, m);
        Ok(Ritz { theta, vectors, tail })
    }

    /// Eigenvectors of S for the chosen Ritz pairs: n × k, row by row, unit columns.
    ///
    /// Each is OP applied to the Ritz vector over its Ritz value, which costs no further solve because the recurrence
    /// knows OP V: x = V y + V_{m+1} (R_last y_last) / θ.
    pub fn vectors(&self, ritz: &Ritz, chosen: &[usize]) -> Vec<f64> {
        let (m, k) = (self.dimension(), chosen.len());
        let mut y = Mat::<f64>::zeros(m + B, k);
        for (q, &c) in chosen.iter().enumerate() {
            let tail = ritz.tail.col(c);
            let relative = tail.norm_l2() / ritz.theta[c];
            let unit = 1.0 / relative.mul_add(relative, 1.0).sqrt();
            for i in 0..m {
                y[(i, q)] = ritz.vectors[(i, c)] * unit;
            }
            for i in 0..B {
                y[(m + i, q)] = tail[i] / ritz.theta[c] * unit;
            }
        }
        self.basis.times(y.as_ref())
    }
}

/// W ← W − N NᵀW.
fn remove_null_space<const B: usize>(null: &NullSpace, w: &mut [[f64; B]]) {
    if null.count == 0 {
        return;
    }
    let mut sums = vec![[0.0; B]; null.count];
    for ((row, &label), entry) in w.iter().zip(&null.label).zip(&null.entry) {
        if label != u32::MAX {
            for (sum, x) in sums[label as usize].iter_mut().zip(row) {
                *sum += x * entry;
            }
        }
    }
    for ((row, &label), entry) in w.iter_mut().zip(&null.label).zip(&null.entry) {
        if label != u32::MAX {
            for (sum, x) in sums[label as usize].iter().zip(row) {
                *x -= sum * entry;
            }
        }
    }
}
