//! Jobs, and which of them are not finished.

use super::entry::{get, put};
use super::payload::QueueLink;
use super::{Batch, Store, StoreError, keys, record};
use crate::model::{Job, JobId};

/// Finished jobs that are remembered.
const REMEMBERED: usize = 1000;

impl Store {
    /// Writes a job. A job that is not finished is in the queue, a finished one is not; both change together.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the write's failure.
    pub fn put_job(&self, job: &Job) -> Result<(), StoreError> {
        self.inner.commit(&self.job_batch(job)?)
    }

    /// Writes how far a job is, without waiting for the disk: losing that in a crash loses nothing that was
    /// acknowledged.
    ///
    /// # Errors
    /// As [`Store::put_job`].
    pub fn put_progress(&self, job: &Job) -> Result<(), StoreError> {
        self.inner.commit_lazily(&self.job_batch(job)?)
    }

    /// The writes that keep a job.
    pub(super) fn job_batch(&self, job: &Job) -> Result<Batch, StoreError> {
        let mut batch = Batch::default();
        put(&mut batch, keys::job(job.id), job)?;
        if job.state.is_finished() {
            batch.delete(keys::queue(job.id));
        } else {
            put(&mut batch, keys::queue(job.id), &QueueLink::to_job(job.id))?;
        }
        Ok(batch)
    }

    /// A job.
    ///
    /// # Errors
    /// [`StoreError::NoJob`]; [`StoreError::Damaged`].
    pub fn job(&self, id: JobId) -> Result<Job, StoreError> {
        get(&*self.inner.backend, &keys::job(id))?.ok_or(StoreError::NoJob { id })
    }

    /// Up to `limit` jobs, newest first, those older than `before` only.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn list_jobs(&self, before: Option<JobId>, limit: usize) -> Result<Vec<Job>, StoreError> {
        let before = before.map(keys::job);
        self.inner
            .backend
            .scan_back(keys::JOB, before.as_deref(), limit)?
            .iter()
            .map(|(key, value)| record::unseal(key, value))
            .collect()
    }

    /// The jobs that are not finished, oldest first.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn unfinished_jobs(&self) -> Result<Vec<Job>, StoreError> {
        self.inner
            .backend
            .scan(keys::QUEUE, None, usize::MAX)?
            .iter()
            .map(|(key, value)| self.job(record::unseal::<QueueLink>(key, value)?.job()))
            .collect()
    }

    /// Forgets the oldest finished jobs beyond the thousand latest.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the write's failure.
    pub fn forget_old_jobs(&self) -> Result<usize, StoreError> {
        let mut batch = Batch::default();
        let (mut finished, mut before) = (0, None);
        loop {
            let page = self.page_of_jobs::<StoreError>(before, usize::MAX, |_| Ok(()))?;
            for job in page.items.iter().filter(|job| job.state.is_finished()) {
                finished += 1;
                if finished > REMEMBERED {
                    batch.delete(keys::job(job.id));
                }
            }
            before = page.items.last().map(|job| job.id);
            if !page.more {
                break;
            }
        }
        let forgotten = batch.writes.len();
        if forgotten > 0 {
            self.inner.commit_lazily(&batch)?;
        }
        Ok(forgotten)
    }
}
