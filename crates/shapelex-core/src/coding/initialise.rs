//! Where learning starts: distinct signals, and atoms drawn from them.

use super::columns::Columns;
use super::dispatch::{Kernel, fastest};
use super::dot::dot;
use faer::Mat;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Two signals nearer than this share of the largest signal's norm count as one.
const SAME: f64 = 1e-9;
/// Size of the jitter on an initial atom, as a share of its norm: it keeps atoms drawn from near-equal signals apart.
const JITTER: f64 = 1e-3;

/// Numbers of the signals (columns, M × N) that are farther than 1e-9 of the largest norm from every one kept before
/// them, ascending. Signals are compared only where their projections on one direction are that near, so this costs
/// one pass over the data and a sort. `None` where a signal is not finite.
pub(super) fn distinct(signals: &Columns<'_>) -> Option<Vec<usize>> {
    fastest(Distinct { signals })
}

struct Distinct<'a> {
    signals: &'a Columns<'a>,
}

impl Kernel for Distinct<'_> {
    type Output = Option<Vec<usize>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        find_distinct(self.signals)
    }
}

#[inline(always)]
fn find_distinct(signals: &Columns<'_>) -> Option<Vec<usize>> {
    let direction = direction(signals.dimension());
    let mut projections = Vec::with_capacity(signals.len());
    let mut largest: f64 = 0.0;
    for (i, signal) in signals.iter().enumerate() {
        let norm2 = dot(signal, signal);
        if !norm2.is_finite() {
            return None;
        }
        largest = largest.max(norm2);
        projections.push((dot(signal, &direction), i));
    }
    let near = SAME * largest.sqrt();
    projections.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut kept: Vec<(f64, usize)> = Vec::with_capacity(projections.len());
    for &(projection, i) in &projections {
        let signal = signals.column(i);
        let window = kept
            .iter()
            .rev()
            .take_while(|(other, _)| projection - other <= near);
        let mut copies = window.map(|&(_, j)| distance2(signal, signals.column(j)));
        if copies.all(|distance2| distance2 > near * near) {
            kept.push((projection, i));
        }
    }
    let mut numbers: Vec<usize> = kept.into_iter().map(|(_, i)| i).collect();
    numbers.sort_unstable();
    Some(numbers)
}

/// A fixed vector of unit norm with no regularity that signals could share.
fn direction(length: usize) -> Vec<f64> {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let mut values: Vec<f64> = (0..length)
        .map(|i| ((i + 1) as f64 * golden).fract() + 0.1)
        .collect();
    let norm = dot(&values, &values).sqrt();
    values.iter_mut().for_each(|v| *v /= norm);
    values
}

fn distance2(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// L initial atoms, M × L: distinct training signals in random order, jittered, unit norm. `distinct` must hold at
/// least L numbers.
pub(super) fn initial_atoms(
    signals: &Columns<'_>,
    distinct: &[usize],
    count: usize,
    random: &mut ChaCha8Rng,
) -> Mat<f64> {
    let mut drawn = distinct.to_vec();
    let (drawn, _) = drawn.partial_shuffle(random, count);
    let mut atoms = Mat::zeros(signals.dimension(), count);
    for (k, &i) in drawn.iter().enumerate() {
        let atom = jittered(signals.column(i), random);
        atoms.col_as_slice_mut(k).copy_from_slice(&atom);
    }
    atoms
}

/// The signal with jitter, at unit norm; a random direction where the signal is zero.
pub(super) fn jittered(signal: &[f64], random: &mut ChaCha8Rng) -> Vec<f64> {
    let norm = dot(signal, signal).sqrt();
    let size = if norm > 0.0 { JITTER * norm } else { 1.0 };
    // Uniform on (−1, 1) has variance 1/3.
    let scale = size * (3.0 / signal.len() as f64).sqrt();
    let mut atom: Vec<f64> = signal
        .iter()
        .map(|v| v + scale * random.random_range(-1.0..1.0))
        .collect();
    let norm = dot(&atom, &atom).sqrt();
    if norm > 0.0 {
        atom.iter_mut().for_each(|v| *v /= norm);
    }
    atom
}
