//! The columns of several matrices, numbered through, as if they stood side by side.

use super::CodingError;
use super::problem::column;
use faer::{Mat, MatRef};

/// N columns of M values in however many matrices.
pub(super) struct Columns<'a> {
    parts: Vec<MatRef<'a, f64>>,
    /// Number of each part's first column, and N.
    starts: Vec<usize>,
}

impl<'a> Columns<'a> {
    /// Takes column-major matrices.
    ///
    /// # Errors
    /// [`CodingError::NoSignatures`] for M = 0 or N = 0, [`CodingError::DimensionMismatch`] for unequal heights.
    pub fn new(parts: Vec<MatRef<'a, f64>>) -> Result<Self, CodingError> {
        let mut starts = vec![0];
        let mut end = 0;
        let dimension = parts.first().map_or(0, |part| part.nrows());
        for part in &parts {
            if part.nrows() != dimension {
                return Err(CodingError::DimensionMismatch {
                    signature: part.nrows(),
                    atoms: dimension,
                });
            }
            end += part.ncols();
            starts.push(end);
        }
        if dimension == 0 || end == 0 {
            return Err(CodingError::NoSignatures);
        }
        Ok(Self { parts, starts })
    }

    /// N.
    pub fn len(&self) -> usize {
        self.starts[self.parts.len()]
    }

    /// M.
    pub fn dimension(&self) -> usize {
        self.parts[0].nrows()
    }

    /// Column `i`.
    pub fn column(&self, i: usize) -> &[f64] {
        let part = self.starts.partition_point(|&start| start <= i) - 1;
        column(self.parts[part], i - self.starts[part])
    }

    /// All columns, in order.
    pub fn iter(&self) -> impl Iterator<Item = &[f64]> {
        let columns = |part: &MatRef<'a, f64>| 0..part.ncols();
        (self.parts.iter()).flat_map(move |part| columns(part).map(move |j| column(*part, j)))
    }

    /// Puts the named columns side by side.
    pub fn gather(&self, numbers: &[usize], to: &mut Mat<f64>) {
        to.resize_with(self.dimension(), numbers.len(), |_, _| 0.0);
        for (k, &i) in numbers.iter().enumerate() {
            to.col_as_slice_mut(k).copy_from_slice(self.column(i));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_numbered_across_the_parts() {
        let part = |first: usize, count: usize| Mat::from_fn(3, count, |i, j| (10 * (first + j) + i) as f64);
        let parts = [part(0, 2), part(2, 0), part(2, 5)];
        let columns = Columns::new(parts.iter().map(Mat::as_ref).collect()).unwrap();
        assert_eq!((columns.len(), columns.dimension()), (7, 3));
        let wanted = |i: usize| [0, 1, 2].map(|k| (10 * i + k) as f64);
        assert!((0..7).all(|i| columns.column(i) == wanted(i)));
        assert!(columns.iter().enumerate().all(|(i, column)| column == wanted(i)));
        let mut gathered = Mat::zeros(3, 9);
        columns.gather(&[6, 0, 2], &mut gathered);
        assert_eq!(gathered, Mat::from_fn(3, 3, |i, j| wanted([6, 0, 2][j])[i]));
    }

    #[test]
    fn nothing_and_unequal_heights_are_refused() {
        let (none, two, three) = (Mat::zeros(2, 0), Mat::zeros(2, 1), Mat::zeros(3, 1));
        for parts in [vec![], vec![none.as_ref()], vec![Mat::zeros(0, 4).as_ref()]] {
            assert!(matches!(Columns::new(parts), Err(CodingError::NoSignatures)));
        }
        assert!(matches!(
            Columns::new(vec![two.as_ref(), three.as_ref()]),
            Err(CodingError::DimensionMismatch {
                signature: 3,
                atoms: 2
            })
        ));
    }
}
