//! How finely the coordinates of a file were written.

/// With fewer digits than this, a text says nothing about rounding: `0.5` and `1` are exact where they stand alone.
const FEWEST_DIGITS: u32 = 5;

/// A number of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Decimal {
    pub value: f64,
    /// Significant digits it was written with, trailing zeros included; 0 where it was not written in digits.
    pub digits: u32,
}

impl Decimal {
    /// A number that was not written in digits.
    pub fn exact(value: f64) -> Self {
        Self { value, digits: 0 }
    }

    /// A number as its text has it.
    #[inline]
    pub fn written(text: &[u8], value: f64) -> Self {
        let mut digits = 0;
        for &b in text {
            match b {
                b'1'..=b'9' => digits += 1,
                b'0' => digits += u32::from(digits > 0),
                b'e' | b'E' => break,
                _ => {}
            }
        }
        Self { value, digits }
    }
}

/// In which form a file holds its coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Written {
    /// In decimal digits.
    Text,
    /// As 32-bit floats.
    Single,
    /// As 64-bit floats or integers.
    Exact,
}

/// Collects what the coordinates tell about the step of their last digit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Precision {
    digits: u32,
    largest: f64,
}

impl Precision {
    /// Takes note of a coordinate.
    #[inline]
    pub fn note(&mut self, coordinate: Decimal) {
        self.digits = self.digits.max(coordinate.digits);
        let magnitude = coordinate.value.abs();
        if magnitude > self.largest && magnitude <= super::soup::MAX_COORDINATE {
            self.largest = magnitude;
        }
    }

    /// The largest step of the last digit over all coordinates.
    ///
    /// Text: writers use a fixed number of decimals, or a fixed number of significant digits of which trailing zeros
    /// may be left out. Either way the largest number would have as many significant digits as any of the file's, s;
    /// with e its decimal exponent the step is 10^(e + 1 − s). 0 for s < 5. Single: the distance from the largest
    /// number to the next 32-bit float.
    pub fn resolution(&self, written: Written) -> f64 {
        if self.largest == 0.0 {
            return 0.0;
        }
        match written {
            Written::Exact => 0.0,
            Written::Single => {
                let largest = self.largest as f32;
                f64::from(largest.next_up()) - f64::from(largest)
            }
            Written::Text if self.digits < FEWEST_DIGITS => 0.0,
            Written::Text => {
                let text = format!("{:e}", self.largest);
                let exponent = text.rsplit_once('e').and_then(|(_, e)| e.parse::<i32>().ok());
                let digits = i32::try_from(self.digits).unwrap_or(i32::MAX);
                exponent.map_or(0.0, |e| 10f64.powi((e + 1).saturating_sub(digits)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolution(words: &[&str]) -> f64 {
        let mut precision = Precision::default();
        for word in words {
            precision.note(Decimal::written(word.as_bytes(), word.parse().expect("a number")));
        }
        precision.resolution(Written::Text)
    }

    #[test]
    fn the_last_digit_of_the_largest_number_counts() {
        let close = |words: &[&str], expected: f64| {
            let found = resolution(words);
            assert!((found - expected).abs() <= 1e-12 * expected, "{words:?}: {found}");
        };
        // %f, %g and %e of the same numbers.
        close(&["0.500000", "-12.345679", "0.000000"], 1e-6);
        close(&["0.5", "-12.3457", "0"], 1e-4);
        close(&["5.000000e-01", "-1.234568e+01"], 1e-5);
        close(&["1000", "0.12345"], 1e-1);
        close(&["0.1234567890123456"], 1e-16);
        // Few digits are exact.
        close(&["0", "1", "-0.5", "1000"], 0.0);
        close(&["0", "0.000"], 0.0);
    }

    #[test]
    fn binary_singles_have_their_own_step() {
        let mut precision = Precision::default();
        precision.note(Decimal::exact(-1.5));
        precision.note(Decimal::exact(f64::NAN));
        assert_eq!(precision.resolution(Written::Single), 2f64.powi(-23));
        assert_eq!(precision.resolution(Written::Exact), 0.0);
        assert_eq!(precision.resolution(Written::Text), 0.0);
    }
}
