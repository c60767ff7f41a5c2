//! Generations of the index: written beside each other, switched by one atomic write.

use super::entry::{get, put};
use super::event::Event;
use super::payload::Number;
use super::{Batch, Store, StoreError, keys};
use crate::model::Generation;
use shapelex_core::parameters::Parameters;

impl Store {
    /// The current generation; `None` before the first reindex.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn generation(&self) -> Result<Option<Generation>, StoreError> {
        let number: Option<Number> = get(&*self.inner.backend, keys::META_GENERATION)?;
        let Some(Number(number)) = number else {
            return Ok(None);
        };
        get(&*self.inner.backend, &keys::generation(number))?
            .ok_or_else(|| StoreError::damaged(format!("generation {number}"), "it is missing"))
            .map(Some)
    }

    /// The number the next generation gets.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn next_generation_number(&self) -> Result<u64, StoreError> {
        let last: Option<Number> = get(&*self.inner.backend, keys::META_LAST_GENERATION)?;
        Ok(last.map_or(0, |n| n.0) + 1)
    }

    /// The parameters a reindex uses that brings none of its own: those of the last one, else the default preset.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn parameters(&self) -> Result<Parameters, StoreError> {
        let parameters = get(&*self.inner.backend, keys::META_PARAMETERS)?;
        Ok(parameters.unwrap_or_default())
    }

    /// Writes a generation and makes it the current one, in one atomic write. Its dictionaries must be there already.
    /// The record of the one before is removed by the same write.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the write's failure; the current generation is unchanged then.
    pub fn put_generation_and_switch(&self, generation: &Generation) -> Result<(), StoreError> {
        let mut writer = self.inner.writer();
        let mut batch = Batch::default();
        let before: Option<Number> = get(&*self.inner.backend, keys::META_GENERATION)?;
        if let Some(Number(before)) = before
            && before != generation.number
        {
            batch.delete(keys::generation(before));
        }
        put(&mut batch, keys::generation(generation.number), generation)?;
        put(
            &mut batch,
            keys::META_GENERATION.to_vec(),
            &Number(generation.number),
        )?;
        let event = Event::Indexed {
            generation: generation.number,
            parameters: Box::new(generation.parameters.clone()),
        };
        self.inner.record(&mut writer, &event, batch)
    }
}
