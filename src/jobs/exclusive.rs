//! Work that changes the store as a whole, with no job in the way; and ends of jobs a full disk kept from being written.

use super::{JobError, Jobs, live};
use crate::model::{JobKind, ReindexScope};
use crate::store::StoreError;

impl Jobs {
    /// Does work while no job waits or runs and none can be asked for, and loads the live index afterwards.
    ///
    /// # Errors
    /// [`JobError::Unfinished`] where a job waits or runs; the work's own; [`JobError::Store`] where the index cannot
    /// be loaded.
    pub fn exclusively<T>(&self, work: impl FnOnce() -> Result<T, StoreError>) -> Result<T, JobError> {
        {
            let mut state = self.inner.state();
            if state.stopping {
                return Err(JobError::ShuttingDown);
            }
            let jobs = state.waiting.len() + usize::from(state.running.is_some());
            if jobs > 0 || state.paused {
                return Err(JobError::Unfinished { jobs });
            }
            state.paused = true;
        }
        let unpause = Unpause(self);
        let done = work()?;
        let (index, lost) = live::load(&self.inner.store)?.into_index();
        self.inner.live.publish(&self.inner.store, &index, || Ok(()))?;
        drop(unpause);
        if lost {
            self.enqueue(JobKind::Reindex {
                scope: ReindexScope::Stale,
                parameters: None,
            })?;
        }
        Ok(done)
    }

    /// Writes the ends of jobs that could not be written when they ended. Called once the store takes writes again.
    ///
    /// # Errors
    /// [`JobError::Store`]; what was not written is tried again at the next call.
    pub fn write_ends(&self) -> Result<(), JobError> {
        loop {
            let Some(job) = self.inner.state().unwritten.last().cloned() else {
                return Ok(());
            };
            self.inner.store.put_job(&job)?;
            self.inner.state().unwritten.retain(|other| other.id != job.id);
        }
    }
}

struct Unpause<'a>(&'a Jobs);

impl Drop for Unpause<'_> {
    fn drop(&mut self) {
        self.0.inner.state().paused = false;
    }
}
