//! Online dictionary learning (method, step 7; Mairal, Bach, Ponce, Sapiro 2010, Algorithms 1 and 2).

use super::dictionary_update::DictionaryUpdate;
use super::initialise::{distinct, initial_atoms};
use super::lasso::{check_lambda, column, with_column_major};
use super::{CodingError, Dictionary, Signals, encode, score_signals};
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

/// Learns a dictionary from the columns of `signals` (M × N). `progress(done, total)` is called after every
/// mini-batch.
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
/// [`CodingError::NoSignatures`] for N = 0 or M = 0, [`CodingError::BadParameter`] for no atoms, an empty batch or λ
/// not positive and finite, [`CodingError::NotFinite`], [`CodingError::Cancelled`], and what coding can fail with.
pub fn learn(
    signals: MatRef<'_, f64>,
    parameters: &LearnParameters,
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<(Dictionary, LearnReport), CodingError> {
    check(signals, parameters)?;
    with_column_major(signals, |signals| {
        learn_columns(signals, parameters, cancel, progress)
    })
}

fn check(signals: MatRef<'_, f64>, parameters: &LearnParameters) -> Result<(), CodingError> {
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
    if signals.nrows() == 0 || signals.ncols() == 0 {
        return Err(CodingError::NoSignatures);
    }
    Ok(())
}

fn learn_columns(
    signals: MatRef<'_, f64>,
    parameters: &LearnParameters,
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<(Dictionary, LearnReport), CodingError> {
    let Some(distinct) = distinct(signals) else {
        return Err(CodingError::NotFinite { what: "signature" });
    };
    let mut random = ChaCha8Rng::seed_from_u64(parameters.seed);
    let atoms = parameters.atoms.min(distinct.len());
    let initial = initial_atoms(signals, &distinct, atoms, &mut random);
    let mut order: Vec<usize> = (0..signals.ncols()).collect();
    order.shuffle(&mut random);
    let measured = gather(signals, &order[..MEASURED.min(order.len())]);
    let measured = Signals::new(measured.as_ref())?;
    order.shuffle(&mut random);

    let mean_objective = |dictionary: &Dictionary| -> Result<f64, CodingError> {
        let scores = score_signals(dictionary, &measured, parameters.lambda, cancel)?;
        Ok(scores.iter().map(|score| score.objective).sum::<f64>() / scores.len() as f64)
    };
    let first = Dictionary::for_few_signals(rounded(&initial, signals.nrows()));
    let initial_objective = mean_objective(&first)?;

    let mut update = DictionaryUpdate::new(initial, signals.nrows(), parameters.batch);
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
        let batch = gather(signals, &drawn);
        let dictionary = update.dictionary();
        let codes = encode(&dictionary, batch.as_ref(), parameters.lambda, cancel)?;
        update.step(&dictionary, batch.as_ref(), &codes, &mut random);
        progress(iteration + 1, parameters.iterations);
    }

    let mut dictionary = Dictionary::new(rounded(update.atoms(), signals.nrows()))?;
    let mut objective = mean_objective(&dictionary)?;
    if objective > initial_objective {
        (dictionary, objective) = (Dictionary::new(first.atoms().clone())?, initial_objective);
    }
    let report = LearnReport {
        signals: signals.ncols(),
        distinct_signals: distinct.len(),
        atoms_requested: parameters.atoms,
        atoms,
        replaced: update.replaced(),
        initial_objective,
        objective,
    };
    Ok((dictionary, report))
}

/// The named columns side by side.
fn gather(signals: MatRef<'_, f64>, numbers: &[usize]) -> Mat<f64> {
    let mut all = Mat::zeros(signals.nrows(), numbers.len());
    for (k, &i) in numbers.iter().enumerate() {
        all.col_as_slice_mut(k).copy_from_slice(column(signals, i));
    }
    all
}

/// The atoms at `f32` precision, M × L.
fn rounded(atoms: &[f64], dimension: usize) -> Mat<f64> {
    Mat::from_fn(dimension, atoms.len() / dimension, |i, j| {
        f64::from(atoms[j * dimension + i] as f32)
    })
}
