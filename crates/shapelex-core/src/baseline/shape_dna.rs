//! Shape DNA (Reuter, Wolter, Peinecke 2006): the beginning of the spectrum.

/// How many eigenvalues the paper uses (section 4).
pub const EIGENVALUES: usize = 13;

/// The first `count` non-zero eigenvalues of a surface of unit area, ascending; divided by the first of them where
/// `relative`. A shorter spectrum is padded with its last value.
pub fn shape_dna(eigenvalues: &[f64], count: usize, relative: bool) -> Vec<f64> {
    let floor = eigenvalues.last().copied().unwrap_or(0.0) * 1e-8;
    let mut values: Vec<f64> = eigenvalues
        .iter()
        .copied()
        .filter(|&v| v > floor)
        .take(count)
        .collect();
    let last = values.last().copied().unwrap_or(0.0);
    values.resize(count, last);
    if relative && values.first().is_some_and(|&v| v > 0.0) {
        let first = values[0];
        values.iter_mut().for_each(|v| *v /= first);
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_left_out_and_short_spectra_padded() {
        assert_eq!(shape_dna(&[0.0, 1e-12, 2.0, 4.0, 8.0], 2, false), [2.0, 4.0]);
        assert_eq!(shape_dna(&[0.0, 2.0, 4.0], 3, false), [2.0, 4.0, 4.0]);
        assert_eq!(shape_dna(&[0.0, 2.0, 4.0, 8.0], 3, true), [1.0, 2.0, 4.0]);
    }
}
