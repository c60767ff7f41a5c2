//! Which descriptor, and what it needs to know.

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
