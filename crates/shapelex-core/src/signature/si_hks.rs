//! Scale-invariant Heat Kernel Signature (Bronstein, Kokkinos 2010, section 3).

use super::spectrum::Spectrum;
use faer::Mat;
use std::f64::consts::TAU;

/// log₂ of the first and the last diffusion time, and times per octave: the paper's grid α = 2, τ from 1 to 25 in
/// steps of 1/16, moved to surfaces of unit area, on which λ_n t ranges over the same products.
const FIRST_LOG2_TIME: f64 = -15.0;
const LAST_LOG2_TIME: f64 = 0.0;
const TIMES_PER_OCTAVE: usize = 16;

/// SI-HKS of the given vertices: M × N, the magnitudes of the first M non-zero frequencies.
///
/// On a logarithmic grid of times τ = log₂ t a rescaling of the shape is a shift of h(τ) = Σ_k e^{−λ_k 2^τ} φ_k(x)²
/// and a factor; the derivative of log h removes the factor, the magnitude of the Fourier transform the shift. The sum
/// includes the constant functions, which let log h level off at both ends, so that the shift moves nothing across
/// them.
pub fn si_hks(spectrum: &Spectrum<'_>, vertices: &[u32], frequencies: usize) -> Mat<f64> {
    let steps = ((LAST_LOG2_TIME - FIRST_LOG2_TIME) * TIMES_PER_OCTAVE as f64) as usize;
    let times: Vec<f64> = (0..=steps)
        .map(|i| (FIRST_LOG2_TIME + i as f64 / TIMES_PER_OCTAVE as f64).exp2())
        .collect();
    let kernel = Mat::from_fn(times.len(), spectrum.values.len(), |i, k| {
        (-spectrum.values[k] * times[i]).exp()
    });
    let mut heat = kernel * spectrum.squared(vertices);
    for (x, constant) in spectrum.constant(vertices).into_iter().enumerate() {
        heat.col_mut(x).iter_mut().for_each(|h| *h += constant);
    }
    let slopes = Mat::from_fn(steps, vertices.len(), |i, x| {
        (heat[(i + 1, x)].max(f64::MIN_POSITIVE) / heat[(i, x)].max(f64::MIN_POSITIVE)).ln()
    });
    let fourier = |part: fn(f64) -> f64| {
        Mat::from_fn(frequencies, steps, |f, i| {
            part(TAU * (f + 1) as f64 * i as f64 / steps as f64)
        })
    };
    let cosine = fourier(f64::cos) * &slopes;
    let sine = fourier(f64::sin) * &slopes;
    Mat::from_fn(frequencies, vertices.len(), |f, x| {
        cosine[(f, x)].hypot(sine[(f, x)])
    })
}
