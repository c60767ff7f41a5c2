//! Training shapes' signatures → a class's dictionaries.

use super::{Description, PipelineError};
use crate::cancel::Cancel;
use crate::coding::{CodingError, Dictionary, LearnReport, learn};
use crate::parameters::{Channel, Parameters};
use crate::ranking::View;
use faer::Mat;
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
    /// Scores of the class's shapes under dictionaries they were left out of
    /// ([`held_out_scores`](super::held_out_scores)); empty where none were asked for.
    #[serde(default)]
    pub held_out: Vec<f64>,
}

/// Learns one dictionary per channel from all signatures of the given training shapes. `progress(done, total)` counts
/// mini-batches over all channels.
///
/// # Errors
/// [`CodingError::NoSignatures`] without shapes, or where a shape lacks a channel; [`PipelineError::Cancelled`].
pub fn learn_model(
    shapes: &[&Description],
    parameters: &Parameters,
    cancel: &Cancel,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Model, PipelineError> {
    let channels = parameters.channels();
    let learning = parameters.learn_parameters();
    let mut dictionaries = BTreeMap::new();
    let mut report = ModelReport::default();
    for (done, &channel) in channels.iter().enumerate() {
        let signals = concatenate(shapes, channel)?;
        let step = |batch: usize, batches: usize| progress(done * batches + batch, channels.len() * batches);
        let (dictionary, learnt) = learn(signals.as_ref(), &learning, cancel, &step)?;
        dictionaries.insert(channel, Arc::new(dictionary));
        report.channels.insert(channel, learnt);
    }
    Ok(Model { dictionaries, report })
}

/// The signatures of all shapes in one channel, side by side: M × ΣN.
fn concatenate(shapes: &[&Description], channel: Channel) -> Result<Mat<f64>, CodingError> {
    let parts = shapes
        .iter()
        .map(|shape| shape.views.iter().find(|view| view.channel == channel))
        .collect::<Option<Vec<&View>>>()
        .ok_or(CodingError::NoSignatures)?;
    let dimension = parts
        .first()
        .ok_or(CodingError::NoSignatures)?
        .signatures
        .dimension();
    let total = parts.iter().map(|v| v.signatures.len()).sum();
    let mut all = Mat::zeros(dimension, total);
    let mut next = 0;
    for part in parts {
        let matrix = &part.signatures.matrix;
        if matrix.nrows() != dimension {
            return Err(CodingError::DimensionMismatch {
                signature: matrix.nrows(),
                atoms: dimension,
            });
        }
        all.as_mut().subcols_mut(next, matrix.ncols()).copy_from(matrix);
        next += matrix.ncols();
    }
    Ok(all)
}
