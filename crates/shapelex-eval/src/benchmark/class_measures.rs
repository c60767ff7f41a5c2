//! How good lists of ranked classes are, with intervals.

use super::measures::{RetrievalMeasures, Z, wilson};
use super::query_result::{QueryResult, counts_as};
use serde::{Deserialize, Serialize};

/// A mean over queries and its 95 % interval, from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Estimate {
    /// Of a share of queries: Wilson's interval.
    fn share(correct: usize, total: usize) -> Self {
        let (low, high) = wilson(correct, total);
        Self {
            mean: correct as f64 / total.max(1) as f64,
            low,
            high,
        }
    }

    /// Of values from 0 to 1: the normal interval of their mean.
    fn mean(values: &[f64]) -> Self {
        let n = values.len();
        if n < 2 {
            let mean = values.first().copied().unwrap_or(0.0);
            return Self {
                mean,
                low: 0.0,
                high: 1.0,
            };
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
        let spread = Z * (variance / n as f64).sqrt();
        Self {
            mean,
            low: (mean - spread).max(0.0),
            high: (mean + spread).min(1.0),
        }
    }
}

/// Measures of the lists of classes that queries are answered with, best first. Relevant are the query's class and those
/// that count as the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClassMeasures {
    /// Share of queries whose first class is relevant: top-1.
    pub nearest_neighbour: Estimate,
    /// Share of the R relevant classes among the first R.
    pub first_tier: Estimate,
    /// Discounted cumulative gain over the ideal one.
    pub dcg: Estimate,
}

impl ClassMeasures {
    /// Means over all queries. One whose class is not in its list counts 0 in each.
    pub fn of(queries: &[QueryResult], same: &[Vec<String>]) -> Self {
        let (mut tiers, mut gains) = (Vec::new(), Vec::new());
        for query in queries {
            let list = query.ranked.iter();
            let relevant: Vec<bool> = list
                .map(|(class, _)| counts_as(&query.class, class, same))
                .collect();
            let measures = RetrievalMeasures::of(&relevant).unwrap_or_default();
            tiers.push(measures.first_tier);
            gains.push(measures.dcg);
        }
        let correct = queries.iter().filter(|query| query.correct).count();
        Self {
            nearest_neighbour: Estimate::share(correct, queries.len()),
            first_tier: Estimate::mean(&tiers),
            dcg: Estimate::mean(&gains),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::evaluate::judge;
    use super::*;

    #[test]
    fn lists_of_classes_worked_out_by_hand() {
        let list = |classes: [&str; 4]| -> Vec<(String, f64)> {
            classes
                .iter()
                .zip(0..)
                .map(|(c, i)| ((*c).to_owned(), f64::from(i)))
                .collect()
        };
        let same = [vec!["david".to_owned(), "michael".to_owned()]];
        let queries = [
            judge("cat", "a", list(["cat", "dog", "david", "michael"]), &same),
            judge("dog", "b", list(["cat", "dog", "david", "michael"]), &same),
            judge("david", "c", list(["michael", "dog", "cat", "david"]), &same),
        ];
        let measures = ClassMeasures::of(&queries, &same);
        let near = |x: f64, y: f64| assert!((x - y).abs() < 1e-12, "{x} {y}");
        near(measures.nearest_neighbour.mean, 2.0 / 3.0);
        // 1, 0 and one of two.
        near(measures.first_tier.mean, 0.5);
        near(measures.first_tier.high, 1.0);
        // Gains 1, 1/log₂ 2 and (1 + 1/log₂ 4) / 2.
        near(measures.dcg.mean, (1.0 + 1.0 + 0.75) / 3.0);
        let spread = 1.959_963_984_540_054 * 0.25 / 3.0;
        near(measures.dcg.low, 2.75 / 3.0 - spread);
        assert_eq!(ClassMeasures::of(&[], &[]).nearest_neighbour.high, 1.0);
    }
}
