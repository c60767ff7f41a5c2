//! Which job an `Idempotency-Key` started, so that asking again starts no second one.

use super::entry::{get, put};
use super::payload::{instant, only, pack, unpack};
use super::record::{Family, Record};
use super::{Store, StoreError, keys, record};
use crate::model::{ContentHash, Job, JobId};
use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};

/// How long an answer is remembered.
const REMEMBERED: SignedDuration = SignedDuration::from_hours(24);

/// A request that was answered with a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remembered {
    /// What was asked.
    pub request: ContentHash,
    /// The job it started.
    pub job: JobId,
    /// When.
    pub at: Timestamp,
}

#[derive(Serialize, Deserialize)]
struct RememberedV1 {
    request: [u8; 32],
    job: [u8; 16],
    at: i128,
}

impl Record for Remembered {
    const FAMILY: Family = Family::Idempotency;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        pack(&RememberedV1 {
            request: self.request.to_bytes(),
            job: self.job.to_bytes(),
            at: self.at.as_nanosecond(),
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let v: RememberedV1 = unpack(payload)?;
        Ok(Self {
            request: ContentHash::from_bytes(v.request),
            job: JobId::from_bytes(v.job),
            at: instant(v.at)?,
        })
    }
}

impl Store {
    /// What was answered under this hash of caller and `Idempotency-Key` in the last 24 hours.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn remembered(&self, key: ContentHash, now: Timestamp) -> Result<Option<Remembered>, StoreError> {
        let found: Option<Remembered> = get(&*self.inner.backend, &keys::idempotency(key))?;
        Ok(found.filter(|r| now.duration_since(r.at) < REMEMBERED))
    }

    /// Writes a new job and, in the same batch, the request it answers. Forgets requests older than 24 hours.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the write's failure.
    pub fn put_new_job(
        &self,
        job: &Job,
        answers: Option<(ContentHash, ContentHash)>,
    ) -> Result<(), StoreError> {
        let mut batch = self.job_batch(job)?;
        if let Some((key, request)) = answers {
            for (at, value) in self.inner.backend.scan(keys::IDEMPOTENCY, None, usize::MAX)? {
                let old: Remembered = record::unseal(&at, &value)?;
                if job.enqueued_at.duration_since(old.at) >= REMEMBERED {
                    batch.delete(at);
                }
            }
            let remembered = Remembered {
                request,
                job: job.id,
                at: job.enqueued_at,
            };
            put(&mut batch, keys::idempotency(key), &remembered)?;
        }
        self.inner.commit(&batch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_remembered_request_survives_its_record() {
        let remembered = Remembered {
            request: ContentHash::of(b"body"),
            job: JobId::new(),
            at: Timestamp::from_second(1_800_000_000).unwrap(),
        };
        let payload = remembered.encode().unwrap();
        assert_eq!(Remembered::decode(1, &payload), Ok(remembered));
        assert!(Remembered::decode(2, &payload).is_err());
    }
}
