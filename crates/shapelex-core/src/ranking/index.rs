//! The index a query runs against: plain data in memory, immutable once built.

use crate::coding::Dictionary;
use crate::parameters::{Channel, Parameters};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One generation of the index.
#[derive(Clone, Debug)]
pub struct Index {
    /// The parameters every dictionary in it was learnt with.
    pub parameters: Parameters,
    /// Classes with a dictionary.
    pub classes: Vec<IndexedClass>,
}

/// A class and its dictionaries.
#[derive(Clone, Debug)]
pub struct IndexedClass {
    /// Whatever the caller calls it; comes back in the ranking.
    pub label: String,
    /// One dictionary per channel of the parameters.
    pub dictionaries: BTreeMap<Channel, Arc<Dictionary>>,
    /// Shapes with a dictionary of their own, where the parameters ask for them.
    pub shapes: Vec<IndexedShape>,
}

impl IndexedClass {
    /// Memory its dictionaries take now, in bytes, those of single shapes included.
    pub fn resident_bytes(&self) -> usize {
        let of_shapes = self.shapes.iter().flat_map(|shape| shape.dictionaries.values());
        let all = self.dictionaries.values().chain(of_shapes);
        all.map(|dictionary| dictionary.resident_bytes()).sum()
    }
}

/// A training shape with a dictionary of its own (docs/method.md#ranking).
#[derive(Clone, Debug)]
pub struct IndexedShape {
    /// Whatever the caller calls it; comes back in the ranking.
    pub label: String,
    /// One dictionary per channel of the parameters.
    pub dictionaries: BTreeMap<Channel, Arc<Dictionary>>,
}
