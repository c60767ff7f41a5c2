//! The Krylov basis, and the products of every re-orthogonalisation.
//!
//! The basis is kept in panels of eight rows; within a panel the columns follow each other, eight numbers each. Both
//! products of a projection then stream contiguous memory once, for the vectors of two blocks together. Rows, columns and vectors meet in registers only: eight rows of the block, or of the result, against
//! one number of the basis. A general matrix product would copy the basis first.

use super::scratch::Scratch;
use super::simd::{Row, Simd, Vector, kernel, load, store};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// Rows per panel.
const WIDTH: usize = 8;

/// Panels put in column-major order together for the product with a general matrix.
const TOGETHER: usize = 24;

/// A column of a panel.
type Eight = [f64; WIDTH];

/// n × capacity, of which the first `columns` columns are in use.
pub struct Basis {
    n: usize,
    capacity: usize,
    most: usize,
    columns: usize,
    /// Panel by panel; in each, capacity columns of WIDTH numbers. Rows beyond n are zero in the columns in use.
    values: Scratch,
}

impl Basis {
    /// Room for `most` columns of n, at first for `expected` of them.
    pub fn new(n: usize, expected: usize, most: usize) -> Self {
        let capacity = expected.min(most);
        Self {
            n,
            capacity,
            most,
            columns: 0,
            values: Scratch::new(n.div_ceil(WIDTH) * capacity * WIDTH),
        }
    }

    /// Columns in use.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Whether `more` columns fit.
    pub fn has_room(&self, more: usize) -> bool {
        self.columns + more <= self.most
    }

    /// Appends the B columns of a block.
    pub fn append<const B: usize>(&mut self, block: &[[f64; B]]) {
        if self.columns + B > self.capacity {
            self.grow(B);
        }
        self.columns += B;
        self.overwrite_last(block);
    }

    /// Room for at least `more` columns, up to a quarter of what there is.
    fn grow(&mut self, more: usize) {
        let capacity = (self.capacity + self.capacity / 4)
            .min(self.most)
            .max(self.columns + more);
        let mut values = Scratch::new(self.n.div_ceil(WIDTH) * capacity * WIDTH);
        let used = self.columns * WIDTH;
        for (new, old) in values.chunks_exact_mut(capacity * WIDTH).zip(self.panels()) {
            new[..used].copy_from_slice(&old.as_flattened()[..used]);
        }
        self.values = values;
        self.capacity = capacity;
    }

    /// Replaces the last B columns.
    pub fn overwrite_last<const B: usize>(&mut self, block: &[[f64; B]]) {
        let first = self.columns - B;
        let panels = self.values.chunks_exact_mut(self.capacity * WIDTH);
        for (panel, rows) in panels.zip(block.chunks(WIDTH)) {
            for (k, column) in panel.as_chunks_mut::<WIDTH>().0[first..first + B]
                .iter_mut()
                .enumerate()
            {
                for (r, slot) in column.iter_mut().enumerate() {
                    *slot = rows.get(r).map_or(0.0, |row| row[k]);
                }
            }
        }
    }

    /// The panels, one row of WIDTH numbers per column.
    fn panels(&self) -> impl Iterator<Item = &[Eight]> {
        self.values.as_chunks::<WIDTH>().0.chunks_exact(self.capacity)
    }

    /// P ← P − V (VᵀP) over the first `columns` columns; returns the largest |VᵀP|.
    pub fn project_out<const W: usize>(&self, simd: Simd, columns: usize, block: &mut [[f64; W]]) -> f64
    where
        [f64; W]: Row,
    {
        let mut h = vec![[0.0; W]; columns];
        inner_products::<W>(simd, self, block, &mut h);
        subtract_products::<W>(simd, self, block, &h);
        h.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()))
    }

    /// V Y for all columns in use: n × k, row by row; row i goes to place `order[i]`.
    pub fn times(&self, y: MatRef<'_, f64>, order: &[usize]) -> Scratch {
        const ROWS: usize = TOGETHER * WIDTH;
        let k = y.ncols();
        let mut x = Scratch::new(self.n * k);
        // Column-major for the product, and its result before its rows are put in their places.
        let mut v = Scratch::new(ROWS * self.columns);
        let mut product = Scratch::new(ROWS * k);
        let mut panels = self.panels();
        for places in order.chunks(ROWS) {
            for (p, panel) in panels.by_ref().take(TOGETHER).enumerate() {
                for (column, to) in panel[..self.columns].iter().zip(v.chunks_exact_mut(ROWS)) {
                    to[p * WIDTH..(p + 1) * WIDTH].copy_from_slice(column);
                }
            }
            matmul(
                MatMut::from_row_major_slice_mut(&mut product, ROWS, k),
                Accum::Replace,
                MatRef::from_column_major_slice(&v, ROWS, self.columns),
                y,
                1.0,
                Par::Seq,
            );
            for (row, &place) in product.chunks_exact(k).zip(places) {
                x[place * k..(place + 1) * k].copy_from_slice(row);
            }
        }
        x
    }
}

kernel! {
    /// H ← H + VᵀP.
    fn inner_products<const W: usize>(basis: &Basis, block: &[[f64; W]], h: &mut [[f64; W]]) => inner_products_body
}

kernel! {
    /// P ← P − V H.
    fn subtract_products<const W: usize>(basis: &Basis, block: &mut [[f64; W]], h: &[[f64; W]]) => subtract_products_body
}

#[inline(always)]
fn inner_products_body<V: Vector, const W: usize>(basis: &Basis, block: &[[f64; W]], h: &mut [[f64; W]]) {
    for (panel, rows) in basis.panels().zip(block.chunks(WIDTH)) {
        let mut p = [V::splat(0.0); WIDTH];
        for (p, row) in p.iter_mut().zip(rows) {
            *p = load(row);
        }
        for (column, h) in panel.iter().zip(h.iter_mut()) {
            let mut sums = [load(h), V::splat(0.0)];
            for r in 0..WIDTH {
                sums[r % 2] = V::splat(column[r]).times_plus(p[r], sums[r % 2]);
            }
            store(h, sums[0].plus(sums[1]));
        }
    }
}

#[inline(always)]
fn subtract_products_body<V: Vector, const W: usize>(basis: &Basis, block: &mut [[f64; W]], h: &[[f64; W]]) {
    for (panel, rows) in basis.panels().zip(block.chunks_mut(WIDTH)) {
        let mut p = [V::splat(0.0); WIDTH];
        for (p, row) in p.iter_mut().zip(rows.iter()) {
            *p = load(row);
        }
        for (column, h) in panel.iter().zip(h) {
            let h: V = load(h);
            for r in 0..WIDTH {
                p[r] = V::splat(column[r]).times_from(h, p[r]);
            }
        }
        for (p, row) in p.into_iter().zip(rows) {
            store(row, p);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_projection_leaves_nothing_along_the_basis() {
        // Orthonormal columns: scaled cosines.
        let n = 701;
        let cosine = |i: usize, k: usize| {
            let frequency = (k + 1) as f64 * std::f64::consts::PI / n as f64;
            (2.0 / n as f64).sqrt() * (frequency * (i as f64 + 0.5)).cos()
        };
        for simd in [Simd::detect(), Simd::Baseline] {
            let mut basis = Basis::new(n, 5, 12);
            for group in 0..3 {
                let block: Vec<[f64; 4]> = (0..n)
                    .map(|i| std::array::from_fn(|k| cosine(i, 4 * group + k)))
                    .collect();
                basis.append::<4>(&block);
            }
            assert!(!basis.has_room(1));
            let mut p: Vec<Eight> = (0..n)
                .map(|i| std::array::from_fn(|k| ((i * i + 7 * k) as f64).sin()))
                .collect();
            assert!(basis.project_out(simd, 12, &mut p) > 1e-2);
            assert!(basis.project_out(simd, 12, &mut p) < 1e-13);
            assert!(basis.project_out(simd, 11, &mut p) < 1e-13);
            let y = faer::Mat::from_fn(12, 3, |i, j| if i == 4 * j { 1.0 } else { 0.0 });
            let order: Vec<usize> = (0..n).map(|i| n - 1 - i).collect();
            let x = basis.times(y.as_ref(), &order);
            assert!((0..n).all(|i| (0..3).all(|j| x[order[i] * 3 + j] == cosine(i, 4 * j))));
        }
    }
}
