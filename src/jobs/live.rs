//! The index in memory.

use crate::baseline::BaselineIndex;
use crate::model::Generation;
use crate::ranking::Index;
use crate::store::{Store, StoreError};

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
            let live = LiveIndex {
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
        generation: None,
        index: Index {
            parameters: store.parameters()?,
            classes: Vec::new(),
        },
        baselines: None,
    };
    Ok((live, lost))
}
