//! Opening a store: lock, format, records, log, in this order; what a crash left is put right on the way.

use super::backend::{Backend, Batch};
use super::catalogue_log::{self, CatalogueLog, LogScan};
use super::event::{self, Event, get, put, shapes_of};
use super::failure::Failure;
use super::payload::Number;
use super::{Inner, Store, StoreError, StoreOptions, Writer, files, keys, migrate, rebuild, snapshot};
use crate::model::Class;
use std::fs::{File, TryLockError};
use std::path::Path;
use std::sync::{Arc, Mutex, RwLock};

pub(super) const LOG: &str = "catalogue.log";

/// Replayed events between two flushes.
const REPLAY_FLUSH: u64 = 256;

impl Store {
    /// Opens or creates a data directory. Damaged records are rebuilt from the catalogue log and the stored files,
    /// the damaged ones kept aside; [`Store::recovery`] tells what was done.
    ///
    /// # Errors
    /// [`StoreError::Locked`], [`StoreError::NewerFormat`], [`StoreError::Damaged`] where there is nothing to rebuild
    /// from, or a failure of the file system.
    pub fn open(path: &Path, options: &StoreOptions) -> Result<Self, StoreError> {
        let lock = prepare(path)?;
        let mut recovery = Vec::new();
        // A disk that is full still opens, if it can: with what the reserve held.
        let failure = Arc::new(Failure::none(path));
        failure.give_up_reserve();
        let backend = rebuild::open_records(path, options, &failure, &mut recovery)?;
        let store = finish(path, Arc::new(backend), lock, failure, recovery)?;
        // Read-only until there is space, where there is none.
        if let Err(error) = store.inner.failure.take_reserve() {
            store.inner.fail(error);
        }
        Ok(store)
    }

    /// Opens a data directory with records in a backend of the caller's.
    ///
    /// # Errors
    /// As for [`Store::open`]; damaged records are not rebuilt but reported.
    pub fn open_with(path: &Path, backend: Arc<dyn Backend>) -> Result<Self, StoreError> {
        let lock = prepare(path)?;
        rebuild::verify(&*backend)?;
        finish(path, backend, lock, Arc::new(Failure::none(path)), Vec::new())
    }
}

/// Makes the directory, takes its lock and checks its format.
fn prepare(path: &Path) -> Result<File, StoreError> {
    let fail = |e: std::io::Error| StoreError::io(format!("open the data directory {}", path.display()), &e);
    std::fs::create_dir_all(path).map_err(fail)?;
    let lock = File::create(path.join("lock")).map_err(fail)?;
    match lock.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            return Err(StoreError::Locked {
                path: path.to_owned(),
            });
        }
        Err(TryLockError::Error(error)) => return Err(fail(error)),
    }
    snapshot::finish_restore(path)?;
    let format = migrate::check_format(path)?;
    refuse_to_forget(path, format.is_some())?;
    if format != Some(migrate::FORMAT) {
        migrate::write_format(path)?;
    }
    for entry in std::fs::read_dir(path).map_err(fail)?.flatten() {
        if entry.file_name().to_string_lossy().starts_with(".writing-") {
            files::remove(&entry.path())?;
        }
    }
    Ok(lock)
}

/// A directory with stored files but neither records nor log has lost its catalogue. Starting empty would remove the
/// files as unreferenced.
fn refuse_to_forget(path: &Path, used: bool) -> Result<(), StoreError> {
    let has = |name: &str| path.join(name).exists();
    let files = std::fs::read_dir(path.join("originals")).is_ok_and(|mut d| d.next().is_some());
    if used && files && !has("sled") && !has("sled.rebuilt") && !has(LOG) {
        return Err(StoreError::damaged(
            format!("the data directory {}", path.display()),
            "there are stored files, but both 'sled' and 'catalogue.log' are gone; put one of them back, \
             or move 'originals' away to start empty",
        ));
    }
    Ok(())
}

fn finish(
    path: &Path,
    backend: Arc<dyn Backend>,
    lock: File,
    failure: Arc<Failure>,
    mut recovery: Vec<String>,
) -> Result<Store, StoreError> {
    let writer = settle(path, &*backend, &mut recovery)?;
    // Who opens it warns of these; in an unpacked snapshot they are the rule.
    for line in &recovery {
        tracing::info!(line, "recovered");
    }
    Ok(Store {
        inner: Arc::new(Inner {
            path: path.to_owned(),
            backend,
            writer: Mutex::new(writer),
            files: RwLock::new(()),
            pinned: Mutex::default(),
            snapshots: Mutex::new(()),
            failure,
            recovery,
            _lock: lock,
        }),
    })
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

fn sequence(backend: &dyn Backend) -> Result<u64, StoreError> {
    let sequence: Option<Number> = get(backend, keys::META_SEQUENCE)?;
    Ok(sequence.map_or(0, |n| n.0))
}

/// Applies the events of the log the records have not seen. Returns what the log holds and how many were applied.
pub(super) fn replay(backend: &dyn Backend, log: &Path) -> Result<(LogScan, u64), StoreError> {
    let applied = sequence(backend)?;
    let mut replayed = 0;
    let scan = catalogue_log::read(log, |number, event| {
        if number > applied {
            let mut batch = event::stage(backend, &event)?;
            put(&mut batch, keys::META_SEQUENCE.to_vec(), &Number(number))?;
            backend.apply(&batch)?;
            replayed += 1;
            if replayed % REPLAY_FLUSH == 0 {
                backend.flush()?;
            }
        }
        Ok(())
    })?;
    if replayed > 0 {
        backend.flush()?;
    }
    Ok((scan, replayed))
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
