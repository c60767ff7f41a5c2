//! One step's products with the blocks next to the new one, each a single sweep over memory.
//!
//! A block W just solved for is orthogonalised against the two blocks before it and the null vector, twice, and its
//! Gram matrix is taken for the QR factorisation. Taken one by one those are a dozen sweeps over four blocks; row by
//! row they are three.

use super::block_qr::Small;
use super::simd::{Vector, kernel, load, store};

/// What a new block is orthogonalised against at every step.
pub struct Near<'a, const B: usize> {
    /// The block before the current one, zeros if there is none.
    pub previous: &'a [[f64; B]],
    pub current: &'a [[f64; B]],
    /// The null vector, zeros unless there is exactly one.
    pub null: &'a [f64],
}

/// Products of W with its neighbours.
#[derive(Clone, Copy)]
pub struct Products<const B: usize> {
    /// V₋ᵀW.
    pub previous: Small<B>,
    /// VᵀW.
    pub current: Small<B>,
    /// NᵀW.
    pub null: [f64; B],
    /// Squared norms of W's columns.
    pub squares: [f64; B],
}

kernel! {
    /// The products of W with its neighbours.
    pub fn products<const B: usize>(near: &Near<'_, B>, w: &[[f64; B]]) -> Products<B> => products_body
}

kernel! {
    /// W ← W − V₋ (V₋ᵀW) − V (VᵀW) − N (NᵀW) with the products given; returns those of the new W.
    pub fn subtract<const B: usize>(near: &Near<'_, B>, w: &mut [[f64; B]], h: &Products<B>) -> Products<B>
        => subtract_body
}

kernel! {
    /// As [`subtract`], but returns WᵀW of the new W.
    pub fn subtract_last<const B: usize>(near: &Near<'_, B>, w: &mut [[f64; B]], h: &Products<B>) -> Small<B>
        => subtract_last_body
}

/// Products being summed up.
struct Sums<V, const B: usize> {
    previous: [V; B],
    current: [V; B],
    null: V,
    squares: V,
}

impl<V: Vector, const B: usize> Sums<V, B> {
    #[inline(always)]
    fn new() -> Self {
        let zero = V::splat(0.0);
        Self {
            previous: [zero; B],
            current: [zero; B],
            null: zero,
            squares: zero,
        }
    }

    #[inline(always)]
    fn add(&mut self, previous: &[f64; B], current: &[f64; B], null: f64, w: V) {
        for k in 0..B {
            self.previous[k] = V::splat(previous[k]).times_plus(w, self.previous[k]);
            self.current[k] = V::splat(current[k]).times_plus(w, self.current[k]);
        }
        self.null = V::splat(null).times_plus(w, self.null);
        self.squares = w.times_plus(w, self.squares);
    }

    #[inline(always)]
    fn read(self) -> Products<B> {
        let mut out = Products {
            previous: [[0.0; B]; B],
            current: [[0.0; B]; B],
            null: [0.0; B],
            squares: [0.0; B],
        };
        for k in 0..B {
            store(&mut out.previous[k], self.previous[k]);
            store(&mut out.current[k], self.current[k]);
        }
        store(&mut out.null, self.null);
        store(&mut out.squares, self.squares);
        out
    }
}

/// One row of W less its parts along the neighbours.
#[inline(always)]
fn less<V: Vector, const B: usize>(
    w: &[f64; B],
    previous: &[f64; B],
    current: &[f64; B],
    null: f64,
    h: &Products<B>,
) -> V {
    // Two chains of sums, which the processor can work on side by side.
    let mut one: V = load(w);
    let mut other = V::splat(null).times_from(load(&h.null), V::splat(0.0));
    for k in 0..B {
        one = V::splat(previous[k]).times_from(load(&h.previous[k]), one);
        other = V::splat(current[k]).times_from(load(&h.current[k]), other);
    }
    one.plus(other)
}

#[inline(always)]
fn products_body<V: Vector, const B: usize>(near: &Near<'_, B>, w: &[[f64; B]]) -> Products<B> {
    let mut sums = Sums::<V, B>::new();
    for (((p, c), n), w) in near.previous.iter().zip(near.current).zip(near.null).zip(w) {
        sums.add(p, c, *n, load(w));
    }
    sums.read()
}

#[inline(always)]
fn subtract_body<V: Vector, const B: usize>(
    near: &Near<'_, B>,
    w: &mut [[f64; B]],
    h: &Products<B>,
) -> Products<B> {
    let mut sums = Sums::<V, B>::new();
    for (((p, c), n), w) in near.previous.iter().zip(near.current).zip(near.null).zip(w) {
        let rest = less::<V, B>(w, p, c, *n, h);
        store(w, rest);
        sums.add(p, c, *n, rest);
    }
    sums.read()
}

#[inline(always)]
fn subtract_last_body<V: Vector, const B: usize>(
    near: &Near<'_, B>,
    w: &mut [[f64; B]],
    h: &Products<B>,
) -> Small<B> {
    let mut gram = [V::splat(0.0); B];
    for (((p, c), n), w) in near.previous.iter().zip(near.current).zip(near.null).zip(w) {
        let rest = less::<V, B>(w, p, c, *n, h);
        store(w, rest);
        for (sum, x) in gram.iter_mut().zip(w.iter()) {
            *sum = V::splat(*x).times_plus(rest, *sum);
        }
    }
    let mut out = [[0.0; B]; B];
    for (row, sum) in out.iter_mut().zip(gram) {
        store(row, sum);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::block_qr::inner;
    use super::super::simd::Simd;
    use super::*;

    #[test]
    fn three_sweeps_leave_nothing_along_the_neighbours() {
        let n = 37;
        let entry = |i: usize, k: usize| ((i * (k + 3)) as f64 * 0.7 + k as f64).sin();
        // Orthonormal: scaled cosines.
        let cosine = |i: usize, k: usize| {
            let frequency = k as f64 * std::f64::consts::PI / n as f64;
            (if k == 0 { 1.0f64 } else { 2.0 } / n as f64).sqrt() * (frequency * (i as f64 + 0.5)).cos()
        };
        for simd in [Simd::detect(), Simd::Baseline] {
            let block = |first: usize| -> Vec<[f64; 4]> {
                (0..n)
                    .map(|i| std::array::from_fn(|k| cosine(i, first + k)))
                    .collect()
            };
            let (previous, current) = (block(1), block(5));
            let null: Vec<f64> = (0..n).map(|i| cosine(i, 0)).collect();
            let near = Near::<4> {
                previous: &previous,
                current: &current,
                null: &null,
            };
            let mut w: Vec<[f64; 4]> = (0..n).map(|i| std::array::from_fn(|k| entry(i, k))).collect();
            let h = products::<4>(simd, &near, &w);
            let direct: f64 = (0..n).map(|i| current[i][1] * w[i][2]).sum();
            assert!((h.current[1][2] - direct).abs() < 1e-13);
            let left = subtract::<4>(simd, &near, &mut w, &h);
            let all = left
                .previous
                .iter()
                .chain(&left.current)
                .flatten()
                .chain(&left.null);
            assert!(all.fold(0.0f64, |m, x| m.max(x.abs())) < 1e-14);
            let gram = subtract_last::<4>(simd, &near, &mut w, &left);
            let expected = inner::<4>(simd, &w, &w);
            assert!((0..4).all(|i| (0..4).all(|j| (gram[i][j] - expected[i][j]).abs() < 1e-13)));
        }
    }
}
