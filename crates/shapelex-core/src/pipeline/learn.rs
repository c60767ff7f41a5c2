//! Training shapes' signatures → a class's dictionaries.

use super::{Description, PipelineError};
use crate::cancel::Cancel;
use crate::coding::{CodingError, Dictionary, LearnReport, learn};
use crate::parameters::{Channel, Hypothesis, Parameters};
use crate::ranking::{HeldOut, View};
use faer::MatRef;
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
    /// Scores of the class's shapes under dictionaries they and their near copies were left out of
    /// ([`held_out_scores`](super::held_out_scores)); empty where none were asked for.
    #[serde(default)]
    pub held_out: Vec<f64>,
    /// Scores of shapes under dictionaries they were left out of but not their near copies, where all of the class's are
    /// near copies of each other.
    #[serde(default)]
    pub copies: Vec<f64>,
}

impl ModelReport {
    /// What a calibration takes of it.
    pub fn held_out<'a>(&'a self, label: &'a str) -> HeldOut<'a> {
        HeldOut {
            label,
            scores: &self.held_out,
            copies: &self.copies,
        }
    }
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
        let signals = signals(shapes, channel)?;
        let step = |batch: usize, batches: usize| progress(done * batches + batch, channels.len() * batches);
        let (dictionary, learnt) = learn(&signals, &learning, cancel, &step)?;
        dictionaries.insert(channel, Arc::new(dictionary));
        report.channels.insert(channel, learnt);
    }
    Ok(Model { dictionaries, report })
}

/// The signatures of all shapes in one channel, M × N each. A part teaches what its doubled surface looks like; as it
/// is it only serves the baselines.
fn signals<'a>(shapes: &[&'a Description], channel: Channel) -> Result<Vec<MatRef<'a, f64>>, CodingError> {
    let mut signals = Vec::new();
    for shape in shapes {
        let seen: Vec<&View> = shape.views.iter().filter(|v| v.channel == channel).collect();
        if seen.is_empty() {
            return Err(CodingError::NoSignatures);
        }
        let part = seen.iter().any(|v| v.hypothesis == Hypothesis::Doubled);
        let wanted = seen
            .iter()
            .filter(|v| !part || v.hypothesis == Hypothesis::Doubled);
        signals.extend(wanted.map(|v| v.signatures.matrix.as_ref()));
    }
    Ok(signals)
}
