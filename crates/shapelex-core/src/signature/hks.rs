//! Heat Kernel Signature (Sun, Ovsjanikov, Guibas 2009, Eq. 3 and section 4).

use super::grid::linspace;
use super::spectrum::Spectrum;
use faer::Mat;

/// HKS of the given vertices: M × N.
///
/// HKS(x, t) = Σ_k e^{−λ_k t} φ_k(x)² / Σ_k e^{−λ_k t} over the non-zero λ_k, at M times evenly spaced in log t from
/// 4 ln 10 / λ_n to 4 ln 10 / λ_2 (the interval of the paper's section 4; division by the heat trace is its scaled
/// HKS, which makes times comparable).
pub fn hks(spectrum: &Spectrum<'_>, vertices: &[u32], times: usize) -> Mat<f64> {
    let c = 4.0 * 10f64.ln();
    let low = (c / spectrum.values[spectrum.values.len() - 1]).ln();
    let high = (c / spectrum.values[0]).ln();
    let times: Vec<f64> = linspace(low, high, times).into_iter().map(f64::exp).collect();
    let mut weights = Mat::from_fn(times.len(), spectrum.values.len(), |i, k| {
        // Relative to the slowest mode, which cancels in the quotient.
        (-(spectrum.values[k] - spectrum.values[0]) * times[i]).exp()
    });
    for i in 0..weights.nrows() {
        let sum: f64 = (0..weights.ncols()).map(|k| weights[(i, k)]).sum();
        for k in 0..weights.ncols() {
            weights[(i, k)] /= sum;
        }
    }
    weights * spectrum.squared(vertices)
}
