//! Orthonormalisation of a block of B columns, and the small products the block recurrence needs.
//!
//! Blocks are stored as n rows of B numbers. The QR factorisation is Cholesky-QR done twice (Yamamoto et al. 2015):
//! two sweeps over the block, all in the inner loop's registers. A block that is close to rank-deficient is reported
//! as such and goes to the caller's column-by-column fallback.

use super::simd::{Row, Simd, Vector, kernel, load, store};

/// B × B, row by row.
pub type Small<const B: usize> = [[f64; B]; B];

/// Smallest pivot of the unit-diagonal Gram matrix that Cholesky-QR is trusted with: condition about 1e5.
const SMALLEST_PIVOT: f64 = 1e-10;

kernel! {
    /// XᵀY of two n × B blocks.
    pub fn inner<const B: usize>(x: &[[f64; B]], y: &[[f64; B]]) -> Small<B> => inner_body
}

kernel! {
    /// W ← W + X H.
    pub fn add_product<const B: usize>(w: &mut [[f64; B]], x: &[[f64; B]], h: &Small<B>) => add_product_body
}

kernel! {
    /// W ← W H.
    fn multiply<const B: usize>(w: &mut [[f64; B]], h: &Small<B>) => multiply_body
}

kernel! {
    /// W ← W H; returns WᵀW of the new W.
    fn multiply_for_gram<const B: usize>(w: &mut [[f64; B]], h: &Small<B>) -> Small<B> => multiply_for_gram_body
}

#[inline(always)]
fn inner_body<V: Vector, const B: usize>(x: &[[f64; B]], y: &[[f64; B]]) -> Small<B> {
    // Four rows of the product at a time, so that the sums stay in registers, and two sums for each.
    const GROUP: usize = 4;
    let mut out = [[0.0; B]; B];
    for first in (0..B).step_by(GROUP) {
        let mut sums = [[V::splat(0.0); GROUP]; 2];
        for (a, b) in x.chunks(2).zip(y.chunks(2)) {
            for ((a, b), sums) in a.iter().zip(b).zip(&mut sums) {
                let b: V = load(b);
                for (sum, a) in sums.iter_mut().zip(&a[first..]) {
                    *sum = V::splat(*a).times_plus(b, *sum);
                }
            }
        }
        for k in 0..GROUP {
            store(&mut out[first + k], sums[0][k].plus(sums[1][k]));
        }
    }
    out
}

#[inline(always)]
fn add_product_body<V: Vector, const B: usize>(w: &mut [[f64; B]], x: &[[f64; B]], h: &Small<B>) {
    for (w, x) in w.iter_mut().zip(x) {
        let mut sum: V = load(w);
        for (x, h) in x.iter().zip(h) {
            sum = V::splat(*x).times_plus(load(h), sum);
        }
        store(w, sum);
    }
}

#[inline(always)]
fn multiply_body<V: Vector, const B: usize>(w: &mut [[f64; B]], h: &Small<B>) {
    for w in w.iter_mut() {
        let mut sum = V::splat(0.0);
        for (x, h) in w.iter().zip(h) {
            sum = V::splat(*x).times_plus(load(h), sum);
        }
        store(w, sum);
    }
}

#[inline(always)]
fn multiply_for_gram_body<V: Vector, const B: usize>(w: &mut [[f64; B]], h: &Small<B>) -> Small<B> {
    let mut gram = [V::splat(0.0); B];
    for w in w.iter_mut() {
        let mut row = V::splat(0.0);
        for (x, h) in w.iter().zip(h) {
            row = V::splat(*x).times_plus(load(h), row);
        }
        store(w, row);
        for (sum, x) in gram.iter_mut().zip(w.iter()) {
            *sum = V::splat(*x).times_plus(row, *sum);
        }
    }
    let mut out = [[0.0; B]; B];
    for (row, sum) in out.iter_mut().zip(gram) {
        store(row, sum);
    }
    out
}

/// −H.
pub fn negated<const B: usize>(h: &Small<B>) -> Small<B> {
    h.map(|row| row.map(|x| -x))
}

/// Hᵀ.
pub fn transposed<const B: usize>(h: &Small<B>) -> Small<B> {
    std::array::from_fn(|i| std::array::from_fn(|j| h[j][i]))
}

/// X Y.
pub fn product<const B: usize>(x: &Small<B>, y: &Small<B>) -> Small<B> {
    let mut out = [[0.0; B]; B];
    for i in 0..B {
        for k in 0..B {
            for j in 0..B {
                out[i][j] += x[i][k] * y[k][j];
            }
        }
    }
    out
}

/// R⁻¹ of an upper triangular R.
pub fn upper_inverse<const B: usize>(r: &Small<B>) -> Small<B> {
    let mut inverse = [[0.0; B]; B];
    for j in 0..B {
        inverse[j][j] = 1.0 / r[j][j];
        for i in (0..j).rev() {
            let sum: f64 = (i + 1..=j).map(|k| r[i][k] * inverse[k][j]).sum();
            inverse[i][j] = -sum / r[i][i];
        }
    }
    inverse
}

/// W = Q R in place, R upper triangular. `None`, with W unchanged in span but not orthonormal, when a column is all
/// but a combination of the others or smaller than `negligible`.
pub fn cholesky_qr<const B: usize>(simd: Simd, w: &mut [[f64; B]], negligible: f64) -> Option<Small<B>>
where
    [f64; B]: Row,
{
    let gram = inner::<B>(simd, w, w);
    cholesky_qr_from(simd, w, &gram, negligible)
}

/// As [`cholesky_qr`] where the Gram matrix WᵀW is known.
pub fn cholesky_qr_from<const B: usize>(
    simd: Simd,
    w: &mut [[f64; B]],
    gram: &Small<B>,
    negligible: f64,
) -> Option<Small<B>>
where
    [f64; B]: Row,
{
    let first = cholesky(gram, negligible)?;
    let gram = multiply_for_gram::<B>(simd, w, &upper_inverse(&first));
    let second = cholesky(&gram, 0.0)?;
    multiply::<B>(simd, w, &upper_inverse(&second));
    Some(product(&second, &first))
}

/// The upper triangular R with RᵀR = `gram`; `None` where that is not safely of full rank.
fn cholesky<const B: usize>(gram: &Small<B>, negligible: f64) -> Option<Small<B>> {
    let norm: [f64; B] = std::array::from_fn(|i| gram[i][i].sqrt());
    // A NaN must fail too, hence the negated comparison.
    if norm.iter().any(|x| !(*x > negligible && x.is_finite())) {
        return None;
    }
    // R of the Gram matrix scaled to a unit diagonal, columns scaled back at the end.
    let mut r = [[0.0; B]; B];
    for i in 0..B {
        for j in i..B {
            let sum: f64 = (0..i).map(|k| r[k][i] * r[k][j]).sum();
            let value = gram[i][j] / (norm[i] * norm[j]) - sum;
            if i == j {
                if value < SMALLEST_PIVOT {
                    return None;
                }
                r[i][i] = value.sqrt();
            } else {
                r[i][j] = value / r[i][i];
            }
        }
    }
    for row in &mut r {
        for (x, n) in row.iter_mut().zip(&norm) {
            *x *= n;
        }
    }
    Some(r)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block() -> Vec<[f64; 4]> {
        (0..50)
            .map(|i| std::array::from_fn(|k| ((i * (k + 3)) as f64 * 0.7 + k as f64).sin()))
            .collect()
    }

    #[test]
    fn q_is_orthonormal_and_qr_is_w() {
        for simd in [Simd::detect(), Simd::Baseline] {
            let original = block();
            let mut q = original.clone();
            let r = cholesky_qr::<4>(simd, &mut q, 0.0).expect("full rank");
            let gram = inner::<4>(simd, &q, &q);
            let mut back = vec![[0.0; 4]; 50];
            add_product::<4>(simd, &mut back, &q, &r);
            for i in 0..4 {
                for j in 0..4 {
                    assert!((gram[i][j] - f64::from(u8::from(i == j))).abs() < 1e-14);
                    assert!(j >= i || r[i][j] == 0.0);
                }
            }
            assert!(
                back.iter()
                    .flatten()
                    .zip(original.iter().flatten())
                    .all(|(a, b)| (a - b).abs() < 1e-13)
            );
        }
    }

    #[test]
    fn dependent_columns_are_reported() {
        let mut w = block();
        for row in &mut w {
            row[3] = row[0] - 2.0 * row[1];
        }
        assert!(cholesky_qr::<4>(Simd::detect(), &mut w, 0.0).is_none());
        let mut zero = vec![[0.0; 4]; 9];
        assert!(cholesky_qr::<4>(Simd::detect(), &mut zero, 0.0).is_none());
    }
}
