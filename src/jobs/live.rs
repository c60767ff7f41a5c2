//! The index that is served: what a generation's records hold, loaded into memory.

use super::trim;
use crate::model::{ClassId, Generation};
use crate::store::{Store, StoreError};
use arc_swap::ArcSwap;
use shapelex_core::baseline::BaselineIndex;
use shapelex_core::ranking::{Calibration, Index, NotJudged};
use shapelex_core::retrieval::SearchIndex;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// The index that queries run against. A query holds the one it began with, also where another is published meanwhile.
#[derive(Clone, Debug)]
pub struct LiveIndex {
    /// `None` before the first reindex; the index is empty then.
    pub generation: Option<Generation>,
    /// The classes of the generation that still exist, under their present names. A class's label is its
    /// [`ClassId`] as text, a shape's its [`ShapeId`](crate::model::ShapeId).
    pub search: SearchIndex,
}

/// Holds the live index. Everything that changes what queries see goes through here.
pub(super) struct Publisher {
    live: ArcSwap<LiveIndex>,
    /// Held from reading the catalogue to storing the index made from it, so that the later of two changes wins.
    publishing: Mutex<()>,
}

impl Publisher {
    /// Starts with an empty index.
    pub fn new(store: &Store) -> Self {
        Self {
            live: ArcSwap::from_pointee(empty(store)),
            publishing: Mutex::default(),
        }
    }

    /// The index there is now.
    pub fn current(&self) -> Arc<LiveIndex> {
        self.live.load_full()
    }

    /// Publishes an index, without the classes that do not exist any more, once `switch` has made it the store's own.
    ///
    /// # Errors
    /// Where the catalogue cannot be read, and those of `switch`; the index that is published stays then.
    pub fn publish(
        &self,
        store: &Store,
        index: &LiveIndex,
        switch: impl FnOnce() -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let _one = self.publishing.lock().unwrap_or_else(PoisonError::into_inner);
        // Read first: after the switch nothing may fail.
        let followed = index.of_catalogue(store)?;
        switch()?;
        self.live.store(Arc::new(followed));
        Ok(())
    }

    /// Publishes the index there is anew, after classes were renamed or deleted.
    ///
    /// # Errors
    /// As [`publish`](Self::publish).
    pub fn follow_catalogue(&self, store: &Store) -> Result<(), StoreError> {
        let _one = self.publishing.lock().unwrap_or_else(PoisonError::into_inner);
        let followed = self.live.load().of_catalogue(store)?;
        self.live.store(Arc::new(followed));
        Ok(())
    }
}

impl LiveIndex {
    /// The same without classes that do not exist, and with the names the others have now.
    fn of_catalogue(&self, store: &Store) -> Result<Self, StoreError> {
        let classes = store.list_classes(None, usize::MAX)?;
        let names: BTreeMap<String, String> = classes
            .iter()
            .map(|class| (class.id.to_string(), class.name.to_string()))
            .collect();
        Ok(Self {
            generation: self.generation.clone(),
            search: self.search.renamed(|label| names.get(label).cloned()),
        })
    }

    /// Memory each of its classes takes, in bytes.
    pub fn resident_bytes_by_class(&self) -> BTreeMap<ClassId, usize> {
        let classes = self.search.dictionaries.classes.iter();
        classes
            .filter_map(|class| Some((class.label.parse().ok()?, class.resident_bytes())))
            .collect()
    }
}

/// The calibration of a generation.
fn calibration(generation: &Generation) -> Result<Calibration, NotJudged> {
    let labels: Vec<String> = generation.classes.iter().map(|c| c.class.to_string()).collect();
    let classes = generation.classes.iter().zip(&labels);
    Calibration::fit(classes.map(|(class, label)| class.report.held_out(label)))
}

/// What the baselines need of a generation. Ranking by sparse coding does without, so damage only costs the baselines.
fn load_baselines(store: &Store, generation: &Generation) -> Result<Option<BaselineIndex>, StoreError> {
    match store.load_baselines(generation) {
        Err(error @ StoreError::Damaged { .. }) => {
            tracing::warn!(%error, "the baselines cannot be loaded; a reindex brings them back");
            Ok(None)
        }
        other => other,
    }
}

/// Loads a generation.
///
/// # Errors
/// Where its records cannot be read.
pub(super) fn of_generation(store: &Store, generation: Generation) -> Result<LiveIndex, StoreError> {
    let search = SearchIndex {
        dictionaries: store.load_index(&generation)?,
        names: BTreeMap::new(),
        baselines: load_baselines(store, &generation)?,
        calibration: calibration(&generation),
    };
    Ok(LiveIndex {
        generation: Some(generation),
        search,
    })
}

/// What a start or a restore finds in the store.
pub(super) enum Loaded {
    /// The index of the current generation, or an empty one where nothing was learnt yet.
    Found(LiveIndex),
    /// An empty index: the generation there was is gone or damaged.
    Lost(LiveIndex),
}

impl Loaded {
    /// Its index, and whether the generation was lost.
    pub fn into_index(self) -> (LiveIndex, bool) {
        match self {
            Self::Found(index) => (index, false),
            Self::Lost(index) => (index, true),
        }
    }
}

/// Loads the current generation.
///
/// # Errors
/// Where the store cannot be read, for another reason than damage.
pub(super) fn load(store: &Store) -> Result<Loaded, StoreError> {
    let loaded = store.generation().and_then(|generation| {
        let index = generation.map(|generation| of_generation(store, generation));
        index.transpose()
    });
    let nothing = |store: &Store| -> Result<LiveIndex, StoreError> {
        let mut index = empty(store);
        index.search.dictionaries.parameters = store.parameters()?;
        Ok(index)
    };
    match loaded {
        Ok(Some(index)) => {
            if let Some(generation) = &index.generation {
                trim::after_loading(store, generation)?;
            }
            Ok(Loaded::Found(index))
        }
        Ok(None) if store.next_generation_number()? > 1 => Ok(Loaded::Lost(nothing(store)?)),
        Ok(None) => Ok(Loaded::Found(nothing(store)?)),
        Err(error @ StoreError::Damaged { .. }) => {
            tracing::error!(%error, "the index cannot be loaded");
            Ok(Loaded::Lost(nothing(store)?))
        }
        Err(other) => Err(other),
    }
}

/// No index, also where there is one that is not to be loaded.
fn empty(store: &Store) -> LiveIndex {
    let dictionaries = Index {
        // What was asked for last is only a hint while nothing is indexed.
        parameters: store.parameters().unwrap_or_default(),
        classes: Vec::new(),
    };
    LiveIndex {
        generation: None,
        search: SearchIndex {
            dictionaries,
            names: BTreeMap::new(),
            baselines: None,
            calibration: Err(NotJudged::TooFewShapes),
        },
    }
}
