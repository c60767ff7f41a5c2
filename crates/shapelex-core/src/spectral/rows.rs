//! Eigenvectors row by row, in the order the solve left them.

use super::scratch::Scratch;

/// Rows of a block: a product of so many rows of a basis by its coefficients runs at full speed, and stays in cache.
pub const BLOCK: usize = 192;

/// n × k values, row by row.
#[derive(Debug, Default)]
pub struct Rows {
    values: Scratch,
    width: usize,
    /// Name of each stored row, in order.
    names: Vec<usize>,
    /// Place of the row of each name.
    places: Vec<usize>,
}

impl Rows {
    /// Rows of `width` values; the i-th is called `names[i]`, and the names are 0 to n − 1.
    pub fn new(values: Scratch, width: usize, names: &[usize]) -> Self {
        let mut places = vec![0; names.len()];
        for (i, &name) in names.iter().enumerate() {
            places[name] = i;
        }
        Self {
            values,
            width,
            names: names.to_vec(),
            places,
        }
    }

    /// Rows called by their place.
    pub fn in_order(values: Vec<f64>, width: usize) -> Self {
        let names: Vec<usize> = (0..values.len() / width.max(1)).collect();
        Self::new(values.into(), width, &names)
    }

    /// k.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Row `i`, k values.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[self.places[i] * self.width..][..self.width]
    }

    /// The rows as they are stored: row-major blocks, with the names of their rows.
    pub fn blocks(&self) -> impl Iterator<Item = (&[f64], &[usize])> {
        let values = self.values.chunks((BLOCK * self.width).max(1));
        values.zip(self.names.chunks(BLOCK))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_by_name() {
        let n = 2 * BLOCK + 7;
        let names: Vec<usize> = (0..n).map(|i| (5 * i + 3) % n).collect();
        let values: Vec<f64> = (0..n).flat_map(|i| [names[i] as f64, i as f64]).collect();
        let rows = Rows::new(values.into(), 2, &names);
        assert!((0..n).all(|i| rows.row(i)[0] == i as f64));
        let stored: Vec<f64> = rows.blocks().flat_map(|(values, _)| values.to_vec()).collect();
        assert!((0..n).all(|i| stored[2 * i] == names[i] as f64 && stored[2 * i + 1] == i as f64));
        assert_eq!(rows.blocks().map(|(_, names)| names.len()).sum::<usize>(), n);
    }
}
