//! The Krylov basis, and the products of every re-orthogonalisation.
//!
//! The basis is kept in slabs of a few hundred rows; within a slab the columns follow each other. Both products of a
//! projection then stream contiguous memory while the slab of the block they work on stays in the first-level cache.
//! They are limited by reading the basis, so they are our own: a general matrix product would copy it first.
//! Blocks of vectors come as n rows of G groups of B numbers, so that two blocks can share one pass.

use super::simd::{Simd, dispatch, fused};
use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

/// Columns taken together, so that a row of the block is loaded once for all of them.
const COLUMNS: usize = 8;

/// Rows per slab.
const ROWS: usize = 256;

/// n × capacity, of which the first `columns` columns are in use.
pub struct Basis {
    n: usize,
    capacity: usize,
    columns: usize,
    /// Slab by slab; in each, capacity columns of ROWS numbers. Rows beyond n are zero.
    values: Vec<f64>,
}

impl Basis {
    /// Room for `capacity` columns of n; memory is touched only as columns are added.
    pub fn new(n: usize, capacity: usize) -> Self {
        Self {
            n,
            capacity,
            columns: 0,
            values: vec![0.0; n.div_ceil(ROWS) * ROWS * capacity],
        }
    }

    /// Columns in use.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Whether `more` columns fit.
    pub fn has_room(&self, more: usize) -> bool {
        self.columns + more <= self.capacity
    }

    /// Appends the B columns of a block.
    pub fn append<const B: usize>(&mut self, block: &[[f64; B]]) {
        self.columns += B;
        self.overwrite_last(block);
    }

    /// Replaces the last B columns.
    pub fn overwrite_last<const B: usize>(&mut self, block: &[[f64; B]]) {
        let first = (self.columns - B) * ROWS;
        let slabs = self.values.chunks_exact_mut(ROWS * self.capacity);
        for (slab, rows) in slabs.zip(block.chunks(ROWS)) {
            for (k, column) in slab[first..first + B * ROWS].chunks_exact_mut(ROWS).enumerate() {
                for (slot, row) in column.iter_mut().zip(rows) {
                    *slot = row[k];
                }
            }
        }
    }

    /// P ← P − V (VᵀP) over the first `columns` columns; returns the largest |VᵀP|.
    pub fn project_out<const B: usize, const G: usize>(
        &self,
        simd: Simd,
        columns: usize,
        block: &mut [[[f64; B]; G]],
    ) -> f64 {
        let mut h = vec![[[0.0; B]; G]; columns];
        let slab_size = ROWS * self.capacity;
        for (slab, rows) in self.values.chunks_exact(slab_size).zip(block.chunks(ROWS)) {
            inner_products::<B, G>(simd, slab, rows, &mut h);
        }
        for (slab, rows) in self.values.chunks_exact(slab_size).zip(block.chunks_mut(ROWS)) {
            subtract_products::<B, G>(simd, slab, rows, &h);
        }
        h.iter().flatten().flatten().fold(0.0f64, |m, x| m.max(x.abs()))
    }

    /// V Y for all columns in use: n × k, row by row.
    pub fn times(&self, y: MatRef<'_, f64>) -> Vec<f64> {
        let k = y.ncols();
        let mut x = vec![0.0; self.n * k];
        for (slab, rows) in self
            .values
            .chunks_exact(ROWS * self.capacity)
            .zip(x.chunks_mut(ROWS * k))
        {
            let count = rows.len() / k;
            let v = MatRef::from_column_major_slice(&slab[..ROWS * self.columns], ROWS, self.columns);
            let x = MatMut::from_row_major_slice_mut(rows, count, k);
            matmul(x, Accum::Replace, v.subrows(0, count), y, 1.0, Par::Seq);
        }
        x
    }
}

dispatch! {
    /// H ← H + VᵀP over one slab.
    fn inner_products<const B: usize, const G: usize>(
        slab: &[f64], rows: &[[[f64; B]; G]], h: &mut [[[f64; B]; G]],
    ) => inner_products_body
}

dispatch! {
    /// P ← P − V H over one slab.
    fn subtract_products<const B: usize, const G: usize>(
        slab: &[f64], rows: &mut [[[f64; B]; G]], h: &[[[f64; B]; G]],
    ) => subtract_products_body
}

#[inline(always)]
fn inner_products_body<const FMA: bool, const B: usize, const G: usize>(
    slab: &[f64],
    rows: &[[[f64; B]; G]],
    h: &mut [[[f64; B]; G]],
) {
    let mut groups = h.chunks_exact_mut(COLUMNS);
    let mut columns = slab.chunks_exact(ROWS);
    for group in &mut groups {
        let at: [&[f64]; COLUMNS] =
            std::array::from_fn(|_| &columns.next().unwrap_or_default()[..rows.len()]);
        let mut acc: [[[f64; B]; G]; COLUMNS] = std::array::from_fn(|c| group[c]);
        for (i, p) in rows.iter().enumerate() {
            for c in 0..COLUMNS {
                for g in 0..G {
                    for r in 0..B {
                        acc[c][g][r] = fused::<FMA>(at[c][i], p[g][r], acc[c][g][r]);
                    }
                }
            }
        }
        group.copy_from_slice(&acc);
    }
    for (one, at) in groups.into_remainder().iter_mut().zip(columns) {
        let mut acc = *one;
        for (x, p) in at.iter().zip(rows) {
            for g in 0..G {
                for r in 0..B {
                    acc[g][r] = fused::<FMA>(*x, p[g][r], acc[g][r]);
                }
            }
        }
        *one = acc;
    }
}

#[inline(always)]
fn subtract_products_body<const FMA: bool, const B: usize, const G: usize>(
    slab: &[f64],
    rows: &mut [[[f64; B]; G]],
    h: &[[[f64; B]; G]],
) {
    let groups = h.chunks_exact(COLUMNS);
    let rest = groups.remainder();
    let mut columns = slab.chunks_exact(ROWS);
    for group in groups {
        let at: [&[f64]; COLUMNS] =
            std::array::from_fn(|_| &columns.next().unwrap_or_default()[..rows.len()]);
        let negative: [[[f64; B]; G]; COLUMNS] = std::array::from_fn(|c| group[c].map(|g| g.map(|x| -x)));
        for (i, p) in rows.iter_mut().enumerate() {
            let mut acc = *p;
            for c in 0..COLUMNS {
                for g in 0..G {
                    for r in 0..B {
                        acc[g][r] = fused::<FMA>(at[c][i], negative[c][g][r], acc[g][r]);
                    }
                }
            }
            *p = acc;
        }
    }
    for (one, at) in rest.iter().zip(columns) {
        for (x, p) in at.iter().zip(rows.iter_mut()) {
            for g in 0..G {
                for r in 0..B {
                    p[g][r] = fused::<FMA>(-x, one[g][r], p[g][r]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_projection_leaves_nothing_along_the_basis() {
        // Orthonormal columns: scaled cosines.
        let n = 700;
        let cosine = |i: usize, k: usize| {
            let frequency = (k + 1) as f64 * std::f64::consts::PI / n as f64;
            (2.0 / n as f64).sqrt() * (frequency * (i as f64 + 0.5)).cos()
        };
        for simd in [Simd::detect(), Simd::Baseline] {
            let mut basis = Basis::new(n, 12);
            for group in 0..3 {
                let block: Vec<[f64; 4]> = (0..n)
                    .map(|i| std::array::from_fn(|k| cosine(i, 4 * group + k)))
                    .collect();
                basis.append::<4>(&block);
            }
            assert!(!basis.has_room(1));
            let mut p: Vec<[[f64; 4]; 2]> = (0..n)
                .map(|i| {
                    std::array::from_fn(|g| std::array::from_fn(|k| ((i * i + 7 * k + 3 * g) as f64).sin()))
                })
                .collect();
            assert!(basis.project_out::<4, 2>(simd, 12, &mut p) > 1e-2);
            assert!(basis.project_out::<4, 2>(simd, 12, &mut p) < 1e-13);
            // Columns that do not fill a group.
            assert!(basis.project_out::<4, 2>(simd, 11, &mut p) < 1e-13);
            let y = faer::Mat::from_fn(12, 3, |i, j| if i == 4 * j { 1.0 } else { 0.0 });
            let x = basis.times(y.as_ref());
            assert!((0..n).all(|i| (0..3).all(|j| x[i * 3 + j] == cosine(i, 4 * j))));
        }
    }
}
