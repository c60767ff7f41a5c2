//! A query's signals in few: groups of signals that are alike, each by its mean.

use faer::{Mat, MatRef};

/// Values a signal is grouped by: sums over as many stretches of it.
pub(super) const SUMMARY: usize = 16;
/// Steps of the power iteration that finds the axis along which a group is widest; it need not be exact.
const POWER_STEPS: usize = 4;

/// See [`summaries`].
pub(super) type Summary = [f64; SUMMARY];

/// Means of groups of the columns of `signals` (M × N), a matrix M × K for every K in `sizes` (ascending): the widest
/// group is cut at its mean, across the axis along which it is widest, until there are as many. Groups of a larger
/// number are parts of those of a smaller one. There are fewer groups where signals coincide.
pub(super) fn group_means(signals: MatRef<'_, f64>, summaries: &[Summary], sizes: &[usize]) -> Vec<Mat<f64>> {
    let mut members: Vec<u32> = (0..signals.ncols() as u32).collect();
    let mut parts = vec![Part::new(summaries, &members, 0)];
    let mut result = Vec::with_capacity(sizes.len());
    for &size in sizes {
        while parts.len() < size {
            let widest = (0..parts.len()).max_by(|&a, &b| parts[a].spread.total_cmp(&parts[b].spread));
            let Some(widest) = widest.filter(|&w| parts[w].spread > 0.0) else {
                break;
            };
            let part = parts[widest].clone();
            let range = part.start..part.start + part.len;
            let cut = part.start + part.divide(summaries, &mut members[range.clone()]);
            if cut == range.start || cut == range.end {
                // Rounding hides the spread.
                parts[widest].spread = 0.0;
                continue;
            }
            parts[widest] = Part::new(summaries, &members[range.start..cut], range.start);
            parts.push(Part::new(summaries, &members[cut..range.end], cut));
        }
        result.push(means(signals, &members, &parts));
    }
    result
}

/// Members `start..start + len` of the list of signals, which is rearranged as groups are cut.
#[derive(Clone, Debug)]
struct Part {
    start: usize,
    len: usize,
    mean: Summary,
    /// Sum of squared distances from the mean.
    spread: f64,
}

impl Part {
    fn new(summaries: &[Summary], members: &[u32], start: usize) -> Self {
        let mut mean = [0.0; SUMMARY];
        for &i in members {
            for (m, s) in mean.iter_mut().zip(&summaries[i as usize]) {
                *m += s;
            }
        }
        mean.iter_mut().for_each(|m| *m /= members.len().max(1) as f64);
        let mut spread = 0.0;
        for &i in members {
            for (m, s) in mean.iter().zip(&summaries[i as usize]) {
                spread += (s - m) * (s - m);
            }
        }
        Self {
            start,
            len: members.len(),
            mean,
            spread,
        }
    }

    /// Brings the members on one side of the cut to the front and says how many they are.
    fn divide(&self, summaries: &[Summary], members: &mut [u32]) -> usize {
        let along = |axis: &Summary, i: u32| {
            let mut sum = 0.0;
            for ((a, s), m) in axis.iter().zip(&summaries[i as usize]).zip(&self.mean) {
                sum += a * (s - m);
            }
            sum
        };
        // Starts from the axis of coordinates that varies most.
        let mut variances = [0.0; SUMMARY];
        for &i in members.iter() {
            for ((v, s), m) in variances.iter_mut().zip(&summaries[i as usize]).zip(&self.mean) {
                *v += (s - m) * (s - m);
            }
        }
        let mut widest = 0;
        for k in 1..SUMMARY {
            if variances[k] > variances[widest] {
                widest = k;
            }
        }
        let mut axis = [0.0; SUMMARY];
        axis[widest] = 1.0;
        for _ in 0..POWER_STEPS {
            let mut next = [0.0; SUMMARY];
            for &i in members.iter() {
                let weight = along(&axis, i);
                for ((n, s), m) in next.iter_mut().zip(&summaries[i as usize]).zip(&self.mean) {
                    *n += weight * (s - m);
                }
            }
            let norm = next.iter().map(|x| x * x).sum::<f64>().sqrt();
            if norm == 0.0 || !norm.is_finite() {
                break;
            }
            axis = next.map(|x| x / norm);
        }
        let mut front = 0;
        for i in 0..members.len() {
            if along(&axis, members[i]) < 0.0 {
                members.swap(front, i);
                front += 1;
            }
        }
        front
    }
}

fn means(signals: MatRef<'_, f64>, members: &[u32], parts: &[Part]) -> Mat<f64> {
    let mut means = Mat::zeros(signals.nrows(), parts.len());
    for (k, part) in parts.iter().enumerate() {
        let mut mean = means.col_mut(k);
        for &i in &members[part.start..part.start + part.len] {
            mean += signals.col(i as usize);
        }
        let count = part.len.max(1) as f64;
        mean.iter_mut().for_each(|m| *m /= count);
    }
    means
}

/// Sums over [`SUMMARY`] stretches of each signal, in units that make distances about those of the signals.
pub(super) fn summaries(signals: MatRef<'_, f64>) -> Vec<Summary> {
    let stretch = signals.nrows().div_ceil(SUMMARY).max(1);
    let unit = (stretch as f64).sqrt().recip();
    (0..signals.ncols())
        .map(|j| {
            let mut summary = [0.0; SUMMARY];
            for i in 0..signals.nrows() {
                summary[i / stretch] += unit * signals[(i, j)];
            }
            summary
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_as_many_groups_as_asked_for_and_finer_ones_lie_closer() {
        let signals = Mat::from_fn(40, 300, |i, j| ((i as f64) * 0.1 + (j as f64) * 0.02).sin());
        let all = group_means(signals.as_ref(), &summaries(signals.as_ref()), &[1, 8, 64]);
        let farthest = |means: &Mat<f64>| {
            (0..300)
                .map(|j| {
                    (0..means.ncols())
                        .map(|k| (signals.col(j) - means.col(k)).norm_l2())
                        .fold(f64::INFINITY, f64::min)
                })
                .fold(0.0, f64::max)
        };
        assert_eq!([1, 8, 64], [0, 1, 2].map(|k: usize| all[k].ncols()));
        assert!(farthest(&all[1]) < 0.6 * farthest(&all[0]));
        assert!(farthest(&all[2]) < 0.4 * farthest(&all[1]));
    }

    #[test]
    fn equal_signals_make_one_group() {
        let signals = Mat::from_fn(5, 20, |i, _| i as f64 * 0.3);
        let all = group_means(signals.as_ref(), &summaries(signals.as_ref()), &[8]);
        assert_eq!(all[0].ncols(), 1);
        assert!((all[0][(4, 0)] - 1.2).abs() < 1e-12);
    }
}
