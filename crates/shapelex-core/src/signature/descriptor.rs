//! One interface for every local descriptor.

use super::spectrum::Spectrum;
use super::{Signatures, hks, si_hks, wks};
use crate::spectral::{Eigenpairs, SpectralError};

pub use super::options::{Descriptor, DescriptorParameters, WksRange};

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
