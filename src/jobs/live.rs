//! The index in memory.

use super::trim;
use crate::model::Generation;
use crate::store::{Store, StoreError};
use shapelex_core::baseline::BaselineIndex;
use shapelex_core::ranking::{Calibration, Index, IndexedClass, NotJudged};

/// The index queries run against. A query holds the one it began with, whatever is switched in meanwhile.
#[derive(Clone, Debug)]
pub struct LiveIndex {
    /// `None` before the first reindex; the index is empty then.
    pub generation: Option<Generation>,
    /// Its dictionaries in memory. A class's label is its [`ClassId`](crate::model::ClassId) as text, a shape's its
    /// [`ShapeId`](crate::model::ShapeId).
    pub index: Index,
    /// What the baselines need, with the same labels; `None` where it was learnt without.
    pub baselines: Option<BaselineIndex>,
    /// What scores shapes of its classes have, with the same labels, or why that is not known.
    pub calibration: Result<Calibration, NotJudged>,
}

impl LiveIndex {
    /// Memory its dictionaries and what the baselines need take now, in bytes.
    pub fn resident_bytes(&self) -> usize {
        let dictionaries: usize = self.index.classes.iter().map(IndexedClass::resident_bytes).sum();
        dictionaries + self.baselines.as_ref().map_or(0, BaselineIndex::resident_bytes)
    }
}

/// The calibration of a generation.
pub(super) fn calibration(generation: &Generation) -> Result<Calibration, NotJudged> {
    let labels: Vec<String> = generation.classes.iter().map(|c| c.class.to_string()).collect();
    let classes = generation.classes.iter().zip(&labels);
    Calibration::fit(classes.map(|(class, label)| class.report.held_out(label)))
}

/// What the baselines need of a generation. Ranking by sparse coding does without, so damage only costs the baselines.
pub(super) fn load_baselines(
    store: &Store,
    generation: &Generation,
) -> Result<Option<BaselineIndex>, StoreError> {
    match store.load_baselines(generation) {
        Err(error @ StoreError::Damaged { .. }) => {
            tracing::warn!(%error, "the baselines cannot be loaded; a reindex brings them back");
            Ok(None)
        }
        other => other,
    }
}

/// Loads the current generation, and says whether there was one that cannot be had any more.
pub(super) fn load(store: &Store) -> Result<(LiveIndex, bool), StoreError> {
    let loaded = store.generation().and_then(|generation| match generation {
        None => Ok(None),
        Some(generation) => store
            .load_index(&generation)
            .and_then(|index| Ok((index, load_baselines(store, &generation)?)))
            .map(|(index, baselines)| Some((generation, index, baselines))),
    });
    let lost = match loaded {
        Ok(Some((generation, index, baselines))) => {
            trim::after_loading(store, &generation)?;
            let live = LiveIndex {
                calibration: calibration(&generation),
                generation: Some(generation),
                index,
                baselines,
            };
            return Ok((live, false));
        }
        Ok(None) => store.next_generation_number()? > 1,
        Err(error @ StoreError::Damaged { .. }) => {
            tracing::error!(%error, "the index cannot be loaded");
            true
        }
        Err(other) => return Err(other),
    };
    let live = LiveIndex {
        index: Index {
            parameters: store.parameters()?,
            classes: Vec::new(),
        },
        ..empty(store)
    };
    Ok((live, lost))
}

/// No index, where there may well be one that is not to be loaded.
pub(super) fn empty(store: &Store) -> LiveIndex {
    LiveIndex {
        generation: None,
        index: Index {
            // What was asked for last is only a hint while nothing is indexed.
            parameters: store.parameters().unwrap_or_default(),
            classes: Vec::new(),
        },
        baselines: None,
        calibration: Err(NotJudged::TooFewShapes),
    }
}
