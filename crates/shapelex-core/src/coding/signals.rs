//! Signals made ready to be coded, once for however many dictionaries.

use super::CodingError;
use super::dispatch::{Kernel, fastest};
use super::dot::dot;
use super::problem::column;
use faer::{Mat, MatRef};

/// N signals with what the Lasso needs of them under any dictionary.
#[derive(Clone, Debug)]
pub struct Signals<'a> {
    values: Values<'a>,
    /// ‖s‖² of each.
    pub(super) norms2: Vec<f64>,
}

/// The caller's signals, column-major.
#[derive(Clone, Debug)]
enum Values<'a> {
    Borrowed(MatRef<'a, f64>),
    Owned(Mat<f64>),
}

impl<'a> Signals<'a> {
    /// Takes the columns of `signals` (M × N); copies them at double precision only where a column is not contiguous.
    ///
    /// # Errors
    /// [`CodingError::NotFinite`] for NaN, infinity, or a norm beyond 1e18.
    pub fn new(signals: MatRef<'a, f64>) -> Result<Self, CodingError> {
        let values = if signals.row_stride() == 1 {
            Values::Borrowed(signals)
        } else {
            Values::Owned(signals.to_owned())
        };
        let norms2 = fastest(Norms {
            signals: values.get(),
        });
        // Beyond this, squares at single precision would overflow.
        if norms2.iter().any(|norm2| norm2.is_nan() || *norm2 > 1e36) {
            return Err(CodingError::NotFinite { what: "signature" });
        }
        Ok(Self { values, norms2 })
    }

    /// N.
    pub fn len(&self) -> usize {
        self.norms2.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.norms2.is_empty()
    }

    /// M.
    pub fn dimension(&self) -> usize {
        self.values.get().nrows()
    }

    /// Signal `i`.
    #[inline(always)]
    pub(super) fn signal(&self, i: usize) -> &[f64] {
        column(self.values.get(), i)
    }
}

impl Values<'_> {
    #[inline(always)]
    fn get(&self) -> MatRef<'_, f64> {
        match self {
            Values::Borrowed(values) => *values,
            Values::Owned(values) => values.as_ref(),
        }
    }
}

/// Squared norms of all signals.
struct Norms<'a> {
    signals: MatRef<'a, f64>,
}

impl Kernel for Norms<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run(self) -> Vec<f64> {
        let mut norms2 = Vec::with_capacity(self.signals.ncols());
        for i in 0..self.signals.ncols() {
            let signal = column(self.signals, i);
            norms2.push(dot(signal, signal));
        }
        norms2
    }
}
