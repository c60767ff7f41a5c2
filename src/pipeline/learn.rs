//! Training shapes' signatures → a class's dictionaries.

use super::{Description, PipelineError};
use crate::cancel::Cancel;
use crate::coding::{CodingError, Dictionary, LearnReport};
use crate::parameters::{Channel, Parameters};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The dictionaries of one class or one shape.
#[derive(Clone, Debug)]
pub struct Model {
    /// One dictionary per channel of the parameters.
    pub dictionaries: BTreeMap<Channel, Arc<Dictionary>>,
    /// What learning did.
    pub report: ModelReport,
}

/// What learning did, by channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelReport {
    /// One report per channel.
    pub channels: BTreeMap<Channel, LearnReport>,
}

/// Learns one dictionary per channel from all signatures of the given training shapes. `progress(done, total)` counts
/// mini-batches over all channels.
pub fn learn_model(
    _shapes: &[&Description],
    _parameters: &Parameters,
    _cancel: &Cancel,
    _progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Model, PipelineError> {
    Err(CodingError::NoSignatures.into())
}
