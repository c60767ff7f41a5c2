//! The vector instructions of our own inner loops, chosen at run time.
//!
//! Left to itself the compiler turns loops over small arrays of doubles into gathers and shuffles; so the kernels are
//! written over [`Vector`], once, and compiled for each instruction set.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

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
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("fma")
            {
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

/// N doubles worked on together, in registers. Values of the processor's own types exist only inside of functions that
/// [`kernel!`] compiles for their instruction set.
pub trait Vector: Copy {
    /// How many.
    const N: usize;
    /// # Safety
    /// N doubles can be read at `from`.
    unsafe fn load(from: *const f64) -> Self;
    /// # Safety
    /// N doubles can be written at `to`.
    unsafe fn store(self, to: *mut f64);
    /// N times `x`.
    fn splat(x: f64) -> Self;
    /// self + b.
    fn plus(self, b: Self) -> Self;
    /// self · b.
    fn times(self, b: Self) -> Self;
    /// self / b.
    fn over(self, b: Self) -> Self;
    /// √self.
    fn root(self) -> Self;
    /// self · b + c.
    fn times_plus(self, b: Self, c: Self) -> Self;
    /// c − self · b.
    fn times_from(self, b: Self, c: Self) -> Self;
}

/// Reads a row.
#[inline(always)]
pub fn load<V: Vector, const B: usize>(row: &[f64; B]) -> V {
    assert!(B == V::N);
    // SAFETY: the row has N numbers.
    unsafe { V::load(row.as_ptr()) }
}

/// Writes a row.
#[inline(always)]
pub fn store<V: Vector, const B: usize>(row: &mut [f64; B], v: V) {
    assert!(B == V::N);
    // SAFETY: the row has N numbers.
    unsafe { v.store(row.as_mut_ptr()) }
}

impl Vector for f64 {
    const N: usize = 1;
    #[inline(always)]
    unsafe fn load(from: *const f64) -> Self {
        // SAFETY: the caller's promise.
        unsafe { *from }
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f64) {
        // SAFETY: the caller's promise.
        unsafe { *to = self }
    }
    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn plus(self, b: Self) -> Self {
        self + b
    }
    #[inline(always)]
    fn times(self, b: Self) -> Self {
        self * b
    }
    #[inline(always)]
    fn over(self, b: Self) -> Self {
        self / b
    }
    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn times_plus(self, b: Self, c: Self) -> Self {
        self * b + c
    }
    #[inline(always)]
    fn times_from(self, b: Self, c: Self) -> Self {
        c - self * b
    }
}

impl<V: Vector, const K: usize> Vector for [V; K] {
    const N: usize = K * V::N;
    #[inline(always)]
    unsafe fn load(from: *const f64) -> Self {
        // SAFETY: part k begins V::N numbers after part k − 1, and all are within the N promised.
        std::array::from_fn(|k| unsafe { V::load(from.add(k * V::N)) })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f64) {
        for (k, v) in self.into_iter().enumerate() {
            // SAFETY: as in `load`.
            unsafe { v.store(to.add(k * V::N)) }
        }
    }
    #[inline(always)]
    fn splat(x: f64) -> Self {
        [V::splat(x); K]
    }
    #[inline(always)]
    fn plus(self, b: Self) -> Self {
        std::array::from_fn(|k| self[k].plus(b[k]))
    }
    #[inline(always)]
    fn times(self, b: Self) -> Self {
        std::array::from_fn(|k| self[k].times(b[k]))
    }
    #[inline(always)]
    fn over(self, b: Self) -> Self {
        std::array::from_fn(|k| self[k].over(b[k]))
    }
    #[inline(always)]
    fn root(self) -> Self {
        std::array::from_fn(|k| self[k].root())
    }
    #[inline(always)]
    fn times_plus(self, b: Self, c: Self) -> Self {
        std::array::from_fn(|k| self[k].times_plus(b[k], c[k]))
    }
    #[inline(always)]
    fn times_from(self, b: Self, c: Self) -> Self {
        std::array::from_fn(|k| self[k].times_from(b[k], c[k]))
    }
}

/// One of the processor's own vector types.
#[cfg(target_arch = "x86_64")]
macro_rules! native {
    ($type:ty, $n:literal, $load:ident, $store:ident, $splat:ident, $add:ident, $mul:ident, $div:ident, $sqrt:ident, $fma:ident, $fnma:ident) => {
        impl Vector for $type {
            const N: usize = $n;
            #[inline(always)]
            unsafe fn load(from: *const f64) -> Self {
                // SAFETY: the caller's promise; the instruction set is there wherever the type is used. So below.
                unsafe { $load(from) }
            }
            #[inline(always)]
            unsafe fn store(self, to: *mut f64) {
                // SAFETY: as above.
                unsafe { $store(to, self) }
            }
            #[inline(always)]
            fn splat(x: f64) -> Self {
                // SAFETY: as above.
                unsafe { $splat(x) }
            }
            #[inline(always)]
            fn plus(self, b: Self) -> Self {
                // SAFETY: as above.
                unsafe { $add(self, b) }
            }
            #[inline(always)]
            fn times(self, b: Self) -> Self {
                // SAFETY: as above.
                unsafe { $mul(self, b) }
            }
            #[inline(always)]
            fn over(self, b: Self) -> Self {
                // SAFETY: as above.
                unsafe { $div(self, b) }
            }
            #[inline(always)]
            fn root(self) -> Self {
                // SAFETY: as above.
                unsafe { $sqrt(self) }
            }
            #[inline(always)]
            fn times_plus(self, b: Self, c: Self) -> Self {
                // SAFETY: as above.
                unsafe { $fma(self, b, c) }
            }
            #[inline(always)]
            fn times_from(self, b: Self, c: Self) -> Self {
                // SAFETY: as above.
                unsafe { $fnma(self, b, c) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
native!(
    __m256d,
    4,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
    _mm256_set1_pd,
    _mm256_add_pd,
    _mm256_mul_pd,
    _mm256_div_pd,
    _mm256_sqrt_pd,
    _mm256_fmadd_pd,
    _mm256_fnmadd_pd
);
#[cfg(target_arch = "x86_64")]
native!(
    __m512d,
    8,
    _mm512_loadu_pd,
    _mm512_storeu_pd,
    _mm512_set1_pd,
    _mm512_add_pd,
    _mm512_mul_pd,
    _mm512_div_pd,
    _mm512_sqrt_pd,
    _mm512_fmadd_pd,
    _mm512_fnmadd_pd
);

/// A row of a block, and what holds it in registers.
pub trait Row: Copy {
    /// With AVX-512.
    type Avx512: Vector;
    /// With AVX2 and fused multiply-add.
    type Avx2: Vector;
    /// Without either.
    type Baseline: Vector;
}

macro_rules! row {
    ($n:literal, $avx512:ty, $avx2:ty) => {
        impl Row for [f64; $n] {
            #[cfg(target_arch = "x86_64")]
            type Avx512 = $avx512;
            #[cfg(target_arch = "x86_64")]
            type Avx2 = $avx2;
            #[cfg(not(target_arch = "x86_64"))]
            type Avx512 = [f64; $n];
            #[cfg(not(target_arch = "x86_64"))]
            type Avx2 = [f64; $n];
            type Baseline = [f64; $n];
        }
    };
}

row!(4, __m256d, __m256d);
row!(8, __m512d, [__m256d; 2]);
row!(16, [__m512d; 2], [__m256d; 4]);
row!(32, [__m512d; 4], [__m256d; 8]);

/// Defines `$name`, which runs the `#[inline(always)]` generic `$body::<FMA, …>` compiled for the detected set.
macro_rules! dispatch {
    ($(#[$meta:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? => $body:ident) => {
        $(#[$meta])*
        $vis fn $name(simd: $crate::spectral::simd::Simd, $($arg: $ty),*) $(-> $ret)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx2,fma")]
                fn avx512($($arg: $ty),*) $(-> $ret)? { $body::<true>($($arg),*) }
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $ty),*) $(-> $ret)? { $body::<true>($($arg),*) }
                match simd {
                    // SAFETY: `Simd::detect` saw the features on this processor.
                    $crate::spectral::simd::Simd::Avx512 => return unsafe { avx512($($arg),*) },
                    // SAFETY: as above.
                    $crate::spectral::simd::Simd::Avx2 => return unsafe { avx2($($arg),*) },
                    $crate::spectral::simd::Simd::Baseline => {}
                }
            }
            let _ = simd;
            $body::<false>($($arg),*)
        }
    };
}
pub(super) use dispatch;

/// Defines `$name`, which runs the `#[inline(always)]` generic `$body::<V, …>` compiled for the detected set, with V
/// what holds a row of `$row` numbers there.
macro_rules! kernel {
    ($(#[$meta:meta])* $vis:vis fn $name:ident<const $row:ident: usize $(, const $b:ident: usize)*>($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? => $body:ident) => {
        $(#[$meta])*
        $vis fn $name<const $row: usize $(, const $b: usize)*>(simd: $crate::spectral::simd::Simd, $($arg: $ty),*) $(-> $ret)?
        where
            [f64; $row]: $crate::spectral::simd::Row,
        {
            use $crate::spectral::simd::Row;
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx2,fma")]
                fn avx512<const $row: usize $(, const $b: usize)*>($($arg: $ty),*) $(-> $ret)?
                where
                    [f64; $row]: Row,
                {
                    $body::<<[f64; $row] as Row>::Avx512, $row $(, $b)*>($($arg),*)
                }
                #[target_feature(enable = "avx2,fma")]
                fn avx2<const $row: usize $(, const $b: usize)*>($($arg: $ty),*) $(-> $ret)?
                where
                    [f64; $row]: Row,
                {
                    $body::<<[f64; $row] as Row>::Avx2, $row $(, $b)*>($($arg),*)
                }
                match simd {
                    // SAFETY: `Simd::detect` saw the features on this processor.
                    $crate::spectral::simd::Simd::Avx512 => return unsafe { avx512::<$row $(, $b)*>($($arg),*) },
                    // SAFETY: as above.
                    $crate::spectral::simd::Simd::Avx2 => return unsafe { avx2::<$row $(, $b)*>($($arg),*) },
                    $crate::spectral::simd::Simd::Baseline => {}
                }
            }
            let _ = simd;
            $body::<<[f64; $row] as Row>::Baseline, $row $(, $b)*>($($arg),*)
        }
    };
}
pub(super) use kernel;
