//! Online dictionary learning (docs/method.md#dictionary; Mairal, Bach, Ponce, Sapiro 2010, Algorithms 1 and 2).

use super::columns::Columns;
use super::dictionary_update::DictionaryUpdate;
use super::initialise::{distinct, initial_atoms};
use super::lasso::{check_lambda, encode_prepared, score_prepared};
use super::prepared::Prepared;
use super::{CodingError, Dictionary, Signals};
use crate::cancel::Cancel;
use faer::{Mat, MatRef};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
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
    /// Mean Lasso objective under the initial atoms, over all signals or a seeded draw of 500 where there are more.
    pub initial_objective: f64,
    /// Mean Lasso objective of the same signals under the learnt atoms.
    pub objective: f64,
}

/// Signals, drawn with the seed, on which the initial and the final objective are measured; all of them where there
/// are no more.
const MEASURED: usize = 500;

/// Learns a dictionary from the columns of all matrices of `signals` (M × N in all, as if they stood side by side; they
/// are copied only where columns are not contiguous). `progress(done, total)` is called after every mini-batch.
///
/// Initial atoms are distinct training signals, jittered. Mini-batches run through all signals in random order, again
/// and again; each is coded under the current atoms, enters the running sums A = Σ aaᵀ and B = Σ saᵀ, and the atoms
/// move by one pass of block-coordinate descent with ‖d_j‖ ≤ 1. Before mini-batch t the sums are scaled by
/// β², β = (θ + 1 − η)/(θ + 1), η the batch size, θ = tη for t < η and η² + t − η after (Sections 3.4.1 and 3.4.3 of
/// the paper, ρ = 2), so codes found under early atoms fade. Atoms nearly equal to another (coherence above 1 − 1e-6) and atoms no signal
/// has used for long give way to the signals coded worst. At the end the atoms are rounded to values that an `f32`
/// holds; ‖d_j‖ ≤ 1 then holds to 1e-6. If that did not lower the mean objective, the initial atoms are returned.
/// The result depends on the signals, the parameters and nothing else.
///
/// # Errors
/// [`CodingError::NoSignatures`] for N = 0 or M = 0, [`CodingError::DimensionMismatch`] for matrices of unequal M,
/// [`CodingError::BadParameter`] for no atoms, an empty batch or λ
/// not positive and finite, [`CodingError::NotFinite`], [`CodingError::Cancelled`], and what coding can fail with.
pub fn learn(
    signals: &[MatRef<'_, f64>],
    parameters: &LearnParameters,
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<(Dictionary, LearnReport), CodingError> {
    check(parameters)?;
    let copies: Vec<Option<Mat<f64>>> = signals
        .iter()
        .map(|part| (part.row_stride() != 1).then(|| part.to_owned()))
        .collect();
    let parts = signals
        .iter()
        .zip(&copies)
        .map(|(part, copy)| copy.as_ref().map_or(*part, Mat::as_ref));
    learn_columns(&Columns::new(parts.collect())?, parameters, cancel, progress)
}

fn check(parameters: &LearnParameters) -> Result<(), CodingError> {
    check_lambda(parameters.lambda)?;
    for (name, value) in [("atoms", parameters.atoms), ("batch", parameters.batch)] {
        if value == 0 {
            return Err(CodingError::BadParameter {
                name,
                expected: "at least 1",
                found: "0".to_owned(),
            });
        }
    }
    Ok(())
}

fn learn_columns(
    signals: &Columns<'_>,
    parameters: &LearnParameters,
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<(Dictionary, LearnReport), CodingError> {
    let Some(distinct) = distinct(signals) else {
        return Err(CodingError::NotFinite { what: "signature" });
    };
    let mut random = ChaCha8Rng::seed_from_u64(parameters.seed);
    let count = parameters.atoms.min(distinct.len());
    // Drawn again where they are needed again, rather than kept.
    let mut drawing = random.clone();
    let initial = initial_atoms(signals, &distinct, count, &mut random);
    let mut order: Vec<usize> = (0..signals.len()).collect();
    order.shuffle(&mut random);
    let measured = order[..MEASURED.min(order.len())].to_vec();
    order.shuffle(&mut random);
    let mut memory = Mat::with_capacity(
        signals.dimension(),
        MEASURED.max(parameters.batch).min(order.len()),
    );
    let mean_objective = |dictionary: &Prepared, memory: &mut Mat<f64>| -> Result<f64, CodingError> {
        signals.gather(&measured, memory);
        let measured = Signals::new(memory.as_ref())?;
        let scores = score_prepared(dictionary, &measured, parameters.lambda, cancel)?;
        Ok(scores.iter().map(|score| score.objective).sum::<f64>() / scores.len() as f64)
    };
    let mut dictionary = Prepared::for_few_signals(rounded(initial.clone()));
    let initial_objective = mean_objective(&dictionary, &mut memory)?;
    *dictionary.atoms_mut() = initial;
    dictionary.renew();

    let mut update = DictionaryUpdate::new(dictionary, parameters.batch);
    let batch = parameters.batch.min(order.len());
    let mut next = 0;
    for iteration in 0..parameters.iterations {
        cancel.check()?;
        let mut drawn = Vec::with_capacity(batch);
        while drawn.len() < batch {
            if next == order.len() {
                order.shuffle(&mut random);
                next = 0;
            }
            drawn.push(order[next]);
            next += 1;
        }
        signals.gather(&drawn, &mut memory);
        let drawn = Signals::new(memory.as_ref())?;
        let codes = encode_prepared(update.dictionary(), &drawn, parameters.lambda, cancel)?;
        update.step(memory.as_ref(), &codes, &mut random);
        progress(iteration + 1, parameters.iterations);
    }

    let replaced = update.replaced();
    let mut dictionary = Prepared::new(rounded(update.into_atoms()))?;
    let mut objective = mean_objective(&dictionary, &mut memory)?;
    if objective > initial_objective {
        let initial = initial_atoms(signals, &distinct, count, &mut drawing);
        (dictionary, objective) = (Prepared::new(rounded(initial))?, initial_objective);
    }
    let report = LearnReport {
        signals: signals.len(),
        distinct_signals: distinct.len(),
        atoms_requested: parameters.atoms,
        atoms: count,
        replaced,
        initial_objective,
        objective,
    };
    Ok((dictionary.into(), report))
}

/// The atoms at `f32` precision.
fn rounded(mut atoms: Mat<f64>) -> Mat<f64> {
    for j in 0..atoms.ncols() {
        for value in atoms.col_as_slice_mut(j) {
            *value = f64::from(*value as f32);
        }
    }
    atoms
}
