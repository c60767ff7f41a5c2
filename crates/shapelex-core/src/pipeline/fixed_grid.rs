//! The grid of energies that open surfaces and whole shapes share (docs/method.md#hypotheses).

use crate::signature::descriptor::{Descriptor, DescriptorParameters, WksRange};

/// Full area over visible area, as assumed for an open query (docs/method.md#hypotheses).
pub(super) const AREA_SCALES: [f64; 4] = [2.0, 2.5, 3.0, 4.0];
/// Energies of the fixed grid.
pub(super) const FIXED_ENERGIES: usize = 100;
/// σ on the fixed grid, in units of log λ.
const FIXED_SIGMA: f64 = 0.27;
/// Highest energy of the fixed grid: the logarithm of this many times n. Weyl's law has λ_n = 4π n on a closed surface of
/// area 1.
const FIXED_TOP: f64 = 15.0;

/// The grid that doubled surfaces and training shapes share: 100 energies from log 10 to log 15 n, σ 0.27.
pub(super) fn fixed_grid(n: usize) -> DescriptorParameters {
    let low = std::f64::consts::LN_10;
    let high = (FIXED_TOP * n.max(2) as f64).ln();
    DescriptorParameters {
        descriptor: Descriptor::Wks,
        dimension: FIXED_ENERGIES,
        sigma_steps: FIXED_SIGMA * (FIXED_ENERGIES - 1) as f64 / (high - low),
        range: WksRange::Fixed { low, high },
    }
}
