//! Removing what nothing refers to any more: dictionaries of earlier generations, stored files without a shape, cached
//! signatures of other parameters, unfinished temporary files.

use super::layout::ORIGINALS;
use super::{Batch, Store, StoreError, baselines, files, keys, record};
use crate::model::{ContentHash, Generation, Shape};
use shapelex_core::parameters::Parameters;
use std::collections::BTreeSet;
use std::sync::PoisonError;

/// What a collection removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Garbage {
    /// Dictionaries.
    pub dictionaries: usize,
    /// What the baselines needed of earlier generations.
    pub baselines: usize,
    /// Stored files.
    pub originals: usize,
    /// Cached signatures.
    pub signatures: usize,
}

/// Dictionaries looked at per scan, so that they are never all in memory.
const CHUNK: usize = 64;

impl Store {
    /// Removes what neither the catalogue nor the current generation refers to. Only the indexing worker calls this,
    /// between two jobs, since dictionaries of a generation in the making are referred to by nothing yet.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`]; a record that cannot be read; a failure of the file system.
    pub fn collect_garbage(&self) -> Result<Garbage, StoreError> {
        self.inner.writable()?;
        let generation = self.generation()?;
        let mut garbage = Garbage {
            dictionaries: self.collect_dictionaries(generation.as_ref())?,
            baselines: self.collect_baselines(generation.as_ref())?,
            ..Garbage::default()
        };
        let _gate = self.inner.files.write().unwrap_or_else(PoisonError::into_inner);
        // Looked at again under the gate: a change that failed meanwhile may still need its files.
        self.inner.writable()?;
        // A snapshot being written may need what nothing refers to any more; the next collection takes it.
        let held = self.is_pinned(&BTreeSet::new());
        files::walk(&self.inner.path.join(ORIGINALS), |path, name| {
            let kept = match name.parse::<ContentHash>() {
                Ok(content) => self.is_referenced(content)?,
                Err(_) => false,
            };
            if !kept && !held {
                files::remove(path)?;
                garbage.originals += 1;
            }
            Ok(())
        })?;
        let parameters = match generation {
            Some(generation) => generation.parameters,
            None => self.parameters()?,
        };
        garbage.signatures = self.collect_signatures(&parameters)?;
        Ok(garbage)
    }

    fn collect_dictionaries(&self, generation: Option<&Generation>) -> Result<usize, StoreError> {
        let kept: BTreeSet<Vec<u8>> = generation
            .iter()
            .flat_map(|g| g.dictionary_keys())
            .map(keys::dictionary)
            .collect();
        self.collect_records(keys::DICTIONARY, &kept)
    }

    fn collect_baselines(&self, generation: Option<&Generation>) -> Result<usize, StoreError> {
        let mut kept = BTreeSet::new();
        if let Some((generation, model)) = generation.and_then(|g| Some((g, g.baselines.as_ref()?))) {
            kept.insert(keys::baseline(model));
            let of = |class| keys::baseline(&baselines::class_key(class, model));
            kept.extend(generation.classes.iter().map(of));
        }
        self.collect_records(keys::BASELINE, &kept)
    }

    /// Removes the records of a prefix that are not kept.
    fn collect_records(&self, prefix: &[u8], kept: &BTreeSet<Vec<u8>>) -> Result<usize, StoreError> {
        let mut batch = Batch::default();
        let mut after: Option<Vec<u8>> = None;
        loop {
            let entries = self.inner.backend.scan(prefix, after.as_deref(), CHUNK)?;
            let Some((last, _)) = entries.last() else { break };
            after = Some(last.clone());
            for (key, _) in entries {
                if !kept.contains(&key) {
                    batch.delete(key);
                }
            }
        }
        if !batch.is_empty() {
            self.inner.commit(&batch)?;
        }
        Ok(batch.writes.len())
    }

    fn collect_signatures(&self, parameters: &Parameters) -> Result<usize, StoreError> {
        let fingerprint = parameters.description_fingerprint();
        let mut kept = BTreeSet::new();
        let mut after: Option<Vec<u8>> = None;
        loop {
            let entries = self.inner.backend.scan(keys::SHAPE, after.as_deref(), CHUNK)?;
            let Some((last, _)) = entries.last() else { break };
            after = Some(last.clone());
            for (key, value) in &entries {
                let shape: Shape = record::unseal(key, value)?;
                kept.insert(super::signatures::file_name(shape.identity(), &fingerprint));
            }
        }
        let mut removed = 0;
        files::walk(&self.inner.path.join("signatures"), |path, name| {
            if !kept.contains(name) {
                files::remove(path)?;
                removed += 1;
            }
            Ok(())
        })?;
        Ok(removed)
    }
}
