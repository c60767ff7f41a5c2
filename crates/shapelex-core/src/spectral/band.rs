//! A symmetric band matrix and its eigenvalues: the projected problem of the block recurrence.
//!
//! A dense solver spends most of its time on what the band makes unnecessary. Eigenvalues come from a reduction to
//! tridiagonal form by plane rotations that keep the band (Schwarz 1968) and the root-free QL iteration (Pal, Walker
//! and Kahan 1969), O(m² B) in all; eigenvectors from [`inverse_iteration`](super::inverse_iteration).

use faer::Mat;

/// A symmetric m × m matrix with B diagonals below the main one.
pub struct Band<const B: usize> {
    pub m: usize,
    /// Largest sum of magnitudes in a row: the unit of `values`.
    pub norm: f64,
    /// Column by column, B + 1 numbers each from the diagonal down, over `norm`; zeros beyond the last row.
    pub values: Vec<f64>,
}

impl<const B: usize> Band<B> {
    /// From its lower entries, `entry(i, j)` for j ≤ i ≤ j + B.
    pub fn new(m: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let mut values = vec![0.0; m * (B + 1)];
        let mut sums = vec![0.0; m];
        for j in 0..m {
            for i in j..m.min(j + B + 1) {
                let value = entry(i, j);
                values[j * (B + 1) + i - j] = value;
                sums[i] += value.abs();
                if i > j {
                    sums[j] += value.abs();
                }
            }
        }
        let norm = sums.into_iter().fold(0.0, f64::max);
        for x in &mut values {
            *x /= norm;
        }
        Self { m, norm, values }
    }

    /// The lower entries of column j, from the diagonal down.
    pub fn column(&self, j: usize) -> &[f64] {
        &self.values[j * (B + 1)..][..(B + 1).min(self.m - j)]
    }

    /// The matrix in full.
    pub fn to_dense(&self) -> Mat<f64> {
        Mat::from_fn(self.m, self.m, |i, j| match i.abs_diff(j) {
            k if k <= B => self.norm * self.values[i.min(j) * (B + 1) + k],
            _ => 0.0,
        })
    }

    /// All eigenvalues, ascending, to the machine precision times the norm; `None` if the iteration does not end.
    pub fn eigenvalues(&self) -> Option<Vec<f64>> {
        let (mut diagonal, mut squares) = self.tridiagonal();
        root_free_ql(&mut diagonal, &mut squares)?;
        for x in &mut diagonal {
            *x *= self.norm;
        }
        diagonal.sort_by(f64::total_cmp);
        Some(diagonal)
    }

    /// Diagonal and squared off-diagonal of a tridiagonal matrix with the same eigenvalues.
    fn tridiagonal(&self) -> (Vec<f64>, Vec<f64>) {
        let m = self.m;
        // One more diagonal for the entry that a rotation pushes out of the band.
        let width = B + 2;
        let mut a = vec![0.0; m * width];
        for j in 0..m {
            let column = self.column(j);
            a[j * width..][..column.len()].copy_from_slice(column);
        }
        for column in 0..m.saturating_sub(2) {
            for k in (2..=B.min(m - 1 - column)).rev() {
                // Remove entry (column + k, column), then follow what comes out of the band until it leaves below.
                let (mut j, mut i) = (column, column + k);
                while i < m {
                    let at = j * width + i - j;
                    let (x, y) = (a[at - 1], a[at]);
                    if y == 0.0 {
                        break;
                    }
                    let inverse = 1.0 / (x * x + y * y).sqrt();
                    let (c, s) = (x * inverse, y * inverse);
                    a[at - 1] = c * x + s * y;
                    a[at] = 0.0;
                    rotate::<B>(&mut a, m, j + 1, i, c, s);
                    // Rows i − 1 and i share what stood in (i + B, i) alone.
                    j = i - 1;
                    i += B;
                }
            }
        }
        let diagonal = (0..m).map(|j| a[j * width]).collect();
        let below = (0..m.saturating_sub(1)).map(|j| a[j * width + 1]);
        (diagonal, below.map(|x| x * x).collect())
    }
}

/// Rotates rows and columns i − 1 and i of a lower band with B + 1 diagonals below the main one, from column `first`.
#[inline(always)]
fn rotate<const B: usize>(a: &mut [f64], m: usize, first: usize, i: usize, c: f64, s: f64) {
    let width = B + 2;
    let p = i - 1;
    for k in first..p {
        let at = k * width + p - k;
        let (x, y) = (a[at], a[at + 1]);
        a[at] = c * x + s * y;
        a[at + 1] = c * y - s * x;
    }
    let (left, right) = a[p * width..].split_at_mut(width);
    let (x, y, z) = (left[0], left[1], right[0]);
    left[0] = c * c * x + 2.0 * c * s * y + s * s * z;
    right[0] = s * s * x - 2.0 * c * s * y + c * c * z;
    left[1] = c * s * (z - x) + (c * c - s * s) * y;
    for r in 1..(B + 1).min(m - i) {
        let (x, y) = (left[r + 1], right[r]);
        left[r + 1] = c * x + s * y;
        right[r] = c * y - s * x;
    }
}

/// Eigenvalues of a tridiagonal matrix of norm about 1 into `d`, its diagonal; `e` holds the squares of the entries
/// beside it.
fn root_free_ql(d: &mut [f64], e: &mut [f64]) -> Option<()> {
    let negligible = 0.25 * f64::EPSILON * f64::EPSILON;
    for l in 0..d.len() {
        for round in 0.. {
            let last = (l..e.len()).find(|&i| e[i] <= negligible).unwrap_or(e.len());
            if last == l {
                break;
            }
            if round == 60 {
                return None;
            }
            let root = e[l].sqrt();
            let ratio = (d[l + 1] - d[l]) / (2.0 * root);
            let shift = d[l] - root / (ratio + ratio.hypot(1.0).copysign(ratio));
            let (mut c, mut s) = (1.0, 0.0);
            let mut gamma = d[last] - shift;
            let mut p = gamma * gamma;
            for i in (l..last).rev() {
                let square = e[i];
                let r = p + square;
                if i + 1 < last {
                    e[i + 1] = s * r;
                }
                let before = c;
                c = p / r;
                s = square / r;
                let old = gamma;
                gamma = c * (d[i] - shift) - s * old;
                d[i + 1] = old + (d[i] - gamma);
                p = if c == 0.0 {
                    before * square
                } else {
                    gamma * gamma / c
                };
            }
            e[l] = s * p;
            d[l] = shift + gamma;
        }
    }
    Some(())
}
