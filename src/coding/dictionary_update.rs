//! The dictionary half of online learning: running sums, block-coordinate descent on the atoms, and what replaces
//! atoms of no use (Mairal et al. 2010, Algorithm 2 and Section 3.4).

use super::cholesky::dot;
use super::initialise::jittered;
use super::lasso::column;
use super::{Codes, CodingError, Dictionary};
use faer::{Mat, MatRef};
use rand_chacha::ChaCha8Rng;

/// Atoms whose directions agree to more than this are one.
const COHERENT: f64 = 1.0 - 1e-6;
/// An atom has been idle for long once this many signals per atom have passed it by.
const IDLE_SIGNALS_PER_ATOM: usize = 4;

/// Atoms and running sums between mini-batches. Matrices are stored by columns, one after the other.
pub(super) struct DictionaryUpdate {
    dimension: usize,
    batch: usize,
    /// D, M × L.
    atoms: Vec<f64>,
    /// A = Σ aaᵀ, L × L, faded.
    code_sums: Vec<f64>,
    /// B = Σ saᵀ, M × L, faded.
    signal_sums: Vec<f64>,
    /// Signals coded since the atom was last used.
    idle: Vec<usize>,
    iteration: usize,
    replaced: usize,
}

impl DictionaryUpdate {
    /// From L initial atoms of M = `dimension` values.
    pub fn new(atoms: Vec<f64>, dimension: usize, batch: usize) -> Self {
        let count = atoms.len() / dimension;
        Self {
            dimension,
            batch,
            signal_sums: vec![0.0; atoms.len()],
            atoms,
            code_sums: vec![0.0; count * count],
            idle: vec![0; count],
            iteration: 0,
            replaced: 0,
        }
    }

    /// D as it stands.
    pub fn atoms(&self) -> &[f64] {
        &self.atoms
    }

    /// Atoms replaced so far.
    pub fn replaced(&self) -> usize {
        self.replaced
    }

    /// D as it stands, with its Gram matrix.
    pub fn dictionary(&self) -> Result<Dictionary, CodingError> {
        let dimension = self.dimension;
        let atoms = Mat::from_fn(dimension, self.idle.len(), |i, j| self.atoms[j * dimension + i]);
        Dictionary::new(atoms)
    }

    /// Takes in a mini-batch (M × η) coded under `dictionary`, the one last handed out, and moves the atoms.
    pub fn step(
        &mut self,
        dictionary: &Dictionary,
        batch: MatRef<'_, f64>,
        codes: &Codes,
        random: &mut ChaCha8Rng,
    ) {
        self.iteration += 1;
        self.fade();
        self.accumulate(batch, codes);
        let mut useless = self.merge_duplicates(dictionary);
        let count = self.idle.len();
        for j in 0..count {
            if self.idle[j] >= IDLE_SIGNALS_PER_ATOM * count {
                useless.push(j);
            }
        }
        useless.sort_unstable();
        useless.dedup();
        for j in 0..count {
            self.move_atom(j);
        }
        self.replace(&useless, batch, codes, random);
    }

    fn fade(&mut self) {
        let (t, eta) = (self.iteration as f64, self.batch as f64);
        let theta = if t < eta { t * eta } else { eta * eta + t - eta };
        let beta = (theta + 1.0 - eta) / (theta + 1.0);
        self.code_sums.iter_mut().for_each(|v| *v *= beta);
        self.signal_sums.iter_mut().for_each(|v| *v *= beta);
    }

    fn accumulate(&mut self, batch: MatRef<'_, f64>, codes: &Codes) {
        let count = self.idle.len();
        self.idle.iter_mut().for_each(|idle| *idle += batch.ncols());
        for i in 0..batch.ncols() {
            let signal = column(batch, i);
            let code = codes.offsets[i]..codes.offsets[i + 1];
            let (atoms, values) = (&codes.atoms[code.clone()], &codes.values[code]);
            for (&j, &a) in atoms.iter().zip(values) {
                let j = j as usize;
                self.idle[j] = 0;
                let sums = &mut self.signal_sums[j * self.dimension..][..self.dimension];
                for (b, s) in sums.iter_mut().zip(signal) {
                    *b += a * s;
                }
                let sums = &mut self.code_sums[j * count..][..count];
                for (&k, &other) in atoms.iter().zip(values) {
                    sums[k as usize] += a * other;
                }
            }
        }
    }

    /// Hands the sums of an atom that nearly equals an earlier one over to that one; returns the atoms left over.
    fn merge_duplicates(&mut self, dictionary: &Dictionary) -> Vec<usize> {
        let gram = dictionary.gram();
        let count = self.idle.len();
        let mut duplicates = Vec::new();
        for j in 0..count {
            let products = gram.col_as_slice(j);
            let twin = (0..j).find(|&i| {
                let norms2 = gram[(i, i)] * products[j];
                products[i] > 0.0 && products[i] * products[i] > COHERENT * COHERENT * norms2
            });
            let Some(i) = twin.filter(|i| !duplicates.contains(i)) else {
                continue;
            };
            duplicates.push(j);
            // d_i takes the codes a_i + a_j: row and column j of A are added to row and column i.
            for k in 0..count {
                let value = std::mem::take(&mut self.code_sums[j * count + k]);
                self.code_sums[i * count + k] += value;
            }
            for k in 0..count {
                let value = std::mem::take(&mut self.code_sums[k * count + j]);
                self.code_sums[k * count + i] += value;
            }
            for m in 0..self.dimension {
                let value = std::mem::take(&mut self.signal_sums[j * self.dimension + m]);
                self.signal_sums[i * self.dimension + m] += value;
            }
        }
        duplicates
    }

    /// d_j ← d_j + (b_j − D A_j)/A_jj, then onto the unit ball (Algorithm 2).
    fn move_atom(&mut self, j: usize) {
        let (dimension, count) = (self.dimension, self.idle.len());
        let weights = &self.code_sums[j * count..][..count];
        let weight = weights[j];
        if weight <= f64::MIN_POSITIVE {
            return;
        }
        let mut moved = self.signal_sums[j * dimension..][..dimension].to_vec();
        for (k, &a) in weights.iter().enumerate() {
            if a != 0.0 && k != j {
                for (u, d) in moved.iter_mut().zip(&self.atoms[k * dimension..]) {
                    *u -= a * d;
                }
            }
        }
        let norm = dot(&moved, &moved).sqrt();
        // (b_j − Σ_{k≠j} A_kj d_k)/A_jj, shortened to unit norm where it is longer.
        let scale = if norm > weight { 1.0 / norm } else { 1.0 / weight };
        if scale.is_finite() {
            for (d, u) in self.atoms[j * dimension..][..dimension].iter_mut().zip(&moved) {
                *d = scale * u;
            }
        }
    }

    /// Puts the signals coded worst in the place of `useless` atoms, as many as there are, no two nearly equal.
    fn replace(&mut self, useless: &[usize], batch: MatRef<'_, f64>, codes: &Codes, random: &mut ChaCha8Rng) {
        if useless.is_empty() {
            return;
        }
        let (dimension, count) = (self.dimension, self.idle.len());
        let mut worst: Vec<usize> = (0..batch.ncols()).collect();
        worst.sort_by(|&a, &b| codes.objective[b].total_cmp(&codes.objective[a]).then(a.cmp(&b)));
        let mut taken: Vec<Vec<f64>> = Vec::new();
        for i in worst {
            if taken.len() == useless.len() {
                break;
            }
            let atom = jittered(column(batch, i), random);
            if taken.iter().any(|other| dot(other, &atom) > COHERENT) {
                continue;
            }
            let j = useless[taken.len()];
            self.atoms[j * dimension..][..dimension].copy_from_slice(&atom);
            self.signal_sums[j * dimension..][..dimension].fill(0.0);
            self.code_sums[j * count..][..count].fill(0.0);
            for k in 0..count {
                self.code_sums[k * count + j] = 0.0;
            }
            self.idle[j] = 0;
            taken.push(atom);
        }
        self.replaced += taken.len();
    }
}
