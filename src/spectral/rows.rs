//! Eigenvectors row by row, wherever the solve left them.

use super::scratch::Scratch;

/// Rows of a block: a product of so many rows of a basis by its coefficients runs at full speed, and stays in cache.
pub const BLOCK: usize = 192;

/// n × k values, row by row, in blocks of rows with a gap behind each.
#[derive(Debug, Default)]
pub struct Rows {
    values: Scratch,
    width: usize,
    /// From the start of a block to that of the next.
    stride: usize,
    /// Name of each stored row, in order.
    names: Vec<usize>,
    /// Where the row of each name starts.
    starts: Vec<usize>,
}

impl Rows {
    /// Rows of `width` values, [`BLOCK`] of them from every `stride`-th value on; the i-th is called `names[i]`, and the
    /// names are 0 to n − 1.
    pub fn new(values: Scratch, width: usize, stride: usize, names: &[usize]) -> Self {
        let mut starts = vec![0; names.len()];
        for (i, &name) in names.iter().enumerate() {
            starts[name] = i / BLOCK * stride + i % BLOCK * width;
        }
        Self {
            values,
            width,
            stride,
            names: names.to_vec(),
            starts,
        }
    }

    /// Rows side by side in their order.
    pub fn in_order(values: Vec<f64>, width: usize) -> Self {
        let names: Vec<usize> = (0..values.len() / width.max(1)).collect();
        Self::new(values.into(), width, BLOCK * width, &names)
    }

    /// k.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Row `i`, k values.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[self.starts[i]..][..self.width]
    }

    /// The rows as they are stored: row-major blocks, with the names of their rows.
    pub fn blocks(&self) -> impl Iterator<Item = (&[f64], &[usize])> {
        let values = self.values.chunks(self.stride.max(1));
        values
            .zip(self.names.chunks(BLOCK))
            .map(|(values, names)| (&values[..names.len() * self.width], names))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_by_name() {
        let n = 2 * BLOCK + 7;
        let names: Vec<usize> = (0..n).map(|i| (5 * i + 3) % n).collect();
        let mut values = vec![f64::NAN; 3 * 1000];
        for (i, name) in names.iter().enumerate() {
            let start = i / BLOCK * 1000 + i % BLOCK * 2;
            values[start..start + 2].copy_from_slice(&[*name as f64, i as f64]);
        }
        let rows = Rows::new(values.into(), 2, 1000, &names);
        assert!((0..n).all(|i| rows.row(i)[0] == i as f64));
        let stored: Vec<f64> = rows.blocks().flat_map(|(values, _)| values.to_vec()).collect();
        assert!((0..n).all(|i| stored[2 * i] == names[i] as f64 && stored[2 * i + 1] == i as f64));
        assert_eq!(rows.blocks().map(|(_, names)| names.len()).sum::<usize>(), n);
    }
}
