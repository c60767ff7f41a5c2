//! Pages of long lists: they end at a number of bytes too, so that what a reader holds does not depend on how long the
//! items are.

use super::backend::Entry;
use super::record::{self, Record};
use super::{Store, StoreError, keys};
use crate::model::{ClassId, Job, JobId, Shape, ShapeId};

/// Bytes of records after which a page ends.
const PAGE_BYTES: usize = 1 << 20;
/// Records that are read at a time.
const CHUNK: usize = 8;

/// A part of a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page<T> {
    /// At least one item, where there is one.
    pub items: Vec<T>,
    /// Whether more items follow.
    pub more: bool,
}

impl Store {
    /// Up to `limit` shapes of a class in the order of their creation, those after `after` only. `take` is asked for each
    /// with the bytes of its record.
    ///
    /// # Errors
    /// [`StoreError::NoClass`]; [`StoreError::Damaged`]; those of `take`.
    pub fn page_of_shapes<E: From<StoreError>>(
        &self,
        class: ClassId,
        after: Option<ShapeId>,
        limit: usize,
        take: impl FnMut(usize) -> Result<(), E>,
    ) -> Result<Page<Shape>, E> {
        self.class(class)?;
        let after = after.map(|id| keys::shape(class, id));
        let prefix = keys::shapes_of(class);
        let scan = |after: Option<&[u8]>| self.inner.backend.scan(&prefix, after, CHUNK);
        page(after, limit, scan, take)
    }

    /// Up to `limit` jobs, newest first, those older than `before` only. `take` is asked for each with the bytes of its
    /// record.
    ///
    /// # Errors
    /// [`StoreError::Damaged`]; those of `take`.
    pub fn page_of_jobs<E: From<StoreError>>(
        &self,
        before: Option<JobId>,
        limit: usize,
        take: impl FnMut(usize) -> Result<(), E>,
    ) -> Result<Page<Job>, E> {
        let scan = |before: Option<&[u8]>| self.inner.backend.scan_back(keys::JOB, before, CHUNK);
        page(before.map(keys::job), limit, scan, take)
    }
}

fn page<T: Record, E: From<StoreError>>(
    mut last: Option<Vec<u8>>,
    limit: usize,
    scan: impl Fn(Option<&[u8]>) -> Result<Vec<Entry>, StoreError>,
    mut take: impl FnMut(usize) -> Result<(), E>,
) -> Result<Page<T>, E> {
    let mut items = Vec::new();
    let mut bytes = 0;
    loop {
        let entries = scan(last.as_deref())?;
        let found = entries.len();
        for (key, value) in entries {
            if items.len() >= limit || bytes > PAGE_BYTES {
                return Ok(Page { items, more: true });
            }
            bytes += value.len();
            take(value.len())?;
            items.push(record::unseal(&key, &value)?);
            last = Some(key);
        }
        if found < CHUNK {
            return Ok(Page { items, more: false });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{JobKind, ReindexScope};
    use crate::store::StoreOptions;
    use jiff::Timestamp;

    #[test]
    fn a_page_of_long_items_ends_before_its_limit_and_the_next_goes_on() {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(directory.path(), &StoreOptions::default()).unwrap();
        let classes = vec![ClassId::new(); 10_000];
        let made: Vec<JobId> = (0..20)
            .map(|_| {
                let kind = JobKind::Reindex {
                    scope: ReindexScope::Classes(classes.clone()),
                    parameters: None,
                };
                let job = Job::new(kind, Timestamp::now());
                store.put_job(&job).unwrap();
                job.id
            })
            .collect();
        let (mut seen, mut before, mut pages) = (Vec::new(), None, 0);
        loop {
            let mut taken = 0;
            let page = store
                .page_of_jobs::<StoreError>(before, 1000, |bytes| {
                    taken += bytes;
                    Ok(())
                })
                .unwrap();
            assert!(taken < PAGE_BYTES + (1 << 19), "{taken}");
            pages += 1;
            before = page.items.last().map(|job| job.id);
            seen.extend(page.items.iter().map(|job| job.id));
            if !page.more {
                break;
            }
        }
        seen.reverse();
        assert_eq!(seen, made);
        assert!(pages > 2, "{pages}");
        let two = store.page_of_jobs::<StoreError>(None, 2, |_| Ok(())).unwrap();
        assert_eq!((two.items.len(), two.more), (2, true));
        let rest = store
            .page_of_jobs::<StoreError>(Some(made[1]), 2, |_| Ok(()))
            .unwrap();
        assert_eq!((rest.items[0].id, rest.more), (made[0], false));
    }
}
