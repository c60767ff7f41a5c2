//! One interface for every local descriptor.

use super::{Signatures, hks, si_hks, wks};
use crate::spectral::{Eigenpairs, SpectralError};
use faer::Mat;
use serde::{Deserialize, Serialize};

/// A local descriptor built from eigenpairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Descriptor {
    /// Wave Kernel Signature, Aubry, Schlickewei, Cremers 2011.
    #[default]
    Wks,
    /// Heat Kernel Signature, Sun, Ovsjanikov, Guibas 2009.
    Hks,
    /// Scale-invariant Heat Kernel Signature, Bronstein, Kokkinos 2010.
    SiHks,
}

/// Where the energies of the WKS lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WksRange {
    /// From log λ₂ to log(λ_n)/1.02, as the code released with the WKS paper does.
    #[default]
    Code,
    /// From log λ₂ to log λ_n: free of the shape's scale even without normalisation of the area.
    ScaleFree,
    /// The WKS paper's text: σ of 7 steps, the interval shrunk by 2σ at both ends.
    Paper7,
    /// The same logarithmic energies for every shape, so that spectra of parts can be compared
    /// (docs/method.md#hypotheses).
    Fixed {
        /// First energy, log λ.
        low: f64,
        /// Last energy, log λ.
        high: f64,
    },
}

/// What a descriptor needs to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescriptorParameters {
    /// Which one.
    pub descriptor: Descriptor,
    /// M, the length of a signature.
    pub dimension: usize,
    /// σ of the WKS in steps of its energy grid.
    pub sigma_steps: f64,
    /// Where the energies of the WKS lie.
    pub range: WksRange,
}

/// Signatures of the given vertices: M × N, one per column, not yet normalised.
///
/// # Errors
/// [`SpectralError::TooFewEigenpairs`] where the spectrum has fewer than two distinct non-zero eigenvalues.
pub fn describe_vertices(
    eigenpairs: &Eigenpairs,
    vertices: &[u32],
    parameters: &DescriptorParameters,
) -> Result<Signatures, SpectralError> {
    let spectrum = Spectrum::of(eigenpairs)?;
    let matrix = match parameters.descriptor {
        Descriptor::Wks => wks::wks(&spectrum, vertices, parameters),
        Descriptor::Hks => hks::hks(&spectrum, vertices, parameters.dimension),
        Descriptor::SiHks => si_hks::si_hks(&spectrum, vertices, parameters.dimension),
    };
    Ok(Signatures {
        matrix,
        vertices: vertices.to_vec(),
    })
}

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
