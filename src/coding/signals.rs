//! Signals made ready to be coded, once for however many dictionaries.

use super::CodingError;
use super::cholesky::dot;
use super::dispatch::{Kernel, fastest};
use super::lasso::column;
use faer::{Mat, MatRef};

/// Length of the summary by which neighbours are found.
const SUMMARY: usize = 16;
/// Signals among which the next one is sought, at most: 256 find a neighbour nearly as good as all of them do.
const WINDOW: usize = 256;
/// Distances formed side by side.
const LANES: usize = 8;
/// A summary that is far from all others, for places of the window that hold none.
const FAR: f32 = 1e18;

/// N signals in an order in which neighbours are alike, with what the Lasso needs of them under any dictionary.
///
/// Coding walks from each signal to one like it, whose code is nearly its own; the order nearly halves the atoms that
/// change from one to the next against grouping by the atom that correlates most. It is a greedy chain: from each signal to the nearest of a
/// window of waiting ones, by the sums over 16 stretches of the values.
#[derive(Clone, Debug)]
pub struct Signals<'a> {
    values: Values<'a>,
    /// M × N at single precision, in the order of `order`, for the products that only sort out atoms.
    pub(super) single: Mat<f32>,
    /// ‖s‖² of each, in the order of `order`.
    pub(super) norms2: Vec<f64>,
    /// Number, in the caller's matrix, of each signal here.
    pub(super) order: Vec<usize>,
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
        let signals = values.get();
        let (m, n) = (signals.nrows(), signals.ncols());
        let order = fastest(Chain { signals });
        let (mut single, mut norms2) = (Mat::zeros(m, n), vec![0.0; n]);
        fastest(Round {
            signals,
            order: &order,
            single: &mut single,
            norms2: &mut norms2,
        });
        // Beyond this, squares at single precision would overflow.
        if norms2.iter().any(|norm2| norm2.is_nan() || *norm2 > 1e36) {
            return Err(CodingError::NotFinite { what: "signature" });
        }
        Ok(Self {
            values,
            single,
            norms2,
            order,
        })
    }

    /// N.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// M.
    pub fn dimension(&self) -> usize {
        self.single.nrows()
    }

    /// The `k`-th signal of the order.
    #[inline(always)]
    pub(super) fn signal(&self, k: usize) -> &[f64] {
        column(self.values.get(), self.order[k])
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

/// What neighbours are told by: sums over [`SUMMARY`] equal stretches of a signal.
type Summary = [f32; SUMMARY];

#[inline(always)]
fn summary(signal: &[f64], stretch: usize) -> Summary {
    let mut sums = [0.0; SUMMARY];
    for (sum, values) in sums.iter_mut().zip(signal.chunks(stretch)) {
        let (chunks, rest) = values.as_chunks::<4>();
        let mut lanes = [0.0; 4];
        for chunk in chunks {
            for (lane, value) in lanes.iter_mut().zip(chunk) {
                *lane += value;
            }
        }
        *sum = ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3]) + rest.iter().sum::<f64>()) as f32;
    }
    sums
}

/// The signals in `order` at single precision, and their squared norms.
struct Round<'a> {
    signals: MatRef<'a, f64>,
    order: &'a [usize],
    single: &'a mut Mat<f32>,
    norms2: &'a mut [f64],
}

impl Kernel for Round<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (k, (&i, norm2)) in self.order.iter().zip(self.norms2).enumerate() {
            let signal = column(self.signals, i);
            *norm2 = dot(signal, signal);
            for (to, from) in self.single.col_as_slice_mut(k).iter_mut().zip(signal) {
                *to = *from as f32;
            }
        }
    }
}

/// The greedy chain through all signals, from the first. The window grows with the length M of a signal, as what a
/// better neighbour saves does.
struct Chain<'a> {
    signals: MatRef<'a, f64>,
}

impl Kernel for Chain<'_> {
    type Output = Vec<usize>;

    #[inline(always)]
    fn run(self) -> Vec<usize> {
        let (length, count) = (self.signals.nrows(), self.signals.ncols());
        let stretch = length.div_ceil(SUMMARY).max(1);
        let mut summaries = Vec::with_capacity(count);
        for i in 0..count {
            summaries.push(summary(column(self.signals, i), stretch));
        }
        chain(&summaries, length)
    }
}

#[inline(always)]
fn chain(summaries: &[Summary], length: usize) -> Vec<usize> {
    let count = summaries.len();
    let mut order = Vec::with_capacity(count);
    let Some(first) = summaries.first() else {
        return order;
    };
    let mut here = *first;
    order.push(0);
    let width = (length / LANES * LANES).clamp(64, WINDOW);
    // Waiting summaries lie value by value, so that distances to several of them are formed side by side.
    let mut waiting = [[FAR; WINDOW]; SUMMARY];
    let mut numbers = [0; WINDOW];
    let mut distances = [0f32; WINDOW];
    let (mut filled, mut next) = (0, 1);
    while order.len() < count {
        while filled < width && next < count {
            for (values, value) in waiting.iter_mut().zip(&summaries[next]) {
                values[filled] = *value;
            }
            numbers[filled] = next;
            filled += 1;
            next += 1;
        }
        let mut least = [f32::INFINITY; LANES];
        for at in (0..width).step_by(LANES) {
            let mut sums = [0f32; LANES];
            for (values, value) in waiting.iter().zip(&here) {
                let values = &values[at..at + LANES];
                for k in 0..LANES {
                    let difference = values[k] - value;
                    sums[k] += difference * difference;
                }
            }
            for k in 0..LANES {
                least[k] = if sums[k] < least[k] { sums[k] } else { least[k] };
            }
            distances[at..at + LANES].copy_from_slice(&sums);
        }
        let least = least
            .iter()
            .fold(f32::INFINITY, |a, b| if *b < a { *b } else { a });
        // Nothing is found where a value is not a number; any order will do until that is reported.
        let nearest = distances[..filled].iter().position(|d| *d == least).unwrap_or(0);
        here = summaries[numbers[nearest]];
        order.push(numbers[nearest]);
        filled -= 1;
        numbers[nearest] = numbers[filled];
        for values in &mut waiting {
            values[nearest] = values[filled];
            values[filled] = FAR;
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chain_visits_every_signal_once() {
        for count in [0, 1, 2, 255, 256, 257, 1000] {
            let values = Mat::from_fn(5, count, |i, j| ((i * 31 + j * 17) % 101) as f64);
            let mut order = Signals::new(values.as_ref()).unwrap().order;
            order.sort_unstable();
            assert_eq!(order, (0..count).collect::<Vec<_>>());
        }
    }
}
