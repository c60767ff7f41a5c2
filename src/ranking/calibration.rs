//! How sure an answer is, and when a query belongs to none of the classes: conformal prediction (Vovk, Gammerman,
//! Shafer 2005) over the scores of training shapes that their class was learnt without.
//!
//! A class's score of a shape of its own varies from shape to shape by a factor that is much the same everywhere, about
//! a level of the class's own. So the nonconformity of a score s with class c is a = (ln s − μ_c) / σ_c, with μ_c and σ_c
//! the mean and deviation of ln s over the class's held-out shapes, σ_c shrunk towards what all classes have in common.
//! Held-out shapes of all classes together are the sample a query is compared with: where 5 in 100 of them fit their
//! own class as badly as the query fits c, the query's p-value for c is 0.05.

use std::collections::BTreeMap;

/// A class is believed possible while its p-value is above this; the true class then is, for 95 of 100 queries that are
/// like the training shapes.
pub const SIGNIFICANCE: f64 = 0.05;
/// How many held-out shapes the common deviation counts for beside a class's own.
const COMMON_DEVIATION_WEIGHT: f64 = 10.0;
/// Fewer held-out shapes cannot give a p-value of 0.05.
const FEWEST: usize = 19;
/// A deviation is at least this: classes of copies of one shape have none.
const LEAST_DEVIATION: f64 = 1e-3;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Level {
    mean: f64,
    deviation: f64,
}

impl Level {
    fn nonconformity(&self, log_score: f64) -> f64 {
        (log_score - self.mean) / self.deviation
    }
}

/// What scores shapes of the indexed classes usually have.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    levels: BTreeMap<String, Level>,
    /// Ascending.
    nonconformities: Vec<f64>,
}

/// What an answer can be believed to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// p-values in the order of the ranking; `None` for a class without held-out shapes.
    pub p_values: Vec<Option<f64>>,
    /// Whether no class is possible, and the best one was judged: the query is of none of them.
    pub none_of_these: bool,
}

impl Calibration {
    /// Takes every class's scores of its held-out shapes. `None` where all classes together have fewer than 19, which
    /// can refuse nothing at 5 in 100.
    pub fn fit<'a>(held_out: impl IntoIterator<Item = (&'a str, &'a [f64])>) -> Option<Self> {
        let classes: Vec<(&str, Vec<f64>)> = held_out
            .into_iter()
            .map(|(label, scores)| {
                let logs = scores.iter().filter(|&&s| s > 0.0).map(|s| s.ln()).collect();
                (label, logs)
            })
            .filter(|(_, logs): &(_, Vec<f64>)| !logs.is_empty())
            .collect();
        let mean = |logs: &[f64]| logs.iter().sum::<f64>() / logs.len() as f64;
        let spread = |logs: &[f64]| {
            let m = mean(logs);
            logs.iter().map(|x| (x - m) * (x - m)).sum::<f64>()
        };
        let freedom: usize = classes.iter().map(|(_, logs)| logs.len() - 1).sum();
        let common = classes.iter().map(|(_, logs)| spread(logs)).sum::<f64>() / freedom.max(1) as f64;
        let level = |logs: &[f64]| {
            let variance = (spread(logs) + COMMON_DEVIATION_WEIGHT * common)
                / (logs.len() as f64 - 1.0 + COMMON_DEVIATION_WEIGHT);
            Level {
                mean: mean(logs),
                deviation: variance.sqrt().max(LEAST_DEVIATION),
            }
        };
        let levels: BTreeMap<String, Level> = classes
            .iter()
            .map(|(label, logs)| ((*label).to_owned(), level(logs)))
            .collect();
        // Each is measured against the level of its class's others, as a query is against a level it had no part in.
        let mut nonconformities = Vec::new();
        for (_, logs) in classes.iter().filter(|(_, logs)| logs.len() > 1) {
            for (i, x) in logs.iter().enumerate() {
                let others = [&logs[..i], &logs[i + 1..]].concat();
                nonconformities.push(level(&others).nonconformity(*x));
            }
        }
        if nonconformities.len() < FEWEST {
            return None;
        }
        nonconformities.sort_unstable_by(f64::total_cmp);
        Some(Self {
            levels,
            nonconformities,
        })
    }

    /// Share of held-out shapes that fit their own class no better than a shape of this score fits the given one:
    /// (1 + #{aᵢ ≥ a}) / (N + 1), above 0, at most 1. `None` for a class without held-out shapes.
    pub fn p_value(&self, label: &str, score: f64) -> Option<f64> {
        let level = self.levels.get(label)?;
        if score <= 0.0 {
            return Some(1.0);
        }
        let a = level.nonconformity(score.ln());
        let below = self.nonconformities.partition_point(|x| *x < a);
        let n = self.nonconformities.len();
        Some((1 + n - below) as f64 / (n + 1) as f64)
    }

    /// Judges a ranking, given as labels and scores, best first.
    pub fn judge<'a>(&self, ranked: impl IntoIterator<Item = (&'a str, f64)>) -> Verdict {
        let p_values: Vec<Option<f64>> = ranked
            .into_iter()
            .map(|(label, score)| self.p_value(label, score))
            .collect();
        let judged = p_values.first().is_some_and(Option::is_some);
        let none_of_these = judged && p_values.iter().flatten().all(|p| *p <= SIGNIFICANCE);
        Verdict {
            p_values,
            none_of_these,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 20 scores about `level`, by a factor of at most 1.1.
    fn around(level: f64) -> Vec<f64> {
        (0..20)
            .map(|i| level * 1.1f64.powf(f64::from(i) / 9.5 - 1.0))
            .collect()
    }

    fn two_classes() -> Calibration {
        let (cats, dogs) = (around(0.3), around(0.6));
        Calibration::fit([("cat", cats.as_slice()), ("dog", dogs.as_slice())]).expect("enough shapes")
    }

    #[test]
    fn levels_belong_to_classes() {
        let calibration = two_classes();
        // 0.4 is a bad cat and, being lower than any dog's, a fine dog.
        assert!(calibration.p_value("cat", 0.4).expect("known") < 0.03);
        assert_eq!(calibration.p_value("dog", 0.4), Some(1.0));
        assert_eq!(calibration.p_value("cow", 0.4), None);
        // The median cat is as good as half of all shapes.
        let median = calibration.p_value("cat", 0.3).expect("known");
        assert!((median - 0.5).abs() < 0.03, "{median}");
    }

    #[test]
    fn p_values_of_the_held_out_shapes_themselves_are_uniform() {
        let calibration = two_classes();
        for (share, score) in around(0.6).into_iter().enumerate() {
            let p = calibration.p_value("dog", score).expect("known");
            // The k-th best of 20 is as good as a share (20 − k) / 20 of all, up to the two halves of one step.
            let expected = 1.0 - share as f64 / 20.0;
            assert!((p - expected).abs() < 0.08, "{share}: {p}");
        }
        let beyond = 0.6 * 1.1 * 1.03;
        assert!(calibration.p_value("dog", beyond).expect("known") <= SIGNIFICANCE);
    }

    #[test]
    fn none_of_these_needs_every_judged_class_to_refuse() {
        let calibration = two_classes();
        assert!(calibration.judge([("cat", 0.5), ("dog", 0.9)]).none_of_these);
        assert!(!calibration.judge([("cat", 0.5), ("dog", 0.6)]).none_of_these);
        // The best class cannot be judged, so nothing is claimed.
        assert!(!calibration.judge([("cow", 0.1), ("cat", 0.5)]).none_of_these);
    }

    #[test]
    fn too_few_shapes_calibrate_nothing() {
        let few = [0.3; 18];
        assert_eq!(Calibration::fit([("cat", few.as_slice())]), None);
        assert_eq!(Calibration::fit([("cat", [].as_slice())]), None);
        let copies = [0.3; 19];
        let calibration = Calibration::fit([("cat", copies.as_slice())]).expect("enough");
        assert_eq!(calibration.p_value("cat", 0.3), Some(1.0));
        assert_eq!(calibration.p_value("cat", 0.31), Some(0.05));
    }
}
