//! What an index generation consists of.

use super::{ClassId, ClassName, ShapeId};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::ModelReport;

/// One generation of the index: which dictionaries queries are ranked against. Never changes once written; the next
/// one is written beside it and takes over by one atomic write.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Generation {
    /// Counts from 1.
    pub number: u64,
    /// The parameters all its dictionaries were learnt with.
    pub parameters: Parameters,
    /// When it took over.
    pub created_at: Timestamp,
    /// Its classes, by identifier.
    pub classes: Vec<GenerationClass>,
    /// The store's key of what the baselines' descriptors share; `None` where it was learnt without.
    pub baselines: Option<String>,
}

impl Generation {
    /// The entry of a class, if it is part of this generation.
    pub fn class(&self, id: ClassId) -> Option<&GenerationClass> {
        self.classes.iter().find(|class| class.class == id)
    }

    /// The store's keys of all its dictionaries.
    pub fn dictionary_keys(&self) -> impl Iterator<Item = &str> {
        self.classes.iter().flat_map(|class| {
            let of_shapes = class.shape_dictionaries.iter().map(|s| s.dictionary.as_str());
            std::iter::once(class.dictionary.as_str()).chain(of_shapes)
        })
    }
}

/// Where the dictionaries of a class come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Learnt here from the shapes of the class.
    #[default]
    Learnt,
    /// Taken over from a file that `export` wrote. They cannot be learnt again here.
    Imported,
}

/// A class as a generation learnt it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GenerationClass {
    /// The class.
    pub class: ClassId,
    /// Its name when it was learnt.
    pub name: ClassName,
    /// Where its dictionaries come from.
    pub origin: Origin,
    /// Its revision when it was learnt. The class is stale where its own is another.
    pub revision: u64,
    /// Shapes learnt from.
    pub shapes: usize,
    /// The store's key of its dictionaries.
    pub dictionary: String,
    /// Size of its dictionaries as stored, in bytes, per-shape dictionaries included.
    pub bytes: u64,
    /// Atoms, summed over its channels.
    pub atoms: usize,
    /// What learning did.
    pub report: ModelReport,
    /// Shapes with a dictionary of their own, where the parameters ask for them.
    pub shape_dictionaries: Vec<GenerationShape>,
}

/// A shape with a dictionary of its own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GenerationShape {
    /// The shape.
    pub shape: ShapeId,
    /// The store's key of its dictionaries.
    pub dictionary: String,
}
