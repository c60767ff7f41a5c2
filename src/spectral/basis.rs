//! The Krylov basis, and the two products of every re-orthogonalisation.
//!
//! The basis is n × capacity, column by column; blocks of vectors come as n rows of G
//! groups of B numbers, so that two blocks can share one pass. Both products stream
//! the basis once and are limited by that, so they are our own: a general matrix product would copy the basis first.

use super::simd::{Simd, dispatch, fused};
use faer::MatRef;

/// Columns taken together, so that a row of the block is loaded once for all of them.
const COLUMNS: usize = 8;

/// Numbers of a block per slab of rows: half of a first-level cache.
const SLAB: usize = 2048;

/// n × capacity, column-major, of which the first `columns` columns are in use.
pub struct Basis {
    n: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Basis {
    /// Room for `capacity` columns of n; memory is touched only as columns are added.
    pub fn new(n: usize, capacity: usize) -> Self {
        Self {
            n,
            columns: 0,
            values: Vec::with_capacity(n * capacity),
        }
    }

    /// Columns in use.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Whether `more` columns fit without growing.
    pub fn has_room(&self, more: usize) -> bool {
        (self.columns + more) * self.n <= self.values.capacity()
    }

    /// Appends the B columns of a block.
    pub fn append<const B: usize>(&mut self, block: &[[f64; B]]) {
        let end = self.values.len();
        self.values.resize(end + B * self.n, 0.0);
        self.columns += B;
        self.overwrite_last(block);
    }

    /// Replaces the last B columns.
    pub fn overwrite_last<const B: usize>(&mut self, block: &[[f64; B]]) {
        let start = (self.columns - B) * self.n;
        for (k, column) in self.values[start..].chunks_exact_mut(self.n).enumerate() {
            for (slot, row) in column.iter_mut().zip(block) {
                *slot = row[k];
            }
        }
    }

    /// The columns in use as a matrix.
    pub fn matrix(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.values, self.n, self.columns)
    }

    /// P ← P − V (VᵀP) over the first `columns` columns; returns the largest |VᵀP|.
    pub fn project_out<const B: usize, const G: usize>(
        &self,
        simd: Simd,
        columns: usize,
        block: &mut [[[f64; B]; G]],
    ) -> f64 {
        let v = &self.values[..columns * self.n];
        let mut h = vec![[[0.0; B]; G]; columns];
        inner_products::<B, G>(simd, v, block, &mut h);
        subtract_products::<B, G>(simd, v, block, &h);
        h.iter().flatten().flatten().fold(0.0f64, |m, x| m.max(x.abs()))
    }
}

dispatch! {
    /// H ← VᵀP, V column by column.
    fn inner_products<const B: usize, const G: usize>(
        v: &[f64], block: &[[[f64; B]; G]], h: &mut [[[f64; B]; G]],
    ) => inner_products_body
}

dispatch! {
    /// P ← P − V H.
    fn subtract_products<const B: usize, const G: usize>(
        v: &[f64], block: &mut [[[f64; B]; G]], h: &[[[f64; B]; G]],
    ) => subtract_products_body
}

#[inline(always)]
fn inner_products_body<const FMA: bool, const B: usize, const G: usize>(
    v: &[f64],
    block: &[[[f64; B]; G]],
    h: &mut [[[f64; B]; G]],
) {
    let n = block.len();
    let slab = (SLAB / (B * G)).max(1);
    for first in (0..n).step_by(slab) {
        let rows = &block[first..n.min(first + slab)];
        let mut groups = h.chunks_exact_mut(COLUMNS);
        let mut column = 0;
        for group in &mut groups {
            let at: [&[f64]; COLUMNS] =
                std::array::from_fn(|c| &v[(column + c) * n + first..(column + c) * n + first + rows.len()]);
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
            column += COLUMNS;
        }
        for one in groups.into_remainder() {
            let at = &v[column * n + first..column * n + first + rows.len()];
            for (x, p) in at.iter().zip(rows) {
                for g in 0..G {
                    for r in 0..B {
                        one[g][r] = fused::<FMA>(*x, p[g][r], one[g][r]);
                    }
                }
            }
            column += 1;
        }
    }
}

#[inline(always)]
fn subtract_products_body<const FMA: bool, const B: usize, const G: usize>(
    v: &[f64],
    block: &mut [[[f64; B]; G]],
    h: &[[[f64; B]; G]],
) {
    let n = block.len();
    let slab = (SLAB / (B * G)).max(1);
    for first in (0..n).step_by(slab) {
        let rows = &mut block[first..n.min(first + slab)];
        let groups = h.chunks_exact(COLUMNS);
        let rest = groups.remainder();
        let mut column = 0;
        for group in groups {
            let at: [&[f64]; COLUMNS] =
                std::array::from_fn(|c| &v[(column + c) * n + first..(column + c) * n + first + rows.len()]);
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
            column += COLUMNS;
        }
        for one in rest {
            let at = &v[column * n + first..column * n + first + rows.len()];
            for (x, p) in at.iter().zip(rows.iter_mut()) {
                for g in 0..G {
                    for r in 0..B {
                        p[g][r] = fused::<FMA>(-x, one[g][r], p[g][r]);
                    }
                }
            }
            column += 1;
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
        for simd in [Simd::detect(), Simd::Baseline] {
            let mut basis = Basis::new(n, 12);
            for group in 0..3 {
                let block: Vec<[f64; 4]> = (0..n)
                    .map(|i| {
                        std::array::from_fn(|k| {
                            let frequency = (4 * group + k + 1) as f64 * std::f64::consts::PI / n as f64;
                            (2.0 / n as f64).sqrt() * (frequency * (i as f64 + 0.5)).cos()
                        })
                    })
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
        }
    }
}
