//! Everything a robustness benchmark found out, as plain data: what tables and figures are made from.

use super::measures::RetrievalMeasures;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The key of a method's or protocol's sum over its categories.
pub const TOTAL: &str = "total";

/// Right answers out of a number of queries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Count {
    /// Queries answered rightly: a mean, rounded, where a method was run several times.
    pub correct: usize,
    /// Queries.
    pub total: usize,
}

impl Count {
    /// The 95 % Wilson interval of the share of right answers.
    pub fn interval(&self) -> (f64, f64) {
        super::measures::wilson(self.correct, self.total)
    }
}

/// Category → count, with the sum under [`TOTAL`].
pub type Counts = BTreeMap<String, Count>;

/// A null shape of the benchmark.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NullInfo {
    /// Its class.
    pub class: String,
    /// Vertices it was deformed with.
    pub vertices: usize,
    /// Further poses of its class that were given.
    pub poses: usize,
}

/// What a class's dictionary, or its nearest shape, says of the queries of another: the paper's Figure 5.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClassMatrix {
    /// The protocol.
    pub protocol: String,
    /// The method.
    pub method: String,
    /// The category of the queries.
    pub category: String,
    /// The classes, in the order of rows and columns.
    pub classes: Vec<String>,
    /// `values[i][j]`: mean score of the queries of class i under class j; the smaller, the more alike.
    pub values: Vec<Vec<f64>>,
}

/// Precision at fixed recalls, averaged over all queries.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PrecisionRecall {
    /// The method.
    pub method: String,
    /// The category, or [`TOTAL`].
    pub category: String,
    /// Recalls, ascending, 0 to 1.
    pub recall: Vec<f64>,
    /// Precision at each.
    pub precision: Vec<f64>,
}

/// A histogram of distances between signatures: the paper's Figure 4.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DistanceHistogram {
    /// The method, such as `sdd_wks`.
    pub method: String,
    /// The class.
    pub class: String,
    /// The category of which this is the mean histogram; `None` for the null shape.
    pub category: Option<String>,
    /// Distance at the end of the last bin.
    pub largest: f64,
    /// The bins' shares, summing to 1.
    pub shares: Vec<f64>,
}

/// A query that was answered wrongly.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Mistake {
    /// The category.
    pub category: String,
    /// The true class.
    pub class: String,
    /// Strength of the deformation; 0 for the null shape.
    pub strength: usize,
    /// The class it was taken for.
    pub answered: String,
}

/// What a method cost.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// The method, or `describe` for what all methods share: deforming, solving for spectra, signatures.
    pub method: String,
    /// Wall-clock time in seconds, over all protocols and categories.
    pub seconds: f64,
    /// Largest resident memory of the process meanwhile, in bytes, where the system tells.
    pub peak_bytes: Option<u64>,
    /// Whether some of it was read from the cache, so that the time says little.
    pub cached: bool,
}

/// A robustness benchmark.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkReport {
    /// Seed of all deformations.
    pub seed: u64,
    /// Signatures of a query that were coded by the sparse-coding methods; 0 for all.
    pub query_samples: usize,
    /// The null shapes, in order of their classes.
    pub nulls: Vec<NullInfo>,
    /// Groups of classes that count as one another's right answer.
    pub same: Vec<Vec<String>>,
    /// Protocol → method → category → count.
    pub counts: BTreeMap<String, BTreeMap<String, Counts>>,
    /// Method → category → retrieval measures, of protocol `retrieval`.
    pub retrieval: BTreeMap<String, BTreeMap<String, RetrievalMeasures>>,
    /// Precision–recall curves of protocol `retrieval`.
    pub precision_recall: Vec<PrecisionRecall>,
    /// Class dissimilarities, one for each protocol, method and category that was run.
    pub dissimilarity: Vec<ClassMatrix>,
    /// Histograms of signature distances, of the null shapes and of every category.
    pub histograms: Vec<DistanceHistogram>,
    /// Protocol → method → wrong answers.
    pub mistakes: BTreeMap<String, BTreeMap<String, Vec<Mistake>>>,
    /// What each method cost.
    pub costs: Vec<Cost>,
    /// Wall-clock time of the whole, in seconds.
    pub seconds: f64,
}
