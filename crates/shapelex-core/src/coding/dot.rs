//! Inner products at double precision, in sixteen sums side by side.
//!
//! The forms for AVX2 and AVX-512 add the same numbers in the same order as the portable one and round each product, so
//! all give the same result to the last bit. Compilers make poor vectors of the portable form: with AVX2 allowed, half
//! as wide as there is room for.

/// Sums side by side.
const LANES: usize = 16;

/// xᵀy, of as many terms as the shorter has.
#[inline(always)]
pub(super) fn dot(x: &[f64], y: &[f64]) -> f64 {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") {
            // SAFETY: the function needs nothing but AVX-512F, which was just detected.
            return unsafe { wide::dot512(x, y) };
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the function needs nothing but AVX2, which was just detected.
            return unsafe { wide::dot256(x, y) };
        }
    }
    portable(x, y)
}

#[inline(always)]
fn portable(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let terms = x.len().min(y.len());
    for (a, b) in x[..terms].chunks(LANES).zip(y[..terms].chunks(LANES)) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    for width in [8, 4, 2, 1] {
        for k in 0..width {
            sums[k] += sums[k + width];
        }
    }
    sums[0]
}

#[cfg(target_arch = "x86_64")]
pub(super) mod wide {
    use super::LANES;
    use std::arch::x86_64::*;

    /// As [`super::dot`].
    #[inline]
    #[target_feature(enable = "avx512f")]
    pub fn dot512(x: &[f64], y: &[f64]) -> f64 {
        let terms = x.len().min(y.len());
        let (mut low, mut high) = (_mm512_setzero_pd(), _mm512_setzero_pd());
        let (x, y) = (&x[..terms], &y[..terms]);
        let (pieces, others) = (x.chunks_exact(LANES), y.chunks_exact(LANES));
        let (tail, other) = (pieces.remainder(), others.remainder());
        for (a, b) in pieces.zip(others) {
            // SAFETY: both pieces are sixteen values, and loads need no alignment.
            let [a0, a1, b0, b1] = unsafe {
                [
                    _mm512_loadu_pd(a.as_ptr()),
                    _mm512_loadu_pd(a.as_ptr().add(8)),
                    _mm512_loadu_pd(b.as_ptr()),
                    _mm512_loadu_pd(b.as_ptr().add(8)),
                ]
            };
            low = _mm512_add_pd(low, _mm512_mul_pd(a0, b0));
            high = _mm512_add_pd(high, _mm512_mul_pd(a1, b1));
        }
        let (first, second) = (tail.len().min(8), tail.len().saturating_sub(8));
        if first > 0 {
            low = _mm512_add_pd(low, _mm512_mul_pd(load(&tail[..first]), load(&other[..first])));
        }
        if second > 0 {
            high = _mm512_add_pd(high, _mm512_mul_pd(load(&tail[8..]), load(&other[8..])));
        }
        sum_of_eight(_mm512_add_pd(low, high))
    }

    /// The upper half added to the lower, and so on.
    #[inline]
    #[target_feature(enable = "avx512f")]
    pub fn sum_of_eight(eight: __m512d) -> f64 {
        sum_of_four(_mm256_add_pd(
            _mm512_castpd512_pd256(eight),
            _mm512_extractf64x4_pd::<1>(eight),
        ))
    }

    /// Up to eight values, zeros behind.
    #[inline]
    #[target_feature(enable = "avx512f")]
    fn load(values: &[f64]) -> __m512d {
        let mask = if values.len() < 8 {
            (1 << values.len()) - 1
        } else {
            0xff
        };
        // SAFETY: the mask keeps the load within the values.
        unsafe { _mm512_maskz_loadu_pd(mask, values.as_ptr()) }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn sum_of_four(four: __m256d) -> f64 {
        let two = _mm_add_pd(_mm256_castpd256_pd128(four), _mm256_extractf128_pd::<1>(four));
        _mm_cvtsd_f64(_mm_add_sd(two, _mm_unpackhi_pd(two, two)))
    }

    /// As [`super::dot`].
    #[target_feature(enable = "avx2")]
    pub fn dot256(x: &[f64], y: &[f64]) -> f64 {
        let terms = x.len().min(y.len());
        let mut sums = [_mm256_setzero_pd(); 4];
        let (x, y) = (&x[..terms], &y[..terms]);
        let (pieces, others) = (x.chunks_exact(LANES), y.chunks_exact(LANES));
        let (tail, other) = (pieces.remainder(), others.remainder());
        for (a, b) in pieces.zip(others) {
            for (k, sum) in sums.iter_mut().enumerate() {
                // SAFETY: both pieces are sixteen values, and loads need no alignment.
                let (a, b) = unsafe {
                    (
                        _mm256_loadu_pd(a.as_ptr().add(4 * k)),
                        _mm256_loadu_pd(b.as_ptr().add(4 * k)),
                    )
                };
                *sum = _mm256_add_pd(*sum, _mm256_mul_pd(a, b));
            }
        }
        for ((a, b), sum) in tail.chunks(4).zip(other.chunks(4)).zip(&mut sums) {
            let (mut left, mut right) = ([0.0; 4], [0.0; 4]);
            left[..a.len()].copy_from_slice(a);
            right[..b.len()].copy_from_slice(b);
            // SAFETY: both are four values, and loads need no alignment.
            let (a, b) = unsafe { (_mm256_loadu_pd(left.as_ptr()), _mm256_loadu_pd(right.as_ptr())) };
            *sum = _mm256_add_pd(*sum, _mm256_mul_pd(a, b));
        }
        let [a, b, c, d] = sums;
        sum_of_four(_mm256_add_pd(_mm256_add_pd(a, c), _mm256_add_pd(b, d)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_forms_give_the_same_to_the_last_bit() {
        let wave = |k: f64| move |i: usize| (i as f64 * k).sin() * 10f64.powi(i as i32 % 7);
        for terms in 0..70 {
            let x: Vec<f64> = (0..terms).map(wave(0.7)).collect();
            let y: Vec<f64> = (0..terms + terms % 3).map(wave(1.3)).collect();
            let expected = portable(&x, &y);
            let exact: f64 = x.iter().zip(&y).map(|(a, b)| a * b).sum();
            let size: f64 = x.iter().zip(&y).map(|(a, b)| (a * b).abs()).sum();
            assert!((expected - exact).abs() <= 1e-14 * size);
            assert_eq!(dot(&x, &y), expected, "{terms}");
            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the function needs nothing but AVX2, which was just detected.
                assert_eq!(unsafe { wide::dot256(&x, &y) }, expected, "{terms}");
            }
        }
    }
}
