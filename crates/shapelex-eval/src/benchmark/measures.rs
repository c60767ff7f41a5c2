//! The standard measures of retrieval (Shilane, Min, Kazhdan, Funkhouser 2004, section 5), and an interval for a share.

use serde::{Deserialize, Serialize};

/// How many answers the E-measure looks at.
const E_MEASURE_ANSWERS: usize = 32;
/// Standard normal quantile of 97.5 %.
pub(super) const Z: f64 = 1.959_963_984_540_054;

/// Recalls at which precision is reported: 0.05, 0.1, …, 1.
pub const RECALLS: usize = 20;

/// Measures of one query's list of answers, or their means over many queries. All from 0 to 1, 1 the best.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RetrievalMeasures {
    /// Queries averaged over.
    pub queries: usize,
    /// Share of queries whose first answer is relevant.
    pub nearest_neighbour: f64,
    /// Share of the R relevant shapes among the first R answers.
    pub first_tier: f64,
    /// The same among the first 2 R answers.
    pub second_tier: f64,
    /// Harmonic mean of precision and recall over the first 32 answers.
    pub e_measure: f64,
    /// Discounted cumulative gain over the ideal one: rel₁ + Σ_{i≥2} relᵢ / log₂ i.
    pub dcg: f64,
    /// Mean of the precisions at every relevant answer.
    pub average_precision: f64,
    /// Largest precision at a recall of at least 0.05, 0.1, …, 1.
    pub precision: Vec<f64>,
}

impl RetrievalMeasures {
    /// Judges one list: `relevant[i]` says whether the answer at place i is. `None` where nothing is relevant.
    pub fn of(relevant: &[bool]) -> Option<Self> {
        let r = relevant.iter().filter(|&&x| x).count();
        if r == 0 {
            return None;
        }
        let among = |n: usize| relevant.iter().take(n).filter(|&&x| x).count() as f64;
        let gain = |i: usize| if i < 2 { 1.0 } else { 1.0 / (i as f64).log2() };
        let mut found = 0.0;
        let mut gained = 0.0;
        let mut precisions = Vec::with_capacity(r);
        for (i, _) in relevant.iter().enumerate().filter(|(_, x)| **x) {
            found += 1.0;
            gained += gain(i + 1);
            precisions.push(found / (i + 1) as f64);
        }
        let ideal: f64 = (1..=r).map(gain).sum();
        let hits = among(E_MEASURE_ANSWERS);
        let e_measure = if hits > 0.0 {
            let precision = hits / relevant.len().min(E_MEASURE_ANSWERS) as f64;
            let recall = hits / r as f64;
            2.0 * precision * recall / (precision + recall)
        } else {
            0.0
        };
        // The k-th relevant answer reaches recall k/r; every later one may have a better precision.
        let precision = (1..=RECALLS)
            .map(|step| {
                let first = (r * step).div_ceil(RECALLS);
                precisions[first.max(1) - 1..].iter().copied().fold(0.0, f64::max)
            })
            .collect();
        Some(Self {
            queries: 1,
            nearest_neighbour: among(1),
            first_tier: among(r) / r as f64,
            second_tier: among(2 * r) / r as f64,
            e_measure,
            dcg: gained / ideal,
            average_precision: precisions.iter().sum::<f64>() / r as f64,
            precision,
        })
    }

    /// Means over queries, each list weighted by the queries it stands for.
    pub fn mean(parts: &[Self]) -> Self {
        let queries: usize = parts.iter().map(|p| p.queries).sum();
        let weighted = |pick: &dyn Fn(&Self) -> f64| {
            parts.iter().map(|p| p.queries as f64 * pick(p)).sum::<f64>() / queries.max(1) as f64
        };
        let points = parts.first().map_or(0, |p| p.precision.len());
        Self {
            queries,
            nearest_neighbour: weighted(&|p| p.nearest_neighbour),
            first_tier: weighted(&|p| p.first_tier),
            second_tier: weighted(&|p| p.second_tier),
            e_measure: weighted(&|p| p.e_measure),
            dcg: weighted(&|p| p.dcg),
            average_precision: weighted(&|p| p.average_precision),
            precision: (0..points).map(|i| weighted(&|p| p.precision[i])).collect(),
        }
    }

    /// The recalls that belong to `precision`.
    pub fn recalls() -> Vec<f64> {
        (1..=RECALLS).map(|i| i as f64 / RECALLS as f64).collect()
    }
}

/// The 95 % interval of a share (Wilson 1927): `correct` of `total`, as (low, high); (0, 1) of nothing.
pub fn wilson(correct: usize, total: usize) -> (f64, f64) {
    if total == 0 {
        return (0.0, 1.0);
    }
    let n = total as f64;
    let p = correct as f64 / n;
    let centre = p + Z * Z / (2.0 * n);
    let spread = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    (
        ((centre - spread) / scale).max(0.0),
        ((centre + spread) / scale).min(1.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_of_a_list_worked_out_by_hand() {
        // Three relevant shapes at places 1, 3 and 6 of 6.
        let m = RetrievalMeasures::of(&[true, false, true, false, false, true]).unwrap();
        assert_eq!(m.nearest_neighbour, 1.0);
        assert!((m.first_tier - 2.0 / 3.0).abs() < 1e-12);
        assert!((m.second_tier - 1.0).abs() < 1e-12);
        // Precision 3/6, recall 1.
        assert!((m.e_measure - 2.0 / 3.0).abs() < 1e-12);
        let dcg = (1.0 + 1.0 / 3f64.log2() + 1.0 / 6f64.log2()) / (1.0 + 1.0 + 1.0 / 3f64.log2());
        assert!((m.dcg - dcg).abs() < 1e-12);
        assert!((m.average_precision - (1.0 + 2.0 / 3.0 + 0.5) / 3.0).abs() < 1e-12);
        // Up to recall 1/3 the precision is 1, up to 2/3 it is 2/3, beyond it 1/2.
        assert_eq!(m.precision.len(), RetrievalMeasures::recalls().len());
        assert_eq!(m.precision[5], 1.0);
        assert!((m.precision[6] - 2.0 / 3.0).abs() < 1e-12 && (m.precision[12] - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!(m.precision[13], 0.5);
    }

    #[test]
    fn a_perfect_list_has_ones_and_an_empty_one_nothing() {
        let perfect = RetrievalMeasures::of(&[true, true, false, false]).unwrap();
        let ones = [
            perfect.nearest_neighbour,
            perfect.first_tier,
            perfect.second_tier,
            perfect.dcg,
        ];
        assert_eq!(ones, [1.0; 4]);
        assert!(perfect.precision.iter().all(|&p| p == 1.0));
        assert_eq!(RetrievalMeasures::of(&[false, false]), None);
        let worst = RetrievalMeasures::of(&[false, true]).unwrap();
        let mean = RetrievalMeasures::mean(&[perfect, worst]);
        assert_eq!((mean.queries, mean.nearest_neighbour), (2, 0.5));
    }

    #[test]
    fn the_wilson_interval_agrees_with_the_textbook() {
        // 81 of 263: 0.2553 to 0.3662 (Newcombe 1998, Table I).
        let (low, high) = wilson(81, 263);
        assert!(
            (low - 0.2553).abs() < 5e-5 && (high - 0.3662).abs() < 5e-5,
            "{low} {high}"
        );
        let (low, high) = wilson(20, 20);
        assert!(low < 0.85 && high == 1.0);
        assert_eq!(wilson(0, 0), (0.0, 1.0));
    }
}
