//! The passes of [`super::scan`] for processors with AVX-512, sixteen values at a time. Each does the same sequence of
//! roundings as its portable form, so both give the same numbers.

use super::rows::{Lanes, Rows};
use std::arch::x86_64::*;

/// Pieces of a row that are kept in registers while the terms are subtracted.
const BLOCK: usize = 8;

#[inline]
#[target_feature(enable = "avx512f")]
fn load(piece: &Lanes) -> __m512 {
    // SAFETY: a piece is sixteen values, and the load needs no alignment.
    unsafe { _mm512_loadu_ps(piece.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store(piece: &mut Lanes, values: __m512) {
    // SAFETY: a piece is sixteen values, and the store needs no alignment.
    unsafe { _mm512_storeu_ps(piece.as_mut_ptr(), values) }
}

/// As [`super::scan::largest_magnitude`].
#[target_feature(enable = "avx512f")]
pub(super) fn largest_magnitude(gradient: &[Lanes]) -> f32 {
    let mut largest = _mm512_setzero_ps();
    for piece in gradient {
        // Where one is not a number the second is returned.
        largest = _mm512_max_ps(_mm512_abs_ps(load(piece)), largest);
    }
    _mm512_reduce_max_ps(largest)
}

/// As [`super::scan::step_along`].
#[target_feature(enable = "avx512f")]
pub(super) fn step_along(gradient: &mut [Lanes], gram: &[Lanes], step: f32) -> f32 {
    let (mut largest, step) = (_mm512_setzero_ps(), _mm512_set1_ps(step));
    for (piece, row) in gradient.iter_mut().zip(gram) {
        let moved = _mm512_sub_ps(load(piece), _mm512_mul_ps(step, load(row)));
        largest = _mm512_max_ps(_mm512_abs_ps(moved), largest);
        store(piece, moved);
    }
    _mm512_reduce_max_ps(largest)
}

/// As [`super::scan::residual_gradient`].
#[target_feature(enable = "avx512f")]
pub(super) fn residual_gradient(
    gradient: &mut [Lanes],
    correlation: &[Lanes],
    gram: &Rows,
    atoms: &[usize],
    values: &[f64],
) -> f32 {
    let mut largest = _mm512_setzero_ps();
    let (blocks, rest) = gradient.as_chunks_mut::<BLOCK>();
    let (from, from_rest) = correlation.as_chunks::<BLOCK>();
    for (n, (block, from)) in blocks.iter_mut().zip(from).enumerate() {
        let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h] = [
            load(&from[0]),
            load(&from[1]),
            load(&from[2]),
            load(&from[3]),
            load(&from[4]),
            load(&from[5]),
            load(&from[6]),
            load(&from[7]),
        ];
        for (&j, &value) in atoms.iter().zip(values) {
            let row = &gram.row(j).as_chunks::<BLOCK>().0[n];
            let value = _mm512_set1_ps(value as f32);
            a = _mm512_sub_ps(a, _mm512_mul_ps(value, load(&row[0])));
            b = _mm512_sub_ps(b, _mm512_mul_ps(value, load(&row[1])));
            c = _mm512_sub_ps(c, _mm512_mul_ps(value, load(&row[2])));
            d = _mm512_sub_ps(d, _mm512_mul_ps(value, load(&row[3])));
            e = _mm512_sub_ps(e, _mm512_mul_ps(value, load(&row[4])));
            f = _mm512_sub_ps(f, _mm512_mul_ps(value, load(&row[5])));
            g = _mm512_sub_ps(g, _mm512_mul_ps(value, load(&row[6])));
            h = _mm512_sub_ps(h, _mm512_mul_ps(value, load(&row[7])));
        }
        for (piece, sum) in block.iter_mut().zip([a, b, c, d, e, f, g, h]) {
            store(piece, sum);
            largest = _mm512_max_ps(_mm512_abs_ps(sum), largest);
        }
    }
    let first = blocks.len() * BLOCK;
    for (n, (piece, from)) in rest.iter_mut().zip(from_rest).enumerate() {
        let mut sum = load(from);
        for (&j, &value) in atoms.iter().zip(values) {
            let row = load(&gram.row(j)[first + n]);
            sum = _mm512_sub_ps(sum, _mm512_mul_ps(_mm512_set1_ps(value as f32), row));
        }
        store(piece, sum);
        largest = _mm512_max_ps(_mm512_abs_ps(sum), largest);
    }
    _mm512_reduce_max_ps(largest)
}

/// As [`super::scan::place_of`].
#[target_feature(enable = "avx512f")]
pub(super) fn place_of(gradient: &[Lanes], magnitude: f32) -> Option<usize> {
    let wanted = _mm512_set1_ps(magnitude);
    for (n, piece) in gradient.iter().enumerate() {
        let found = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(_mm512_abs_ps(load(piece)), wanted);
        if found != 0 {
            return Some(n * Lanes::default().len() + found.trailing_zeros() as usize);
        }
    }
    None
}

/// As [`super::scan::first_crossing`].
#[target_feature(enable = "avx512f")]
pub(super) fn first_crossing(
    crossings: &mut [Lanes],
    here: &[Lanes],
    there: &[Lanes],
    [high, low, limit]: [f32; 3],
) -> f32 {
    let (high, low, limit) = (_mm512_set1_ps(high), _mm512_set1_ps(low), _mm512_set1_ps(limit));
    let never = _mm512_set1_ps(2.0);
    let sign = _mm512_castps_si512(_mm512_set1_ps(-0.0));
    let mut least = never;
    for ((crossings, here), there) in crossings.iter_mut().zip(here).zip(there) {
        let (from, to) = (load(here), load(there));
        let magnitude = _mm512_abs_ps(to);
        let violates = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(magnitude, limit);
        let mut share = never;
        if violates != 0 {
            let flip = _mm512_and_si512(_mm512_castps_si512(to), sign);
            let along = _mm512_castsi512_ps(_mm512_xor_si512(_mm512_castps_si512(from), flip));
            let before = _mm512_max_ps(_mm512_sub_ps(high, along), _mm512_setzero_ps());
            let sum = _mm512_add_ps(before, _mm512_sub_ps(magnitude, low));
            share = _mm512_mask_div_ps(never, violates, before, sum);
        }
        store(crossings, share);
        least = _mm512_min_ps(share, least);
    }
    _mm512_reduce_min_ps(least)
}

/// As [`super::scan::move_towards`].
#[target_feature(enable = "avx512f")]
pub(super) fn move_towards(here: &mut [Lanes], there: &[Lanes], share: f32) {
    let share = _mm512_set1_ps(share);
    for (here, there) in here.iter_mut().zip(there) {
        let from = load(here);
        let way = _mm512_sub_ps(load(there), from);
        store(here, _mm512_add_ps(from, _mm512_mul_ps(share, way)));
    }
}
