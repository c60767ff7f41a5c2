//! Run-time choice of the vector instructions our own inner loops are compiled for.

/// What the processor offers, detected once per solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simd {
    /// AVX-512F, eight doubles.
    Avx512,
    /// AVX2 with fused multiply-add, four doubles.
    Avx2,
    /// Whatever the crate was compiled for.
    Baseline,
}

impl Simd {
    /// The widest set this processor has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("fma") {
                return Self::Avx512;
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                return Self::Avx2;
            }
        }
        Self::Baseline
    }
}

/// a·b + c, fused where the instruction set has it: without it `mul_add` would be a slow library call.
#[inline(always)]
pub fn fused<const FMA: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// Defines `$name`, which runs the `#[inline(always)]` generic `$body::<FMA, …>` compiled for the detected set.
macro_rules! dispatch {
    ($(#[$meta:meta])* $vis:vis fn $name:ident<$(const $b:ident: usize),+>($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? => $body:ident) => {
        $(#[$meta])*
        $vis fn $name<$(const $b: usize),+>(simd: $crate::spectral::simd::Simd, $($arg: $ty),*) $(-> $ret)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx2,fma")]
                fn avx512<$(const $b: usize),+>($($arg: $ty),*) $(-> $ret)? { $body::<true, $($b),+>($($arg),*) }
                #[target_feature(enable = "avx2,fma")]
                fn avx2<$(const $b: usize),+>($($arg: $ty),*) $(-> $ret)? { $body::<true, $($b),+>($($arg),*) }
                match simd {
                    // SAFETY: `Simd::detect` saw the features on this processor.
                    $crate::spectral::simd::Simd::Avx512 => return unsafe { avx512::<$($b),+>($($arg),*) },
                    // SAFETY: as above.
                    $crate::spectral::simd::Simd::Avx2 => return unsafe { avx2::<$($b),+>($($arg),*) },
                    $crate::spectral::simd::Simd::Baseline => {}
                }
            }
            let _ = simd;
            $body::<false, $($b),+>($($arg),*)
        }
    };
}
pub(super) use dispatch;
