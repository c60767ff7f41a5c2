//! Opening a store: lock, format, records, log, in this order; what a crash left is put right on the way.

use super::backend::{Backend, Batch};
use super::catalogue_log::{self, CatalogueLog};
use super::entry::{get, put};
use super::event::{Event, shapes_of};
use super::failure::{Failure, require_space};
use super::layout::{LOG, has_originals, has_records, is_empty};
use super::migrate::Format;
use super::payload::Number;
use super::records::Records;
use super::replay::{replay, sequence};
use super::standby::Standby;
use super::{
    Inner, Store, StoreError, StoreOptions, Writer, files, keys, migrate, private, rebuild, scrub, snapshot,
};
use crate::model::Class;
use std::fs::{File, TryLockError};
use std::path::Path;
use std::sync::{Arc, Mutex, RwLock};

impl Store {
    /// Opens or creates a data directory. Damaged records are rebuilt from the catalogue log and the stored files,
    /// the damaged ones kept aside; [`Store::recovery`] tells what was done. On a full disk the store opens read-only,
    /// and [`Store::recover`] makes it writable once there is space.
    ///
    /// # Errors
    /// [`StoreError::Locked`], [`StoreError::NewerFormat`], [`StoreError::Damaged`] where there is nothing to rebuild
    /// from, [`StoreError::Denied`] where the directory may not be written, [`StoreError::Full`] where a new one cannot
    /// be made, or a failure of the file system.
    pub fn open(path: &Path, options: &StoreOptions) -> Result<Self, StoreError> {
        let failure = Arc::new(Failure::none(path));
        let lock = prepare(path, &failure)?;
        refuse_to_forget(path)?;
        let mut recovery = Vec::new();
        let records = Records::open(path, options, &failure, &mut recovery)?;
        let log = path.join(LOG);
        let settled = match failure.get() {
            Some(full) => Err(full),
            None => settle(path, &records, &mut recovery),
        };
        let writer = match settled {
            Ok(writer) => writer,
            // The records stay as they are until there is space.
            Err(full @ StoreError::Full { .. }) => {
                failure.remember(full.clone());
                let in_log = catalogue_log::read(&log, |_, _| Ok(()))?.last;
                if in_log > sequence(&records)? {
                    records.read_log_instead(full)?;
                }
                Writer::closed(&log, sequence(&records)?)
            }
            Err(other) => return Err(other),
        };
        private::close_to_others(path)?;
        failure.acknowledge(writer.sequence);
        // Read-only until there is space, where there is none.
        if failure.get().is_none()
            && let Err(error) = failure.take_reserve()
        {
            failure.remember(error);
        }
        Ok(Parts {
            path,
            backend: Arc::new(records),
            writer,
            lock: Some(lock),
            failure,
            recovery,
        }
        .store())
    }

    /// Opens a data directory with records in a backend of the caller's.
    ///
    /// # Errors
    /// As for [`Store::open`]; damaged records are not rebuilt but reported.
    pub fn open_with(path: &Path, backend: Arc<dyn Backend>) -> Result<Self, StoreError> {
        let failure = Arc::new(Failure::none(path));
        let lock = prepare(path, &failure)?;
        rebuild::verify(&*backend)?;
        let mut recovery = Vec::new();
        let writer = settle(path, &*backend, &mut recovery)?;
        private::close_to_others(path)?;
        failure.acknowledge(writer.sequence);
        Ok(Parts {
            path,
            backend,
            writer,
            lock: Some(lock),
            failure,
            recovery,
        }
        .store())
    }

    /// Opens a data directory that cannot be written, in [recovery mode](Store::recovery_mode): the catalogue as its log
    /// has it. Nothing is written and no lock is taken.
    ///
    /// # Errors
    /// `why`, what keeps the directory from being written, where its log cannot be read either.
    pub fn open_read_only(path: &Path, why: StoreError) -> Result<Self, StoreError> {
        let log = snapshot::log_in_force(path);
        let reason = StoreError::RecoveryMode {
            why: format!("the data directory cannot be written ({why})"),
        };
        let standby = Standby::from_log(&log, u64::MAX, reason.clone()).map_err(|error| {
            tracing::error!(%error, "the catalogue log cannot be read either");
            why
        })?;
        let failure = Arc::new(Failure::none(path));
        failure.replace(Some(reason));
        Ok(Parts {
            path,
            backend: Arc::new(standby),
            writer: Writer::closed(&log, 0),
            lock: None,
            failure,
            recovery: Vec::new(),
        }
        .store())
    }
}

/// What a store is made of.
struct Parts<'a> {
    path: &'a Path,
    backend: Arc<dyn Backend>,
    writer: Writer,
    lock: Option<File>,
    failure: Arc<Failure>,
    recovery: Vec<String>,
}

impl Parts<'_> {
    fn store(self) -> Store {
        // The service warns of these; in an unpacked snapshot they are the rule.
        for line in &self.recovery {
            tracing::info!(line, "recovered");
        }
        Store {
            inner: Arc::new(Inner {
                path: self.path.to_owned(),
                backend: self.backend,
                writer: Mutex::new(self.writer),
                files: RwLock::new(()),
                pinned: Mutex::default(),
                snapshots: Mutex::new(()),
                damage: Mutex::default(),
                last_scrub: Mutex::new(scrub::read_note(self.path)),
                failure: self.failure,
                recovery: self.recovery,
                _lock: self.lock,
            }),
        }
    }
}

/// Makes the directory, takes its lock and checks its format.
fn prepare(path: &Path, failure: &Failure) -> Result<File, StoreError> {
    let fail = |e: std::io::Error| StoreError::io(format!("open the data directory {}", path.display()), &e);
    let has = |name: &str| path.join(name).exists();
    let new = !has_records(path) && !has(LOG) && !has("format");
    if new {
        // Said before anything is made, so that nothing half-made is left.
        let place = path.ancestors().find(|p| p.is_dir()).unwrap_or(Path::new("."));
        let what = format!(
            "make the data directory {}; free some space and start again",
            path.display()
        );
        require_space(place, &what)?;
    }
    if let Some(parent) = path.parent().filter(|_| !path.exists()) {
        std::fs::create_dir_all(parent).map_err(fail)?;
    }
    files::create_directory(path).map_err(fail)?;
    let lock_path = path.join("lock");
    let mut lock = files::options();
    let lock = lock
        .write(true)
        .create(true)
        .truncate(false)
        .open(&lock_path)
        .map_err(|e| {
            StoreError::io(
                format!("open the data directory: open {}", lock_path.display()),
                &e,
            )
        })?;
    match lock.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            return Err(StoreError::Locked {
                path: path.to_owned(),
            });
        }
        Err(TryLockError::Error(error)) => return Err(fail(error)),
    }
    // A disk that is full still opens, if it can: with what the reserve held.
    failure.give_up_reserve();
    private::close_to_others(path)?;
    snapshot::finish_restore(path)?;
    if migrate::check_format(path)? != Format::Current {
        match migrate::write_format(path) {
            Err(full @ StoreError::Full { .. }) if !new => {
                tracing::warn!(%full, "the format is written by a start with space on the disk");
            }
            done => done?,
        }
    }
    if !has_records(path) && !has(LOG) {
        // Before the engine, so that a first start that is cut off leaves a log to begin again from.
        CatalogueLog::open(&path.join(LOG), 0)?;
    }
    for entry in std::fs::read_dir(path).map_err(fail)?.flatten() {
        if entry.file_name().to_string_lossy().starts_with(".writing-") {
            files::remove(&entry.path())?;
        }
    }
    Ok(lock)
}

/// A directory with stored files but neither records nor a line of the log has lost its catalogue. Starting empty would
/// remove the files as unreferenced.
fn refuse_to_forget(path: &Path) -> Result<(), StoreError> {
    if has_originals(path) && !has_records(path) && is_empty(&path.join(LOG)) {
        return Err(StoreError::damaged(
            format!("the data directory {}", path.display()),
            "there are stored files, but 'sled' is gone and 'catalogue.log' is gone or empty; put one of them back, \
             or move 'originals' away to start empty",
        ));
    }
    Ok(())
}

impl Writer {
    /// One that takes no events; the last one's number is known all the same.
    fn closed(log: &Path, sequence: u64) -> Self {
        Self {
            log: CatalogueLog::closed(log),
            sequence,
        }
    }
}

/// Brings records and log to the same state, whatever a crash or a failed write left, and opens the log.
pub(super) fn settle(
    path: &Path,
    backend: &dyn Backend,
    recovery: &mut Vec<String>,
) -> Result<Writer, StoreError> {
    migrate::run(backend)?;
    let log_path = path.join(LOG);
    let (scan, replayed) = replay(backend, &log_path)?;
    if replayed > 0 {
        recovery.push(format!(
            "{replayed} changes of the catalogue were taken from the catalogue log"
        ));
    }
    let mut log = CatalogueLog::open(&log_path, scan.good_length)?;
    let mut sequence = sequence(backend)?;
    if scan.last < sequence || !scan.damaged.is_empty() {
        for (line, detail) in &scan.damaged {
            recovery.push(format!(
                "line {line} of the catalogue log could not be read: {detail}"
            ));
        }
        if scan.last < sequence {
            recovery.push(format!(
                "the catalogue log ended at change {}, the records at {sequence}; the log was written anew",
                scan.last
            ));
        }
        sequence = rewrite_log(backend, &mut log, sequence.max(scan.last))?;
    }
    Ok(Writer { log, sequence })
}

/// Writes the log anew from the records and returns the last event's number. Restoring what is there changes nothing,
/// so a crash between the two writes does no harm.
fn rewrite_log(backend: &dyn Backend, log: &mut CatalogueLog, last: u64) -> Result<u64, StoreError> {
    let mut events = Vec::new();
    if let (Some(Number(generation)), Some(parameters)) = (
        get::<Number>(backend, keys::META_LAST_GENERATION)?,
        get(backend, keys::META_PARAMETERS)?,
    ) {
        events.push(Event::Indexed {
            generation,
            parameters: Box::new(parameters),
        });
    }
    for (key, value) in backend.scan(keys::CLASS, None, usize::MAX)? {
        let class: Class = super::record::unseal(&key, &value)?;
        let shapes = shapes_of(backend, class.id)?;
        events.push(Event::ClassRestored { class });
        if !shapes.is_empty() {
            events.push(Event::ShapesRestored { shapes });
        }
    }
    for (key, value) in backend.scan(keys::API_KEY, None, usize::MAX)? {
        let key = super::record::unseal(&key, &value)?;
        events.push(Event::KeyCreated { key });
    }
    log.rewrite(last + 1, &events)?;
    let sequence = last + events.len() as u64;
    let mut batch = Batch::default();
    put(&mut batch, keys::META_SEQUENCE.to_vec(), &Number(sequence))?;
    backend.apply(&batch)?;
    backend.flush()?;
    Ok(sequence)
}
