//! What a start on a full disk could not do: read the index and the jobs, queue a reindex, write the ends of jobs. It is
//! done once there is space.

use super::{Inner, JobError, Jobs, LiveIndex, live, share, worker};
use crate::model::{JobKind, ReindexScope};
use crate::store::StoreError;

/// What is still to be done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Behind {
    /// Whether the index and the jobs are still to be read.
    unread: bool,
    /// Whether a reindex is still to be queued, since the index was lost.
    relearn: bool,
}

impl Behind {
    /// Refuses new jobs while the old ones are not known.
    pub(super) fn require_read(self) -> Result<(), StoreError> {
        match self.unread {
            false => Ok(()),
            true => Err(StoreError::Full {
                detail: "the jobs are read once there is space".to_owned(),
            }),
        }
    }
}

impl Inner {
    /// Reads the index and the jobs, or remembers to do so where the disk is too full to read them.
    pub(super) fn read_or_put_off(&self) -> Result<(), JobError> {
        match self.read() {
            Err(JobError::Store(error @ StoreError::Full { .. })) => {
                tracing::warn!(%error, "the index and the jobs are read once there is space");
                self.state().behind.unread = true;
                Ok(())
            }
            done => done,
        }
    }

    fn read(&self) -> Result<(), JobError> {
        let (live, lost) = live::load(&self.store)?.into_index();
        warn_of_a_large_index(&live, self.options.memory_bytes);
        worker::requeue_interrupted(self)?;
        self.live.publish(&self.store, &live, || Ok(()))?;
        let mut state = self.state();
        state.behind = Behind {
            unread: false,
            relearn: lost && state.waiting.is_empty() && state.running.is_none(),
        };
        self.changed.notify_all();
        Ok(())
    }
}

impl Jobs {
    /// Whether the index and the jobs could not be read yet because the disk was full.
    pub fn is_unread(&self) -> bool {
        self.inner.state().behind.unread
    }

    /// Whether there is anything [`Jobs::catch_up`] has to do.
    pub fn is_behind(&self) -> bool {
        let state = self.inner.state();
        state.behind != Behind::default() || !state.unwritten.is_empty()
    }

    /// Does what a full disk kept from being done. Called once the store takes writes again.
    ///
    /// # Errors
    /// [`JobError::Store`]; what was not done is tried again at the next call.
    pub fn catch_up(&self) -> Result<(), JobError> {
        if self.is_unread() {
            self.inner.read()?;
        }
        self.relearn_where_lost()?;
        self.write_ends()
    }

    pub(super) fn relearn_where_lost(&self) -> Result<(), JobError> {
        if !self.inner.state().behind.relearn {
            return Ok(());
        }
        let queued = self.enqueue(JobKind::Reindex {
            scope: ReindexScope::Stale,
            parameters: None,
        });
        match queued {
            Ok(_) => {
                tracing::warn!("the index has to be learnt again; a reindex is queued");
                self.inner.state().behind.relearn = false;
                Ok(())
            }
            // Queued once there is space.
            Err(JobError::Store(StoreError::Full { .. })) => Ok(()),
            Err(error) => Err(error),
        }
    }
}

/// Says that an index cannot be replaced by one as large within the memory for indexing, before a reindex fails of it.
fn warn_of_a_large_index(live: &LiveIndex, memory_bytes: u64) {
    let taken = live.generation.as_ref().map_or(0, share::index_bytes);
    if taken > memory_bytes / 2 {
        tracing::warn!(
            index_mib = taken >> 20,
            limit_mib = memory_bytes >> 20,
            "the index takes more than half of the memory for indexing, so it cannot be replaced by one as large; raise \
             --indexing-memory-mib"
        );
    }
}
