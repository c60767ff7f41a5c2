//! A lower triangular matrix, row after row without the zeros.

/// Where row `row` begins.
#[inline(always)]
pub(super) fn start(row: usize) -> usize {
    row * (row + 1) / 2
}
