//! The inner loops compiled twice, for any processor and for those with AVX2, chosen at run time.
//!
//! Both run the same sequence of roundings, so they give the same numbers. This is the only place of the coding that
//! needs `unsafe`.

use super::signals::{self, Summary};
use super::{CodingError, Dictionary, Signals, Workspace};
use crate::cancel::Cancel;
use std::ops::Range;

/// [`Workspace::code_block`] in the fastest form this processor runs.
pub(super) fn code_block(
    workspace: &mut Workspace,
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    block: Range<usize>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<(), CodingError> {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the function needs nothing but AVX2, which was just detected.
        return unsafe { code_block_avx2(workspace, dictionary, signals, block, lambda, cancel) };
    }
    workspace.code_block(dictionary, signals, block, lambda, cancel)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn code_block_avx2(
    workspace: &mut Workspace,
    dictionary: &Dictionary,
    signals: &Signals<'_>,
    block: Range<usize>,
    lambda: f64,
    cancel: &Cancel,
) -> Result<(), CodingError> {
    workspace.code_block(dictionary, signals, block, lambda, cancel)
}

/// [`signals::chain`] in the fastest form this processor runs.
pub(super) fn chain(summaries: &[Summary], length: usize) -> Vec<usize> {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the function needs nothing but AVX2, which was just detected.
        return unsafe { chain_avx2(summaries, length) };
    }
    signals::chain(summaries, length)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn chain_avx2(summaries: &[Summary], length: usize) -> Vec<usize> {
    signals::chain(summaries, length)
}
