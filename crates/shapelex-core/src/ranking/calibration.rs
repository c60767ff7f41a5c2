//! How sure an answer is, and when a query belongs to none of the classes: conformal prediction (Vovk, Gammerman,
//! Shafer 2005) over the scores of training shapes that their class was learnt without.
//!
//! A class's score of a shape of its own varies from shape to shape by a factor that is much the same everywhere, about
//! a level of the class's own. So the nonconformity of a score s with class c is a = (ln s − μ_c) / σ_c, with μ_c and σ_c
//! the mean and deviation of ln s over the class's held-out shapes, σ_c shrunk towards what all classes have in common.
//! Held-out shapes of all classes together are the sample a query is compared with: where 5 in 100 of them fit their
//! own class as badly as the query fits c, the query's p-value for c is 0.05.
//!
//! A shape that has a near copy among those its class is learnt from is not held out, whatever is left out with it: it
//! says how well copies fit, and another pose fits worse. A class of nothing but near copies has no p-value, unless the
//! query fits it worse by far than any held-out shape fits its own class.

use super::not_judged::NotJudged;
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
/// A class of near copies refuses what is beyond its level by this many times as much as the worst held-out shape of any
/// other class is beyond its own.
const BEYOND_COPIES: f64 = 4.0;

/// Scores of a class's shapes under dictionaries that were learnt without them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOut<'a> {
    /// The class's label.
    pub label: &'a str,
    /// Of shapes without a near copy among those learnt from.
    pub scores: &'a [f64],
    /// Of shapes with one, where there are no others.
    pub copies: &'a [f64],
}

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
    /// Levels of classes of near copies, with the deviation of the others.
    copies: BTreeMap<String, Level>,
    /// Ascending.
    nonconformities: Vec<f64>,
}

/// What the scores of a ranking tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// p-values in the order of the ranking, or why a class has none.
    pub p_values: Vec<Result<f64, NotJudged>>,
    /// Whether no class is possible: the best one was judged, and no other may be possible for all that is known of it.
    pub none_of_these: bool,
}

impl Calibration {
    /// Takes every class's held-out shapes.
    ///
    /// # Errors
    /// [`NotJudged::TooFewShapes`] where all classes together have fewer than 19, which can refuse nothing at 5 in 100;
    /// [`NotJudged::NearCopies`] where that is because shapes are near copies.
    pub fn fit<'a>(held_out: impl IntoIterator<Item = HeldOut<'a>>) -> Result<Self, NotJudged> {
        let logs = |scores: &[f64]| -> Vec<f64> {
            let positive = scores.iter().filter(|&&s| s > 0.0);
            positive.map(|s| s.ln()).collect()
        };
        let (mut classes, mut copied) = (Vec::new(), Vec::new());
        for class in held_out {
            let (scores, copies) = (logs(class.scores), logs(class.copies));
            if !scores.is_empty() {
                classes.push((class.label, scores));
            } else if !copies.is_empty() {
                copied.push((class.label, copies));
            }
        }
        let common = common_variance(&classes);
        let levels: BTreeMap<String, Level> = classes
            .iter()
            .map(|(label, logs)| ((*label).to_owned(), level(logs, common)))
            .collect();
        // Each is measured against the level of its class's others, as a query is against a level it had no part in.
        let mut nonconformities = Vec::new();
        for (_, logs) in classes.iter().filter(|(_, logs)| logs.len() > 1) {
            for (i, x) in logs.iter().enumerate() {
                let others = [&logs[..i], &logs[i + 1..]].concat();
                nonconformities.push(level(&others, common).nonconformity(*x));
            }
        }
        if nonconformities.len() < FEWEST {
            let with_copies =
                nonconformities.len() + copied.iter().map(|(_, logs)| logs.len()).sum::<usize>();
            return Err(if with_copies < FEWEST {
                NotJudged::TooFewShapes
            } else {
                NotJudged::NearCopies
            });
        }
        nonconformities.sort_unstable_by(f64::total_cmp);
        let borrowed = |logs: &[f64]| Level {
            mean: mean(logs),
            deviation: common.sqrt().max(LEAST_DEVIATION),
        };
        Ok(Self {
            levels,
            copies: copied
                .iter()
                .map(|(label, logs)| ((*label).to_owned(), borrowed(logs)))
                .collect(),
            nonconformities,
        })
    }

    /// Share of held-out shapes that fit their own class no better than a shape of this score fits the given one:
    /// (1 + #{aᵢ ≥ a}) / (N + 1), above 0, at most 1.
    ///
    /// # Errors
    /// [`NotJudged::TooFewShapes`] for a class without held-out shapes; [`NotJudged::NearCopies`] for one of near copies
    /// that does not refuse the shape by far.
    pub fn p_value(&self, label: &str, score: f64) -> Result<f64, NotJudged> {
        let a = |level: &Level| {
            if score > 0.0 {
                level.nonconformity(score.ln())
            } else {
                f64::NEG_INFINITY
            }
        };
        let Some(level) = self.levels.get(label) else {
            let level = self.copies.get(label).ok_or(NotJudged::TooFewShapes)?;
            let worst = self.nonconformities.last().copied().unwrap_or(f64::INFINITY);
            let beyond = a(level) > BEYOND_COPIES * worst.max(0.0);
            return beyond.then(|| self.least_p_value()).ok_or(NotJudged::NearCopies);
        };
        let a = a(level);
        let below = self.nonconformities.partition_point(|x| *x < a);
        let n = self.nonconformities.len();
        Ok((1 + n - below) as f64 / (n + 1) as f64)
    }

    /// The smallest p-value there is, 1 / (N + 1).
    pub fn least_p_value(&self) -> f64 {
        ((self.nonconformities.len() + 1) as f64).recip()
    }

    /// Judges a ranking, given as labels and scores, best first.
    pub fn judge<'a>(&self, ranked: impl IntoIterator<Item = (&'a str, f64)>) -> Judgement {
        let p_values: Vec<Result<f64, NotJudged>> = ranked
            .into_iter()
            .map(|(label, score)| self.p_value(label, score))
            .collect();
        let impossible = |p: &Result<f64, NotJudged>| match p {
            Ok(p) => *p <= SIGNIFICANCE,
            Err(reason) => *reason != NotJudged::NearCopies,
        };
        let judged = p_values.first().is_some_and(Result::is_ok);
        Judgement {
            none_of_these: judged && p_values.iter().all(impossible),
            p_values,
        }
    }
}

fn mean(logs: &[f64]) -> f64 {
    logs.iter().sum::<f64>() / logs.len() as f64
}

/// Σ (x − mean)².
fn spread(logs: &[f64]) -> f64 {
    let m = mean(logs);
    logs.iter().map(|x| (x - m) * (x - m)).sum()
}

/// The variance within classes, of all classes together.
fn common_variance(classes: &[(&str, Vec<f64>)]) -> f64 {
    let freedom: usize = classes.iter().map(|(_, logs)| logs.len() - 1).sum();
    classes.iter().map(|(_, logs)| spread(logs)).sum::<f64>() / freedom.max(1) as f64
}

/// The level of some shapes of a class, its variance shrunk towards the common one.
fn level(logs: &[f64], common: f64) -> Level {
    let variance = (spread(logs) + COMMON_DEVIATION_WEIGHT * common)
        / (logs.len() as f64 - 1.0 + COMMON_DEVIATION_WEIGHT);
    Level {
        mean: mean(logs),
        deviation: variance.sqrt().max(LEAST_DEVIATION),
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

    fn distinct<'a>(label: &'a str, scores: &'a [f64]) -> HeldOut<'a> {
        HeldOut {
            label,
            scores,
            copies: &[],
        }
    }

    fn two_classes() -> Calibration {
        let (cats, dogs) = (around(0.3), around(0.6));
        Calibration::fit([distinct("cat", &cats), distinct("dog", &dogs)]).expect("enough shapes")
    }

    #[test]
    fn levels_belong_to_classes() {
        let calibration = two_classes();
        // 0.4 is a bad cat and, being lower than any dog's, a fine dog.
        assert!(calibration.p_value("cat", 0.4).expect("known") < 0.03);
        assert_eq!(calibration.p_value("dog", 0.4), Ok(1.0));
        assert_eq!(calibration.p_value("cow", 0.4), Err(NotJudged::TooFewShapes));
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
        let too_few = Err(NotJudged::TooFewShapes);
        assert_eq!(Calibration::fit([distinct("cat", &few)]), too_few);
        assert_eq!(Calibration::fit([distinct("cat", &[])]), too_few);
        let copies = [0.3; 19];
        let calibration = Calibration::fit([distinct("cat", &copies)]).expect("enough");
        assert_eq!(calibration.p_value("cat", 0.3), Ok(1.0));
        assert_eq!(calibration.p_value("cat", 0.31), Ok(0.05));
    }

    #[test]
    fn a_class_of_near_copies_refuses_only_what_is_far_beyond() {
        let (cats, dogs) = (around(0.3), around(0.6));
        let walk = [0.4; 12];
        let walking = HeldOut {
            label: "cow",
            scores: &[],
            copies: &walk,
        };
        let calibration =
            Calibration::fit([distinct("cat", &cats), distinct("dog", &dogs), walking]).expect("enough");
        // Copies widen nobody's level.
        assert_eq!(
            calibration.p_value("cat", 0.33),
            two_classes().p_value("cat", 0.33)
        );
        assert_eq!(calibration.p_value("cow", 0.41), Err(NotJudged::NearCopies));
        assert_eq!(calibration.p_value("cow", 0.9), Ok(calibration.least_p_value()));
        assert!(!calibration.judge([("cat", 0.5), ("cow", 0.51)]).none_of_these);
        assert!(calibration.judge([("cat", 0.5), ("cow", 0.9)]).none_of_these);
        let alone = HeldOut {
            copies: &[0.4; 19],
            ..walking
        };
        assert_eq!(Calibration::fit([alone]), Err(NotJudged::NearCopies));
        assert_eq!(Calibration::fit([walking]), Err(NotJudged::TooFewShapes));
    }
}
