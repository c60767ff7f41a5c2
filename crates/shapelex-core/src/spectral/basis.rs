//! The Krylov basis, and the products of every re-orthogonalisation.
//!
//! The basis is kept in panels of eight rows; within a panel the columns follow each other, eight numbers each. Both
//! products of a projection then stream contiguous memory once, for the vectors of two blocks together. Rows, columns and vectors meet in registers only: eight rows of the block, or of the result, against
//! one number of the basis. A general matrix product would copy the basis first.

use super::rows::{BLOCK, Rows};
use super::scratch::Scratch;
use super::simd::{Row, Simd, Vector, kernel, load, store};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// Rows per panel.
const WIDTH: usize = 8;

/// Panels whose rows make a block of the result.
const TOGETHER: usize = BLOCK / WIDTH;

/// A column of a panel.
type Eight = [f64; WIDTH];

/// n × m, in chunks of columns: a basis that outgrows its first room gets more beside it, and nothing is moved.
pub struct Basis {
    n: usize,
    most: usize,
    chunks: Vec<Chunk>,
}

struct Chunk {
    capacity: usize,
    /// Columns in use.
    columns: usize,
    /// Panel by panel; in each, capacity columns of WIDTH numbers. Rows beyond n are zero in the columns in use.
    values: Scratch,
}

impl Basis {
    /// Room for `most` columns of n, at first for `expected` of them.
    pub fn new(n: usize, expected: usize, most: usize) -> Self {
        Self {
            n,
            most,
            chunks: vec![Chunk::new(n, expected.min(most))],
        }
    }

    /// Columns in use.
    pub fn columns(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.columns).sum()
    }

    /// Whether `more` columns fit.
    pub fn has_room(&self, more: usize) -> bool {
        self.columns() + more <= self.most
    }

    /// Appends the B columns of a block.
    pub fn append<const B: usize>(&mut self, block: &[[f64; B]]) {
        // A block lies in one chunk.
        if self.last().columns + B > self.last().capacity {
            let more = (self.chunks[0].capacity / 16).min(self.most.saturating_sub(self.columns()));
            self.chunks
                .push(Chunk::new(self.n, more.next_multiple_of(B).max(B)));
        }
        self.last().columns += B;
        self.overwrite_last(block);
    }

    fn last(&mut self) -> &mut Chunk {
        let last = self.chunks.len() - 1;
        &mut self.chunks[last]
    }

    /// Replaces the last B columns.
    pub fn overwrite_last<const B: usize>(&mut self, block: &[[f64; B]]) {
        let chunk = self.last();
        let first = chunk.columns - B;
        let panels = chunk.values.chunks_exact_mut(chunk.capacity * WIDTH);
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

    /// P ← P − V (VᵀP) over the first `columns` columns; returns the largest |VᵀP|.
    pub fn project_out<const W: usize>(&self, simd: Simd, columns: usize, block: &mut [[f64; W]]) -> f64
    where
        [f64; W]: Row,
    {
        let mut h = vec![[0.0; W]; columns];
        let mut rest = &mut h[..];
        for chunk in &self.chunks {
            let part = rest
                .split_off_mut(..chunk.columns.min(rest.len()))
                .unwrap_or_default();
            inner_products::<W>(simd, chunk, block, part);
        }
        let mut rest = &h[..];
        for chunk in &self.chunks {
            let part = rest
                .split_off(..chunk.columns.min(rest.len()))
                .unwrap_or_default();
            subtract_products::<W>(simd, chunk, block, part);
        }
        h.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()))
    }

    /// V Y for all columns in use: n × k, k at most the first chunk's columns; row i is called `order[i]`. The result
    /// takes the place of the basis, as a second matrix of its size would be the peak of a solve's memory.
    pub fn times(mut self, y: MatRef<'_, f64>, order: &[usize]) -> Rows {
        let (columns, k) = (self.columns(), y.ncols());
        let mut first = self.chunks.remove(0);
        // Column-major for the product.
        let mut v = Scratch::new(BLOCK * columns);
        for g in 0..self.n.div_ceil(BLOCK) {
            let mut to = v.chunks_exact_mut(BLOCK);
            for chunk in std::iter::once(&first).chain(&self.chunks) {
                let stride = TOGETHER * WIDTH * chunk.capacity;
                let part = &chunk.values[g * stride..chunk.values.len().min((g + 1) * stride)];
                gather(part, chunk.capacity, chunk.columns, &mut to);
            }
            let rows = BLOCK.min(self.n - g * BLOCK);
            // Behind what is already done, and before what is still to be read.
            let to = &mut first.values[g * BLOCK * k..][..rows * k];
            matmul(
                MatMut::from_row_major_slice_mut(to, rows, k),
                Accum::Replace,
                MatRef::from_column_major_slice_with_stride(&v, rows, columns, BLOCK),
                y,
                1.0,
                Par::Seq,
            );
        }
        first.values.shrink_to(self.n * k);
        Rows::new(first.values, k, order)
    }
}

/// Puts the columns in use of some panels in column-major order, each to the next place of `to`.
fn gather<'a>(panels: &[f64], capacity: usize, columns: usize, to: &mut impl Iterator<Item = &'a mut [f64]>) {
    for (c, to) in to.take(columns).enumerate() {
        for (panel, to) in panels
            .chunks_exact(capacity * WIDTH)
            .zip(to.as_chunks_mut::<WIDTH>().0)
        {
            *to = panel.as_chunks().0[c];
        }
    }
}

impl Chunk {
    fn new(n: usize, capacity: usize) -> Self {
        Self {
            capacity,
            columns: 0,
            values: Scratch::new(n.div_ceil(WIDTH) * capacity * WIDTH),
        }
    }

    /// The panels, one row of WIDTH numbers per column.
    fn panels(&self) -> impl Iterator<Item = &[Eight]> {
        self.values.as_chunks::<WIDTH>().0.chunks_exact(self.capacity)
    }
}

kernel! {
    /// H ← H + VᵀP.
    fn inner_products<const W: usize>(basis: &Chunk, block: &[[f64; W]], h: &mut [[f64; W]]) => inner_products_body
}

kernel! {
    /// P ← P − V H.
    fn subtract_products<const W: usize>(basis: &Chunk, block: &mut [[f64; W]], h: &[[f64; W]]) => subtract_products_body
}

#[inline(always)]
fn inner_products_body<V: Vector, const W: usize>(basis: &Chunk, block: &[[f64; W]], h: &mut [[f64; W]]) {
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
fn subtract_products_body<V: Vector, const W: usize>(basis: &Chunk, block: &mut [[f64; W]], h: &[[f64; W]]) {
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
            assert!((0..n).all(|i| (0..3).all(|j| x.row(order[i])[j] == cosine(i, 4 * j))));
        }
    }
}
