//! Inner loops compiled twice, for any processor and for those with AVX2, chosen at run time.
//!
//! Both run the same sequence of roundings, so they give the same numbers. The passes of `scan`, which compilers make
//! poor vectors of, have forms of their own for AVX-512.

/// A loop worth compiling for wider registers. `run` must be `#[inline(always)]`, and so must whatever it calls in
/// its loops, or it keeps to the narrow ones.
pub(super) trait Kernel {
    type Output;

    fn run(self) -> Self::Output;
}

/// Runs the kernel in the fastest form this processor has.
pub(super) fn fastest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the function needs nothing but AVX2, which was just detected.
        return unsafe { with_avx2(kernel) };
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
