//! What an evaluation found out.

use super::refused::Refused;
use serde::Serialize;
use shapelex_core::parameters::Parameters;
use shapelex_eval::benchmark::retrieval::RetrievalOutcome;
use shapelex_eval::benchmark::{Evaluation, OpenSet};
use std::collections::BTreeMap;

/// Everything an evaluation found out.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Shapes by class.
    pub classes: BTreeMap<String, usize>,
    /// Shapes in all.
    pub shapes: usize,
    /// All shapes that were evaluated, in order: the positions in `retrieval.nearest` are positions in this list.
    pub shape_list: Vec<ShapeName>,
    /// Files that could not be used.
    pub refused: Vec<Refused>,
    /// Classes left out because they have too few shapes.
    pub left_out: Vec<String>,
    /// What counted.
    pub parameters: Parameters,
    /// One outcome per protocol.
    pub protocols: Vec<Outcome>,
    /// Shape against shape, where it was asked for: a dictionary per shape, nearest neighbour, tiers, DCG, mAP.
    pub retrieval: Option<RetrievalOutcome>,
    /// What comes of shapes of no indexed class, where it was asked for and enough shapes train: the sum over the draws.
    pub open_set: Option<OpenSet>,
    /// Wall-clock time of the whole, in seconds.
    pub seconds: f64,
}

/// What a shape is called.
#[derive(Debug, Serialize)]
pub struct ShapeName {
    /// Its class.
    pub class: String,
    /// Its name, unique within the class.
    pub name: String,
}

/// The outcome of one protocol.
#[derive(Debug, Serialize)]
pub struct Outcome {
    /// The protocol's name.
    pub name: &'static str,
    /// Share of queries answered with the right class, 0 to 1.
    pub top1: f64,
    /// The evaluation; as text its queries are cut to the worst, as JSON all are there.
    #[serde(flatten)]
    pub evaluation: Evaluation,
}
