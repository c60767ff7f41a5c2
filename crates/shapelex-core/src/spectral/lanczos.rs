//! Block Lanczos on (S − c I)⁻¹ with partial re-orthogonalisation.
//!
//! Golub and Underwood's block recurrence, OP V_j = V_{j−1} R_{j−1}ᵀ + V_j A_j + V_{j+1} R_j, with OP the shifted inverse,
//! in the order of the factor. Rounding makes new blocks lean back towards old ones; as long as the lean stays below
//! the square root of the machine precision, the projection is right to full precision (Simon 1984). How far it has
//! grown follows from the recurrence itself ([`loss`](super::loss)), so the basis is read only when it is due, and then
//! for two blocks at once (Grimes, Lewis and Simon 1994).

use super::SpectralError;
use super::band::Band;
use super::basis::Basis;
use super::block_qr::{Small, add_product, cholesky_qr, cholesky_qr_from, inner, negated, product};
use super::dense;
use super::loss::Loss;
use super::near::{Near, products, subtract, subtract_last};
use super::normalised::NullSpace;
use super::rows::Rows;
use super::scratch::Scratch;
use super::shift_invert::Factor;
use super::simd::{Row, Simd};
use faer::Mat;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// The state of the recurrence.
pub struct Lanczos<'a, const B: usize> {
    factor: &'a Factor,
    null: &'a NullSpace,
    /// The null vector if it is the only one, or zeros.
    null_vector: Vec<f64>,
    simd: Simd,
    rng: ChaCha8Rng,
    /// Orthonormal columns; the last B of them are outside the projection.
    basis: Basis,
    previous: Vec<[f64; B]>,
    current: Vec<[f64; B]>,
    spare: Vec<[f64; B]>,
    /// Projection of OP on the basis: diagonal blocks A_j and the blocks R_j below them.
    diagonal: Vec<Small<B>>,
    below: Vec<Small<B>>,
    loss: Loss<B>,
}

/// Eigenpairs of the projected operator, those asked for.
pub struct Ritz {
    /// Ritz values of OP, ascending.
    pub theta: Vec<f64>,
    /// m × k, one eigenvector per column.
    pub vectors: Mat<f64>,
    /// B × k: R_last times the last B rows of `vectors`; the norm of a column is the residual of OP.
    pub tail: Mat<f64>,
}

impl<'a, const B: usize> Lanczos<'a, B>
where
    [f64; B]: Row,
{
    /// Starts from a random block. The basis has at most `capacity` columns, a multiple of B, and probably no more than
    /// `expected`.
    pub fn new(
        n: usize,
        factor: &'a Factor,
        null: &'a NullSpace,
        expected: usize,
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
            null_vector: match null.count {
                1 => null.entry.clone(),
                _ => vec![0.0; n],
            },
            simd: Simd::detect(),
            rng,
            basis: Basis::new(n, expected + 2 * B, capacity + B),
            previous: vec![[0.0; B]; n],
            current: Vec::new(),
            spare: Vec::new(),
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
        // The buffers of the step before the last serve again: fresh memory costs more than the arithmetic.
        let mut w = std::mem::take(&mut self.spare);
        w.clone_from(&self.current);
        self.factor.solve::<B>(&mut w);
        if self.null.count > 1 {
            remove_null_space(self.null, &mut w);
        }
        let near = Near {
            previous: &self.previous,
            current: &self.current,
            null: &self.null_vector,
        };
        let h = products::<B>(self.simd, &near, &w);
        let scale = h.squares.iter().sum::<f64>().sqrt();
        if !scale.is_finite() {
            return Err(SpectralError::NotConverged {
                detail: "the shifted solve overflowed".into(),
            });
        }
        let a = &h.current;
        let a: Small<B> = std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (a[i][j] + a[j][i])));
        // Once more: what cancellation left of them.
        let left = subtract::<B>(self.simd, &near, &mut w, &h);
        let gram = subtract_last::<B>(self.simd, &near, &mut w, &left);

        let rounding = 1e-13 * scale;
        let r = match cholesky_qr_from::<B>(self.simd, &mut w, &gram, rounding) {
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
        let current = std::mem::replace(&mut self.current, w);
        self.spare = std::mem::replace(&mut self.previous, current);
        Ok(())
    }

    /// Removes the first `older` columns of the basis from the current block and from `w`, W vectors at a time, half of
    /// them of either; returns the largest product found.
    fn project_pair<const W: usize>(&mut self, w: &mut [[f64; B]], older: usize) -> f64
    where
        [f64; W]: Row,
    {
        let half = W / 2;
        let mut found = 0.0f64;
        let mut memory = Scratch::new(w.len() * W);
        let pair = memory.as_chunks_mut::<W>().0;
        for first in (0..B).step_by(half) {
            for ((p, c), w) in pair.iter_mut().zip(&self.current).zip(w.iter()) {
                p[..half].copy_from_slice(&c[first..first + half]);
                p[half..].copy_from_slice(&w[first..first + half]);
            }
            let lost = self.basis.project_out::<W>(self.simd, older, pair);
            // Beyond this one pass is not enough.
            if lost > 1e-4 {
                self.basis.project_out::<W>(self.simd, older, pair);
            }
            found = found.max(lost);
            for ((p, c), w) in pair.iter().zip(&mut self.current).zip(w.iter_mut()) {
                c[first..first + half].copy_from_slice(&p[..half]);
                w[first..first + half].copy_from_slice(&p[half..]);
            }
        }
        found
    }

    /// Removes the older basis from the current block and from the new one W = Q (with factor `r`), in one pass;
    /// returns the new factor.
    fn reorthogonalise(&mut self, w: &mut [[f64; B]], r: &Small<B>) -> Result<Small<B>, SpectralError> {
        let older = self.basis.columns() - B;
        let found = match B {
            4 => self.project_pair::<8>(w, older),
            _ => self.project_pair::<16>(w, older),
        };
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
        let norm = |column: &[[f64; 8]]| column.iter().map(|x| x[0] * x[0]).sum::<f64>().sqrt();
        let mut r = [[0.0; B]; B];
        for c in 0..B {
            // One vector; the other places of its rows stay zero.
            let alone = |x: f64| std::array::from_fn(|k| if k == 0 { x } else { 0.0 });
            let mut column: Vec<[f64; 8]> = w.iter().map(|row| alone(row[c])).collect();
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
                    for x in &mut column {
                        x[0] = self.rng.random::<f64>() - 0.5;
                    }
                    remove_null_space(self.null, &mut column);
                    continue;
                }
                self.basis
                    .project_out::<8>(self.simd, self.basis.columns(), &mut column);
                for k in 0..c {
                    let h: f64 = column.iter().zip(w.iter()).map(|(x, row)| x[0] * row[k]).sum();
                    for (x, row) in column.iter_mut().zip(w.iter()) {
                        x[0] -= h * row[k];
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
                row[c] = x[0] / length;
            }
        }
        Ok(r)
    }

    /// The projection, a band: R is upper triangular.
    fn projection(&self) -> Band<B> {
        Band::new(self.dimension(), |i, j| {
            let (block, column) = (j / B, j % B);
            match i / B == block {
                true => self.diagonal[block][i % B][column],
                false => self.below[block][i % B][column],
            }
        })
    }

    /// Eigenvalues of the projection, ascending.
    pub fn ritz_values(&self) -> Result<Vec<f64>, SpectralError> {
        match self.projection().eigenvalues() {
            Some(theta) => Ok(theta),
            None => Ok(dense::symmetric_eigen(self.projection().to_dense().as_ref())?.0),
        }
    }

    /// Eigenpairs of the projection: those at places `which` (ascending) of [`Lanczos::ritz_values`], `theta`.
    pub fn ritz(&self, theta: &[f64], which: &[usize]) -> Result<Ritz, SpectralError> {
        let projection = self.projection();
        let chosen: Vec<f64> = which.iter().map(|&i| theta[i]).collect();
        let (theta, vectors) = match projection.eigenvectors(&chosen) {
            Some(vectors) => (chosen, vectors),
            None => {
                let (all, vectors) = dense::symmetric_eigen(projection.to_dense().as_ref())?;
                let vectors = Mat::from_fn(vectors.nrows(), which.len(), |i, k| vectors[(i, which[k])]);
                (which.iter().map(|&i| all[i]).collect(), vectors)
            }
        };
        let last = self.below.last().map_or([[0.0; B]; B], |r| *r);
        let last = Mat::<f64>::from_fn(B, B, |i, j| last[i][j]);
        let tail = &last * vectors.as_ref().subrows(vectors.nrows() - B, B);
        Ok(Ritz { theta, vectors, tail })
    }

    /// The basis alone; all else is freed.
    pub fn into_basis(self) -> Basis {
        self.basis
    }
}

impl Ritz {
    /// Eigenvectors of S for the chosen Ritz pairs of `basis`: n × k, unit columns; row i is called `order[i]`.
    ///
    /// Each is OP applied to the Ritz vector over its Ritz value, which costs no further solve because the recurrence
    /// knows OP V: x = V y + V_{m+1} (R_last y_last) / θ.
    pub fn vectors(&self, basis: Basis, chosen: &[usize], order: &[usize]) -> Rows {
        let (m, k) = (self.vectors.nrows(), chosen.len());
        let block = self.tail.nrows();
        let mut y = Mat::<f64>::zeros(m + block, k);
        for (q, &c) in chosen.iter().enumerate() {
            let tail = self.tail.col(c);
            let relative = tail.norm_l2() / self.theta[c];
            let unit = 1.0 / relative.mul_add(relative, 1.0).sqrt();
            for i in 0..m {
                y[(i, q)] = self.vectors[(i, c)] * unit;
            }
            for i in 0..block {
                y[(m + i, q)] = tail[i] / self.theta[c] * unit;
            }
        }
        basis.times(y.as_ref(), order)
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
