//! Chosen eigenvectors of a symmetric band matrix T by inverse iteration.
//!
//! The iteration is on (T − θ)² = RᵀR, with R from a banded Householder QR of T − θ, for eight eigenvalues at a time,
//! one per vector lane: R alone is needed, never Q, and there is no pivoting for lanes to disagree about. Vectors of
//! close eigenvalues are orthogonalised among themselves. Nothing of this is trusted: residuals and orthogonality are
//! measured, and the caller has a dense solver to fall back on.

use super::band::Band;
use super::simd::{Simd, Vector, kernel, load, store};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Eigenvalues worked on at once.
pub const LANES: usize = 8;

/// Largest B: the widest block.
const MOST_DIAGONALS: usize = 32;

/// Rounds of inverse iteration before a vector is given up.
const ROUNDS: usize = 3;

type Lane = [f64; LANES];

/// Seed of the starting vectors.
const SEED: u64 = 0x51ab;

/// Eigenvalues closer than this share of the norm are orthogonalised one after the other.
const CLUSTER: f64 = 1e-9;

/// Accepted ‖T z − θ z‖ over ‖T‖, in units of the machine precision times √m.
const RESIDUAL: f64 = 16.0;

/// Accepted ‖ZᵀZ − I‖_F, well below what the answer as a whole is held to.
const ORTHOGONALITY: f64 = 1e-9;

/// Beyond this a first-order correction does not repair ‖ZᵀZ − I‖_F.
const REPAIRABLE: f64 = 1e-3;

impl<const B: usize> Band<B> {
    /// Unit eigenvectors for some of the eigenvalues, ascending: m × k, one per column. `None` where they are not
    /// eigenvectors or not orthogonal to working accuracy.
    pub fn eigenvectors(&self, theta: &[f64]) -> Option<Mat<f64>> {
        if !(self.norm > 0.0 && self.norm.is_finite()) {
            return None;
        }
        let simd = Simd::detect();
        let theta: Vec<f64> = theta.iter().map(|x| x / self.norm).collect();
        let accepted = RESIDUAL * f64::EPSILON * (self.m as f64).sqrt();
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut rows = vec![[0.0; LANES]; self.m * (3 * B + 1)];
        let mut x = vec![[0.0; LANES]; self.m];
        let mut z = Mat::<f64>::zeros(self.m, theta.len());
        for (group, chosen) in theta.chunks(LANES).enumerate() {
            // The last group is filled up with copies of its last eigenvalue.
            let lanes: Lane = std::array::from_fn(|l| chosen[l.min(chosen.len() - 1)]);
            for value in x.iter_mut().flatten() {
                *value = rng.random::<f64>() - 0.5;
            }
            triangularise::<LANES, B>(simd, self, &lanes, &mut rows);
            // A NaN is not accepted either.
            let good = (0..ROUNDS).any(|_| {
                let residual = iterate::<LANES, B>(simd, self, &lanes, &rows, &mut x);
                residual.iter().all(|r| *r <= accepted)
            });
            if !good {
                return None;
            }
            for l in 0..chosen.len() {
                for (slot, x) in z.col_mut(group * LANES + l).iter_mut().zip(&x) {
                    *slot = x[l];
                }
            }
        }
        separate(&mut z, &theta);
        orthonormal(z)
    }
}

kernel! {
    /// Banded Householder QR of T − θ, per lane: row i of the result has its columns i … i + 2B from place B on.
    fn triangularise<const L: usize, const B: usize>(band: &Band<B>, theta: &Lane, rows: &mut [Lane])
        => triangularise_body
}

#[inline(always)]
fn triangularise_body<V: Vector, const L: usize, const B: usize>(
    band: &Band<B>,
    theta: &Lane,
    rows: &mut [Lane],
) {
    let m = band.m;
    let width = 3 * B + 1;
    rows.fill([0.0; LANES]);
    for j in 0..m {
        for (k, &value) in band.column(j).iter().enumerate() {
            // Column c of row i stands in place c − i + B.
            rows[(j + k) * width + B - k] = [value; LANES];
            rows[j * width + B + k] = [value; LANES];
        }
        for (slot, t) in rows[j * width + B].iter_mut().zip(theta) {
            *slot -= t;
        }
    }
    let mut reflector = [V::splat(0.0); MOST_DIAGONALS + 1];
    for j in 0..m {
        let count = (B + 1).min(m - j);
        let window = &mut rows[j * width..(j + count) * width];
        let v = &mut reflector[..count];
        let mut sum = V::splat(0.0);
        for (k, v) in v.iter_mut().enumerate() {
            *v = load(&window[k * width + B - k]);
            sum = v.times_plus(*v, sum);
        }
        let mut squared = [0.0; LANES];
        store(&mut squared, sum);
        let mut first = window[B];
        let mut minus_tau = [0.0; LANES];
        for l in 0..LANES {
            let x = first[l];
            let alpha = -squared[l].sqrt().copysign(x);
            // vᵀv / 2; zero only for a column of zeros, which stays.
            let half = squared[l] - alpha * x;
            minus_tau[l] = if half > 0.0 { -1.0 / half } else { 0.0 };
            first[l] = x - alpha;
            // A pivot of zero stands for one of the size of rounding.
            window[B][l] = alpha.abs().max(f64::EPSILON).copysign(alpha);
        }
        v[0] = load(&first);
        let minus_tau: V = load(&minus_tau);
        for column in 1..(2 * B + 1).min(m - j) {
            let mut w = V::splat(0.0);
            for (k, v) in v.iter().enumerate() {
                w = v.times_plus(load(&window[k * width + B - k + column]), w);
            }
            w = w.times(minus_tau);
            for (k, v) in v.iter().enumerate() {
                let x = &mut window[k * width + B - k + column];
                let sum = v.times_plus(w, load(x));
                store(x, sum);
            }
        }
    }
}

kernel! {
    /// X ← (RᵀR)⁻¹ X with unit columns, per lane; returns ‖T x − θ x‖.
    fn iterate<const L: usize, const B: usize>(band: &Band<B>, theta: &Lane, rows: &[Lane], x: &mut [Lane]) -> Lane
        => iterate_body
}

#[inline(always)]
fn iterate_body<V: Vector, const L: usize, const B: usize>(
    band: &Band<B>,
    theta: &Lane,
    rows: &[Lane],
    x: &mut [Lane],
) -> Lane {
    let m = band.m;
    let width = 3 * B + 1;
    for i in 0..m {
        let r = &rows[i * width + B..(i + 1) * width];
        let value = load::<V, LANES>(&x[i]).over(load(&r[0]));
        store(&mut x[i], value);
        for (target, r) in x[i + 1..].iter_mut().zip(&r[1..]) {
            let sum = load::<V, LANES>(r).times_from(value, load(target));
            store(target, sum);
        }
    }
    unit_columns::<V>(x);
    for i in (0..m).rev() {
        let r = &rows[i * width + B..(i + 1) * width];
        let mut value: V = load(&x[i]);
        for (known, r) in x[i + 1..].iter().zip(&r[1..]).rev() {
            value = load::<V, LANES>(r).times_from(load(known), value);
        }
        store(&mut x[i], value.over(load(&r[0])));
    }
    unit_columns::<V>(x);
    let theta: V = load(theta);
    let mut squares = V::splat(0.0);
    for i in 0..m {
        let mut value = theta.times_from(load(&x[i]), V::splat(0.0));
        let first = i.saturating_sub(B);
        for (j, x) in (first..).zip(&x[first..(i + B + 1).min(m)]) {
            let t = band.values[i.min(j) * (B + 1) + i.abs_diff(j)];
            value = V::splat(t).times_plus(load(x), value);
        }
        squares = value.times_plus(value, squares);
    }
    let mut residual = [0.0; LANES];
    store(&mut residual, squares.root());
    residual
}

#[inline(always)]
fn unit_columns<V: Vector>(x: &mut [Lane]) {
    let mut squares = V::splat(0.0);
    for row in x.iter() {
        let row: V = load(row);
        squares = row.times_plus(row, squares);
    }
    let scale = V::splat(1.0).over(squares.root());
    for row in x.iter_mut() {
        let scaled = scale.times(load(row));
        store(row, scaled);
    }
}

/// Gram-Schmidt, twice, within runs of eigenvalues too close for inverse iteration to tell apart.
fn separate(z: &mut Mat<f64>, theta: &[f64]) {
    let mut first = 0;
    for k in 1..theta.len() {
        if theta[k] - theta[k - 1] > CLUSTER {
            first = k;
            continue;
        }
        let (done, rest) = z.as_mut().split_at_col_mut(k);
        let mut x = rest.col_mut(0);
        for _ in 0..2 {
            for y in (first..k).map(|j| done.as_ref().col(j)) {
                let h: f64 = x.as_ref().iter().zip(y.iter()).map(|(a, b)| a * b).sum();
                x.as_mut().iter_mut().zip(y.iter()).for_each(|(a, b)| *a -= h * b);
            }
            let norm = x.norm_l2();
            x.as_mut().iter_mut().for_each(|a| *a /= norm);
        }
    }
}

/// Z with what is left of ‖ZᵀZ − I‖ removed to first order; `None` if that is not enough.
fn orthonormal(mut z: Mat<f64>) -> Option<Mat<f64>> {
    let k = z.ncols();
    let mut defect = Mat::<f64>::zeros(k, k);
    for _ in 0..3 {
        for i in 0..k {
            for j in 0..k {
                defect[(i, j)] = if i == j { 1.0 } else { 0.0 };
            }
        }
        matmul(
            defect.as_mut(),
            Accum::Add,
            z.transpose(),
            z.as_ref(),
            -1.0,
            Par::Seq,
        );
        let size = defect.norm_l2();
        if size <= ORTHOGONALITY {
            return Some(z);
        }
        if size.is_nan() || size > REPAIRABLE {
            return None;
        }
        // Z (3 − ZᵀZ) / 2, one step of the iteration for the polar factor.
        let correction = &z * &defect;
        z += faer::Scale(0.5) * correction;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectral::dense::symmetric_eigen;

    /// A band with a spread of magnitudes, and with `copies` equal blocks side by side.
    fn example<const B: usize>(m: usize, copies: usize) -> Band<B> {
        let size = m / copies;
        Band::new(m, |i, j| {
            let (p, q) = (i % size, j % size);
            let same = i / size == j / size;
            let value = ((p * 31 + q * 17) as f64).sin() * (-(q as f64) * 4.0 / size as f64).exp();
            if same { value } else { 0.0 }
        })
    }

    fn agrees_with_dense<const B: usize>(m: usize, copies: usize) {
        let band = example::<B>(m, copies);
        let matrix = band.to_dense();
        let (expected, _) = symmetric_eigen(matrix.as_ref()).expect("dense");
        let theta = band.eigenvalues().expect("converges");
        assert!(
            theta
                .iter()
                .zip(&expected)
                .all(|(a, b)| (a - b).abs() < 1e-13 * band.norm),
            "B {B}, m {m}"
        );
        let chosen: Vec<f64> = theta
            .iter()
            .copied()
            .filter(|x| x.abs() > 1e-3 * band.norm)
            .collect();
        let z = band.eigenvectors(&chosen).expect("vectors");
        let residual = &matrix * &z - Mat::from_fn(m, chosen.len(), |i, k| z[(i, k)] * chosen[k]);
        assert!(
            residual.norm_max() < 1e-13 * band.norm,
            "B {B}, m {m}: {:e}",
            residual.norm_max()
        );
        let defect = z.transpose() * &z - Mat::<f64>::identity(chosen.len(), chosen.len());
        assert!(defect.norm_max() < 1e-9);
    }

    #[test]
    fn band_and_dense_solver_agree() {
        for m in [9, 64, 203] {
            agrees_with_dense::<4>(m, 1);
            agrees_with_dense::<8>(m, 1);
        }
        agrees_with_dense::<32>(150, 1);
        agrees_with_dense::<1>(40, 1);
    }

    #[test]
    fn equal_eigenvalues_get_orthogonal_vectors() {
        agrees_with_dense::<4>(120, 3);
        agrees_with_dense::<8>(200, 2);
    }

    #[test]
    fn a_matrix_that_is_not_finite_is_refused() {
        let band = Band::<4>::new(20, |i, _| if i == 7 { f64::NAN } else { 1.0 });
        assert!(band.eigenvectors(&[0.5]).is_none());
        assert!(Band::<4>::new(20, |_, _| 0.0).eigenvectors(&[0.0]).is_none());
    }
}
