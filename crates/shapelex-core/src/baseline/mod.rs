//! The methods the paper compares with. Each turns a shape into one vector of fixed length; shapes are compared by the
//! Euclidean distance of their vectors and take the class of their nearest neighbour.

pub mod bag_of_words;
pub mod index;
pub mod shape_dna;
pub mod signature_distances;

pub use bag_of_words::Vocabulary;
pub use index::{
    Baseline, BaselineClass, BaselineIndex, BaselineModel, BaselineShape, Nearest, nearest_classes, thinned,
};
pub use shape_dna::shape_dna;
pub use signature_distances::{SignatureDistances, sample_distances};

/// ‖a − b‖₂ of two vectors of equal length.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(x, y)| (x - y) * (x - y))
        .sum::<f64>()
        .sqrt()
}
