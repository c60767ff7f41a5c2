//! The index in memory.

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
}

/// Loads the current generation, and says whether there was one that cannot be had any more.
pub(super) fn load(store: &Store) -> Result<(LiveIndex, bool), StoreError> {
    let loaded = store.generation().and_then(|generation| match generation {
        None => Ok(None),
        Some(generation) => store
            .load_index(&generation)
            .map(|index| Some((generation, index))),
    });
    let lost = match loaded {
        Ok(Some((generation, index))) => {
            let live = LiveIndex {
                generation: Some(generation),
                index,
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
    };
    Ok((live, lost))
}
