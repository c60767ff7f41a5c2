//! Rows at single precision, padded with zeros to whole pieces so that the compiler makes vectors of passes over them.

use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};

/// Values looked at side by side.
pub(super) const LANES: usize = 16;

/// A piece of a row.
pub(super) type Lanes = [f32; LANES];

/// Pieces of a row of `count` values.
pub(super) fn pieces(count: usize) -> usize {
    count.div_ceil(LANES)
}

/// Values that `count` take up with their padding.
pub(super) fn padded(count: usize) -> usize {
    LANES * pieces(count)
}

/// A symmetric matrix at single precision, by padded rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    values: Vec<Lanes>,
    width: usize,
}

impl Rows {
    /// L × L values, given by the columns of the matrix.
    pub fn new<'a>(columns: impl ExactSizeIterator<Item = &'a [f64]>) -> Self {
        let count = columns.len();
        let width = pieces(count);
        let mut values = vec![[0.0; LANES]; width * count];
        for (j, column) in columns.enumerate() {
            let row = values[j * width..][..width].as_flattened_mut();
            for (to, from) in row.iter_mut().zip(column) {
                *to = *from as f32;
            }
        }
        Self { values, width }
    }

    /// DᵀD of L atoms at single precision, half of it computed and the other mirrored.
    pub fn gram(atoms: MatRef<'_, f32>) -> Self {
        let count = atoms.ncols();
        let width = pieces(count);
        let mut rows = Self {
            values: vec![[0.0; LANES]; width * count],
            width,
        };
        rows.renew_gram(atoms);
        rows
    }

    /// [`Rows::gram`] of as many atoms as before, in its place.
    pub fn renew_gram(&mut self, atoms: MatRef<'_, f32>) {
        let count = atoms.ncols();
        let stride = self.width * LANES;
        let values = self.values.as_flattened_mut();
        matmul(
            MatMut::from_column_major_slice_with_stride_mut(values, count, count, stride),
            BlockStructure::TriangularLower,
            Accum::Replace,
            atoms.transpose(),
            BlockStructure::Rectangular,
            atoms,
            BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
        // Square by square, as neither rows nor columns alone stay in cache.
        for first in (0..count).step_by(LANES) {
            for second in (first..count).step_by(LANES) {
                for j in first..count.min(first + LANES) {
                    for i in second.max(j + 1)..count.min(second + LANES) {
                        values[i * stride + j] = values[j * stride + i];
                    }
                }
            }
        }
    }

    #[inline(always)]
    pub fn row(&self, j: usize) -> &[Lanes] {
        &self.values[j * self.width..][..self.width]
    }
}
