//! Sparse codes, and what they cost.

/// Sparse codes of N signals under one dictionary of L atoms, and what they cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Codes {
    /// N + 1 offsets into `atoms` and `values`: the code of signal i is `offsets[i]..offsets[i + 1]`.
    pub offsets: Vec<usize>,
    /// Atom of each non-zero, ascending within a signal.
    pub atoms: Vec<u32>,
    /// Value of each non-zero.
    pub values: Vec<f64>,
    /// N values ½‖s − Da‖² + λ‖a‖₁.
    pub objective: Vec<f64>,
    /// N values ‖s − Da‖².
    pub residual2: Vec<f64>,
}

/// What coding one signal cost, without the code itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CodeScore {
    /// ½‖s − Da‖² + λ‖a‖₁.
    pub objective: f64,
    /// ‖s − Da‖².
    pub residual2: f64,
    /// Non-zeros of a.
    pub nonzeros: usize,
}
