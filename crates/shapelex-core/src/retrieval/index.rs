//! What a query is compared with.

use crate::baseline::BaselineIndex;
use crate::ranking::{Calibration, Index, IndexedClass, NotJudged};
use std::collections::BTreeMap;

/// Everything a query is compared with: dictionaries, training shapes for the baselines, and the scores of held-out
/// shapes. Immutable; classes that no longer exist are not in it.
#[derive(Clone, Debug)]
pub struct SearchIndex {
    /// The dictionaries of the classes, and the parameters they were learnt with.
    pub dictionaries: Index,
    /// Label → the name people know the class by; a class without an entry is called by its label.
    pub names: BTreeMap<String, String>,
    /// What the baselines compare with, by the same labels; `None` where it was learnt without.
    pub baselines: Option<BaselineIndex>,
    /// The scores of held-out training shapes, by the same labels, or why they are not known.
    pub calibration: Result<Calibration, NotJudged>,
}

impl SearchIndex {
    /// What people call the class with this label.
    pub fn name<'a>(&'a self, label: &'a str) -> &'a str {
        self.names.get(label).map_or(label, String::as_str)
    }

    /// The same index without the classes that `name` has no name for, and with the names it gives to the others.
    ///
    /// Dictionaries are shared with `self`, not copied.
    #[must_use]
    pub fn renamed(&self, name: impl Fn(&str) -> Option<String>) -> Self {
        let mut names = BTreeMap::new();
        let mut classes = Vec::with_capacity(self.dictionaries.classes.len());
        for class in &self.dictionaries.classes {
            if let Some(name) = name(&class.label) {
                names.insert(class.label.clone(), name);
                classes.push(class.clone());
            }
        }
        let mut baselines = self.baselines.clone();
        if let Some(baselines) = &mut baselines {
            baselines.classes.retain(|class| names.contains_key(&class.label));
        }
        Self {
            dictionaries: Index {
                parameters: self.dictionaries.parameters.clone(),
                classes,
            },
            names,
            baselines,
            calibration: self.calibration.clone(),
        }
    }

    /// Memory its dictionaries and what the baselines need take, in bytes.
    pub fn resident_bytes(&self) -> usize {
        let classes = &self.dictionaries.classes;
        let dictionaries: usize = classes.iter().map(IndexedClass::resident_bytes).sum();
        dictionaries + self.baselines.as_ref().map_or(0, BaselineIndex::resident_bytes)
    }
}
