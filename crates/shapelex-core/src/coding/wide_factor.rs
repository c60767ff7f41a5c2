//! Solves with [`super::cholesky::Factor`] for processors with AVX-512. Each does the same sequence of roundings as its
//! portable form, so both give the same numbers.

use super::dot::wide::sum_of_eight;
use super::packed::start;
use std::arch::x86_64::*;

/// As [`super::cholesky::Factor::solve_lower`].
#[target_feature(enable = "avx512f")]
pub(super) fn solve_lower(rows: &[f64], inverse_diagonal: &[f64], x: &mut [f64]) {
    for i in 0..x.len() {
        let row = &rows[start(i)..start(i) + i];
        let (pieces, row_tail) = row.as_chunks::<8>();
        let (others, tail) = x[..i].as_chunks::<8>();
        let mut last = 0.0;
        for (a, b) in row_tail.iter().zip(tail) {
            last += a * b;
        }
        let mut sums = _mm512_setzero_pd();
        for (a, b) in pieces.iter().zip(others) {
            sums = _mm512_add_pd(sums, _mm512_mul_pd(load(a), load(b)));
        }
        x[i] = (x[i] - (sum_of_eight(sums) + last)) * inverse_diagonal[i];
    }
}

/// As [`super::cholesky::Factor::solve_upper`]. Eight unknowns at a time stay in a register until they are known: in
/// memory, each would be written just before it is read as part of a vector, which processors make wait.
#[target_feature(enable = "avx512f")]
pub(super) fn solve_upper(rows: &[f64], inverse_diagonal: &[f64], x: &mut [f64]) {
    let count = x.len();
    for first in (0..count).step_by(8).rev() {
        let end = count.min(first + 8);
        let mut here = load_some(&x[first..end]);
        for i in (end..count).rev() {
            let row = &rows[start(i) + first..start(i) + end];
            here = _mm512_sub_pd(here, _mm512_mul_pd(_mm512_set1_pd(x[i]), load_some(row)));
        }
        for i in (first..end).rev() {
            let lane = i - first;
            let value = _mm512_mul_pd(
                _mm512_permutexvar_pd(_mm512_set1_epi64(lane as i64), here),
                _mm512_set1_pd(inverse_diagonal[i]),
            );
            here = _mm512_mask_mov_pd(here, 1 << lane, value);
            let row = load_some(&rows[start(i) + first..start(i) + i]);
            here = _mm512_mask_sub_pd(here, (1 << lane) - 1, here, _mm512_mul_pd(value, row));
        }
        // SAFETY: the mask keeps the store within the values.
        unsafe { _mm512_mask_storeu_pd(x[first..end].as_mut_ptr(), mask(end - first), here) };
    }
}

/// Up to eight values, zeros behind.
#[inline]
#[target_feature(enable = "avx512f")]
fn load_some(values: &[f64]) -> __m512d {
    // SAFETY: the mask keeps the load within the values.
    unsafe { _mm512_maskz_loadu_pd(mask(values.len()), values.as_ptr()) }
}

/// The lowest `count` of eight lanes.
#[inline]
fn mask(count: usize) -> __mmask8 {
    if count < 8 { (1 << count) - 1 } else { 0xff }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load(values: &[f64; 8]) -> __m512d {
    // SAFETY: eight values, and the load needs no alignment.
    unsafe { _mm512_loadu_pd(values.as_ptr()) }
}
