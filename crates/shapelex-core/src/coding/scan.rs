//! Passes over the gradient of all atoms at single precision, written so that the compiler makes vectors of them.
//!
//! Rows are padded with zeros to whole [`Lanes`]; a zero violates nothing.

use super::rows::{LANES, Lanes, Rows};

/// Goes to the form for AVX-512 where the processor has it.
macro_rules! wide {
    ($pass:ident($($argument:expr),*)) => {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx512f") {
            // SAFETY: the function needs nothing but AVX-512F, which was just detected.
            return unsafe { super::wide::$pass($($argument),*) };
        }
    };
}

/// max |q|, values that are not a number left out.
#[inline(always)]
pub(super) fn largest_magnitude(gradient: &[Lanes]) -> f32 {
    wide!(largest_magnitude(gradient));
    let mut largest = [0f32; LANES];
    for piece in gradient {
        raise(&mut largest, piece);
    }
    fold(largest)
}

#[inline(always)]
fn raise(largest: &mut Lanes, piece: &Lanes) {
    for (l, q) in largest.iter_mut().zip(piece) {
        *l = if q.abs() > *l { q.abs() } else { *l };
    }
}

#[inline(always)]
fn fold(mut largest: Lanes) -> f32 {
    for width in [8, 4, 2, 1] {
        for k in 0..width {
            let other = largest[k + width];
            largest[k] = if other > largest[k] { other } else { largest[k] };
        }
    }
    largest[0]
}

/// q ← q − step · g, then max |q| as [`largest_magnitude`].
#[inline(always)]
pub(super) fn step_along(gradient: &mut [Lanes], gram: &[Lanes], step: f32) -> f32 {
    wide!(step_along(gradient, gram, step));
    let mut largest = [0f32; LANES];
    for (piece, row) in gradient.iter_mut().zip(gram) {
        for k in 0..LANES {
            piece[k] -= step * row[k];
        }
        raise(&mut largest, piece);
    }
    fold(largest)
}

/// gradient ← c − Σ a_j g_j over the given atoms j with their values a_j, one after the other; then max |q| as
/// [`largest_magnitude`].
#[inline(always)]
pub(super) fn residual_gradient(
    gradient: &mut [Lanes],
    correlation: &[Lanes],
    gram: &Rows,
    atoms: &[usize],
    values: &[f64],
) -> f32 {
    wide!(residual_gradient(gradient, correlation, gram, atoms, values));
    gradient.copy_from_slice(correlation);
    for (&j, &value) in atoms.iter().zip(values) {
        let value = value as f32;
        let row = gram.row(j).as_flattened();
        for (q, g) in gradient.as_flattened_mut().iter_mut().zip(row) {
            *q -= value * g;
        }
    }
    largest_magnitude(gradient)
}

/// The first place with |q| = `magnitude`.
#[inline(always)]
pub(super) fn place_of(gradient: &[Lanes], magnitude: f32) -> Option<usize> {
    wide!(place_of(gradient, magnitude));
    for (n, piece) in gradient.iter().enumerate() {
        let mut found = 0u32;
        for (k, q) in piece.iter().enumerate() {
            found |= u32::from(q.abs() == magnitude) << k;
        }
        if found != 0 {
            return Some(n * LANES + found.trailing_zeros() as usize);
        }
    }
    None
}

/// Where on the way from `here` to `there` each |q_j| that ends above `limit` meets the level, which falls from `high`
/// to `low`, as a share of the way; 2 for the others. Returns the least.
#[inline(always)]
pub(super) fn first_crossing(
    crossings: &mut [Lanes],
    here: &[Lanes],
    there: &[Lanes],
    [high, low, limit]: [f32; 3],
) -> f32 {
    wide!(first_crossing(crossings, here, there, [high, low, limit]));
    let mut least = [2f32; LANES];
    for ((crossings, here), there) in crossings.iter_mut().zip(here).zip(there) {
        for k in 0..LANES {
            let (from, to) = (here[k], there[k]);
            let before = high - from * 1f32.copysign(to);
            let before = if before > 0.0 { before } else { 0.0 };
            let share = before / (before + (to.abs() - low));
            let share = if to.abs() > limit { share } else { 2.0 };
            crossings[k] = share;
            least[k] = if share < least[k] { share } else { least[k] };
        }
    }
    least.into_iter().fold(2.0, |l, x| if x < l { x } else { l })
}

/// q ← q + share · (there − q).
#[inline(always)]
pub(super) fn move_towards(here: &mut [Lanes], there: &[Lanes], share: f32) {
    wide!(move_towards(here, there, share));
    for (here, there) in here.iter_mut().zip(there) {
        for k in 0..LANES {
            here[k] += share * (there[k] - here[k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coding::rows::pieces;

    /// `length` values of either sign, padded.
    fn row(length: usize, seed: usize) -> Vec<Lanes> {
        let mut row = vec![[0.0; LANES]; pieces(length)];
        for (j, value) in row.as_flattened_mut()[..length].iter_mut().enumerate() {
            *value = ((j * 37 + seed * 101) as f32 * 0.77).sin();
        }
        row
    }

    fn largest_of(values: &[f32]) -> f32 {
        values.iter().fold(0.0, |l, q| l.max(q.abs()))
    }

    #[test]
    fn values_that_are_not_a_number_are_passed_over() {
        for length in [2, 15, 16, 17, 40, 300] {
            let mut gradient = vec![[0.0; LANES]; pieces(length)];
            for (j, value) in gradient.as_flattened_mut()[..length].iter_mut().enumerate() {
                *value = -(j as f32);
            }
            gradient.as_flattened_mut()[length - 1] = f32::NAN;
            let largest = largest_magnitude(&gradient);
            assert_eq!(largest, length as f32 - 2.0);
            assert_eq!(place_of(&gradient, largest), Some(length - 2));
            assert_eq!(place_of(&gradient, 999.0), None);
            let ones = vec![[1.0; LANES]; gradient.len()];
            assert_eq!(step_along(&mut gradient, &ones, 2.0), length as f32);
            assert!(gradient.as_flattened()[length - 1].is_nan());
        }
    }

    #[test]
    fn every_form_of_a_pass_rounds_as_its_definition_does() {
        for length in [1, 16, 100, 128, 200, 500] {
            let columns: Vec<Vec<f64>> = (0..length)
                .map(|j| (0..length).map(|i| ((i * j) as f64).cos()).collect())
                .collect();
            let gram = Rows::new(columns.iter().map(|column| &column[..]));
            let correlation = row(length, 1);
            for count in [0, 1, 2, 7] {
                let atoms: Vec<usize> = (0..count).map(|k| k * 5 % length).collect();
                let values: Vec<f64> = (0..count).map(|k| 0.3 + 0.1 * k as f64).collect();
                let mut found = row(length, 2);
                let largest = residual_gradient(&mut found, &correlation, &gram, &atoms, &values);
                let mut wanted = correlation.as_flattened().to_vec();
                for (&j, &value) in atoms.iter().zip(&values) {
                    for (q, g) in wanted.iter_mut().zip(&columns[j]) {
                        *q -= value as f32 * *g as f32;
                    }
                }
                assert_eq!(found.as_flattened(), wanted);
                assert_eq!(largest, largest_of(&wanted));
            }
        }
    }

    #[test]
    fn crossings_are_where_the_gradient_meets_the_level() {
        for length in [1, 16, 100, 500] {
            let (mut here, there) = (row(length, 1), row(length, 2));
            let mut crossings = row(length, 3);
            let [high, low, limit] = [1.0, 0.25, 0.26];
            let first = first_crossing(&mut crossings, &here, &there, [high, low, limit]);
            let mut least = 2.0;
            let pairs = here.as_flattened().iter().zip(there.as_flattened());
            for ((from, to), found) in pairs.zip(crossings.as_flattened()) {
                if to.abs() <= limit {
                    assert_eq!(*found, 2.0);
                    continue;
                }
                let before = (high - from * to.signum()).max(0.0);
                let wanted = before / (before + (to.abs() - low));
                assert_eq!(*found, wanted);
                assert!((0.0..=1.0).contains(found));
                least = wanted.min(least);
            }
            assert_eq!(first, least);
            let wanted: Vec<f32> = here
                .as_flattened()
                .iter()
                .zip(there.as_flattened())
                .map(|(a, b)| a + 0.3 * (b - a))
                .collect();
            move_towards(&mut here, &there, 0.3);
            assert_eq!(here.as_flattened(), wanted);
        }
    }
}
