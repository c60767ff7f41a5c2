//! A look at everything that is stored: every uploaded file against its hash, every record and every line of the
//! catalogue log against its checksum. What is found is kept as [`Store::damage`]; nothing is changed.

use super::layout::LOG;
use super::{Store, StoreError, catalogue_log, files, keys, record};
use crate::model::ContentHash;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{MutexGuard, PoisonError};

/// Records checked per scan.
const CHUNK: usize = 64;
/// The file in the data directory that says when everything was looked at last.
const NOTE: &str = "scrub.json";

/// What a look at everything found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScrubReport {
    /// When it began.
    pub started_at: Timestamp,
    /// When it ended.
    pub finished_at: Timestamp,
    /// Uploaded files looked at.
    pub originals: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Records looked at, and lines of the catalogue log.
    pub records: u64,
    /// Uploaded files that are damaged or gone.
    pub damaged_originals: Vec<ContentHash>,
    /// Records and lines that fail their checksum.
    pub damaged_records: Vec<String>,
}

/// The note of the last complete look; one that cannot be read is as good as none.
pub(super) fn read_note(data: &Path) -> Option<ScrubReport> {
    let note = std::fs::read(data.join(NOTE)).ok()?;
    serde_json::from_slice(&note).ok()
}

impl Store {
    /// Looks at everything. `pace` is told the bytes read since it was told last; it may sleep, and may break the work
    /// off. Files and records that come or go meanwhile do no harm.
    ///
    /// # Errors
    /// A failure that is not damage, such as of a full disk. `None` where `pace` broke it off.
    pub fn scrub(
        &self,
        pace: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<Option<ScrubReport>, StoreError> {
        let started_at = Timestamp::now();
        let mut report = ScrubReport {
            started_at,
            finished_at: started_at,
            originals: 0,
            bytes: 0,
            records: 0,
            damaged_originals: Vec::new(),
            damaged_records: Vec::new(),
        };
        let mut damaged = BTreeSet::new();
        if self.scrub_records(&mut report, &mut damaged, pace)?.is_break()
            || self.scrub_log(&mut report, &mut damaged, pace)?.is_break()
        {
            return Ok(None);
        }
        report.damaged_records = damaged.iter().cloned().collect();
        self.note_records(damaged);
        if self.scrub_originals(&mut report, pace)?.is_break() {
            return Ok(None);
        }
        report.finished_at = Timestamp::now();
        if self.inner.writable().is_ok() {
            let note = serde_json::to_vec_pretty(&report).map_err(|e| StoreError::Io {
                what: format!("encode {NOTE}"),
                detail: e.to_string(),
            })?;
            files::write_durably(&self.path().join(NOTE), &note)?;
        }
        *self.last_report() = Some(report.clone());
        Ok(Some(report))
    }

    /// What the last complete look at everything found; `None` where there was none.
    pub fn last_scrub(&self) -> Option<ScrubReport> {
        self.last_report().clone()
    }

    fn last_report(&self) -> MutexGuard<'_, Option<ScrubReport>> {
        // Assigned whole, never half.
        self.inner
            .last_scrub
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Looks again at the files the last scrub found damaged, so that a restart does not forget them.
    pub fn recheck_damage(&self) {
        for content in self
            .last_scrub()
            .map_or_else(Vec::new, |last| last.damaged_originals)
        {
            // Remembered by the check itself.
            let _ = self.check_original(content, &mut |_| ControlFlow::Continue(()));
        }
    }

    fn scrub_records(
        &self,
        report: &mut ScrubReport,
        damaged: &mut BTreeSet<String>,
        pace: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, StoreError> {
        let mut after: Option<Vec<u8>> = None;
        loop {
            let entries = match self.inner.backend.scan(b"", after.as_deref(), CHUNK) {
                Ok(entries) => entries,
                // The engine itself cannot read on.
                Err(StoreError::Damaged { what, detail }) => {
                    tracing::error!(what, detail, "the records cannot be read to their end");
                    damaged.insert(what);
                    return Ok(ControlFlow::Continue(()));
                }
                Err(other) => return Err(other),
            };
            let Some((last, _)) = entries.last() else {
                return Ok(ControlFlow::Continue(()));
            };
            after = Some(last.clone());
            let mut bytes = 0;
            for (key, value) in &entries {
                bytes += value.len() as u64;
                report.records += 1;
                if let Err(error) = record::check(key, value) {
                    tracing::error!(%error, "a record is damaged; the next start rebuilds it from the catalogue log");
                    damaged.insert(record::describe(key));
                }
            }
            if pace(bytes).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
    }

    fn scrub_log(
        &self,
        report: &mut ScrubReport,
        damaged: &mut BTreeSet<String>,
        pace: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, StoreError> {
        let scan = catalogue_log::read(&self.path().join(LOG), |_, _| Ok(()))?;
        report.records += scan.events;
        for (line, detail) in &scan.damaged {
            tracing::error!(
                line,
                detail,
                "the catalogue log is damaged; the next start writes it anew from the records"
            );
            damaged.insert(format!("line {line} of {LOG}"));
        }
        Ok(pace(scan.good_length))
    }

    fn scrub_originals(
        &self,
        report: &mut ScrubReport,
        pace: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, StoreError> {
        let mut after: Option<Vec<u8>> = None;
        let mut last = None;
        loop {
            let entries = (self.inner.backend).scan(keys::REFERENCE, after.as_deref(), CHUNK)?;
            let Some((end, _)) = entries.last() else {
                return Ok(ControlFlow::Continue(()));
            };
            after = Some(end.clone());
            for content in entries
                .iter()
                .filter_map(|(key, _)| keys::content_of_reference(key))
            {
                // Several shapes may come from one file; their references follow each other.
                if last.replace(content) == Some(content) {
                    continue;
                }
                match self.check_original(content, pace) {
                    Ok(bytes) => report.bytes += bytes,
                    Err(StoreError::Original { .. }) => report.damaged_originals.push(content),
                    Err(other) => return Err(other),
                }
                report.originals += 1;
                if pace(0).is_break() {
                    return Ok(ControlFlow::Break(()));
                }
            }
        }
    }
}
