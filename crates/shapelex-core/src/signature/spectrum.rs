//! The eigenpairs that descriptors are made of.

use crate::spectral::{Eigenpairs, SpectralError};
use faer::Mat;

/// The part of a spectrum that descriptors use: everything after the constant functions.
///
/// A mesh of several components has as many zero eigenvalues; all of them are left out, so that the logarithm is
/// defined.
pub struct Spectrum<'a> {
    /// Non-zero eigenvalues, ascending.
    pub values: &'a [f64],
    /// V × n eigenvectors, all of them.
    pub vectors: &'a Mat<f64>,
    /// Column of the first non-zero eigenvalue.
    pub first: usize,
}

impl<'a> Spectrum<'a> {
    /// Finds the first eigenvalue that is not a rounding of zero (above 1e-8 of the last).
    pub fn of(eigenpairs: &'a Eigenpairs) -> Result<Self, SpectralError> {
        let values = &eigenpairs.values;
        let floor = values.last().copied().unwrap_or(0.0) * 1e-8;
        let first = values.iter().position(|&v| v > floor).unwrap_or(values.len());
        let found = values.len() - first;
        if found < 2 || values[values.len() - 1] <= values[first] * (1.0 + 1e-9) {
            return Err(SpectralError::TooFewEigenpairs { found, needed: 2 });
        }
        Ok(Self {
            values: &values[first..],
            vectors: &eigenpairs.vectors,
            first,
        })
    }

    /// Σ φ_k(x)² over the constant functions of the given vertices: 1 / (area share of the vertex's component), N values.
    pub fn constant(&self, vertices: &[u32]) -> Vec<f64> {
        let square = |x: u32, k: usize| self.vectors[(x as usize, k)].powi(2);
        vertices
            .iter()
            .map(|&x| (0..self.first).map(|k| square(x, k)).sum())
            .collect()
    }

    /// φ_k(x)² of the given vertices: K × N, K the number of non-zero eigenvalues.
    pub fn squared(&self, vertices: &[u32]) -> Mat<f64> {
        Mat::from_fn(self.values.len(), vertices.len(), |k, i| {
            let phi = self.vectors[(vertices[i] as usize, self.first + k)];
            phi * phi
        })
    }
}
