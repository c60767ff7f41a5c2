//! Wave Kernel Signature (docs/method.md#signature; Aubry, Schlickewei, Cremers 2011, Eq. 8 and 9).

use super::grid::linspace;
use super::options::{DescriptorParameters, WksRange};
use super::spectrum::Spectrum;
use faer::Mat;

/// Energies and width of a WKS for one spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct EnergyGrid {
    /// M energies, log λ, evenly spaced.
    pub energies: Vec<f64>,
    /// Width σ of the Gaussians, in the units of the energies.
    pub sigma: f64,
}

impl EnergyGrid {
    /// Lays the grid over a spectrum's non-zero eigenvalues (ascending, at least two distinct).
    pub fn new(values: &[f64], parameters: &DescriptorParameters) -> Self {
        let count = parameters.dimension;
        let low = values[0].ln();
        let high = values[values.len() - 1].ln();
        let (low, high, sigma) = match parameters.range {
            WksRange::Code => (low, high / 1.02, None),
            WksRange::ScaleFree => (low, high, None),
            WksRange::Paper7 => {
                // σ is 7 steps of the whole interval; the grid then covers what is left 2σ from either end.
                let sigma = 7.0 * (high - low) / count as f64;
                (low + 2.0 * sigma, high - 2.0 * sigma, Some(sigma))
            }
            WksRange::Fixed { low, high } => (low, high, None),
        };
        let step = (high - low) / (count.max(2) - 1) as f64;
        Self {
            energies: linspace(low, high, count),
            sigma: sigma.unwrap_or(parameters.sigma_steps * step.abs()),
        }
    }
}

/// WKS of the given vertices: M × N.
///
/// WKS(x, e) = Σ_k φ_k(x)² g_k(e) / Σ_k g_k(e), g_k(e) = exp(−(e − log λ_k)² / 2σ²), over the non-zero λ_k. The
/// largest exponent of each energy is subtracted first, which cancels in the quotient and keeps it defined however far
/// the energy lies from the spectrum.
pub fn wks(spectrum: &Spectrum<'_>, vertices: &[u32], parameters: &DescriptorParameters) -> Mat<f64> {
    let grid = EnergyGrid::new(spectrum.values, parameters);
    weights(spectrum.values, &grid) * spectrum.squared(vertices)
}

/// g_k(e_i) / Σ_k g_k(e_i): M × K.
fn weights(values: &[f64], grid: &EnergyGrid) -> Mat<f64> {
    let logs: Vec<f64> = values.iter().map(|v| v.ln()).collect();
    let mut weights = Mat::zeros(grid.energies.len(), logs.len());
    let scale = -0.5 / (grid.sigma * grid.sigma);
    for (i, e) in grid.energies.iter().enumerate() {
        let largest = logs
            .iter()
            .map(|l| scale * (e - l) * (e - l))
            .fold(f64::NEG_INFINITY, f64::max);
        let mut sum = 0.0;
        for (k, l) in logs.iter().enumerate() {
            let g = (scale * (e - l) * (e - l) - largest).exp();
            weights[(i, k)] = g;
            sum += g;
        }
        for k in 0..logs.len() {
            weights[(i, k)] /= sum;
        }
    }
    weights
}
