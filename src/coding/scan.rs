//! Passes over the gradient of all atoms at single precision, written so that the compiler makes vectors of them.

/// Values looked at side by side.
const LANES: usize = 16;

/// max |q|, values that are not a number left out.
#[inline(always)]
pub(super) fn largest_magnitude(gradient: &[f32]) -> f32 {
    let mut largest = [0f32; LANES];
    let (chunks, rest) = gradient.as_chunks::<LANES>();
    for chunk in chunks {
        for (l, q) in largest.iter_mut().zip(chunk) {
            *l = if q.abs() > *l { q.abs() } else { *l };
        }
    }
    fold(largest, rest)
}

/// q ← q − step · g, then max |q| as [`largest_magnitude`].
#[inline(always)]
pub(super) fn step_along(gradient: &mut [f32], gram: &[f32], step: f32) -> f32 {
    let mut largest = [0f32; LANES];
    let (chunks, rest) = gradient.as_chunks_mut::<LANES>();
    let (columns, column_rest) = gram.as_chunks::<LANES>();
    for (chunk, column) in chunks.iter_mut().zip(columns) {
        for ((l, q), g) in largest.iter_mut().zip(chunk).zip(column) {
            *q -= step * g;
            *l = if q.abs() > *l { q.abs() } else { *l };
        }
    }
    for (q, g) in rest.iter_mut().zip(column_rest) {
        *q -= step * g;
    }
    fold(largest, rest)
}

#[inline(always)]
fn fold(largest: [f32; LANES], rest: &[f32]) -> f32 {
    let rest = rest.iter().map(|q| q.abs());
    largest
        .into_iter()
        .chain(rest)
        .fold(0.0, |l, q| if q > l { q } else { l })
}

/// The first place with |q| = `magnitude`.
#[inline(always)]
pub(super) fn place_of(gradient: &[f32], magnitude: f32) -> Option<usize> {
    for (n, chunk) in gradient.chunks(LANES).enumerate() {
        let mut any = false;
        for q in chunk {
            any |= q.abs() == magnitude;
        }
        if any {
            let place = chunk.iter().position(|q| q.abs() == magnitude)?;
            return Some(n * LANES + place);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_are_not_a_number_are_passed_over() {
        for length in [1, 15, 16, 17, 40] {
            let mut gradient: Vec<f32> = (0..length).map(|j| -(j as f32)).collect();
            gradient[length - 1] = f32::NAN;
            let largest = largest_magnitude(&gradient);
            assert_eq!(largest, (length as f32 - 2.0).max(0.0));
            if length > 1 {
                assert_eq!(place_of(&gradient, largest), Some(length - 2));
            }
            assert_eq!(place_of(&gradient, 99.0), None);
            let ones = vec![1.0; length];
            assert_eq!(
                step_along(&mut gradient, &ones, 2.0),
                if length > 1 { length as f32 } else { 0.0 }
            );
            assert!(gradient[length - 1].is_nan());
        }
    }
}
