//! Records that cannot be opened or fail their checksum are put aside and rebuilt.
//!
//! The new records are made in `sled.rebuilding`, renamed to `sled.rebuilt` once complete, and take the place of
//! `sled`, which becomes `sled.damaged-<time>`. Killed at any point, the next start goes on from there.

use super::backend::{Backend, Batch, Entry};
use super::entry::get;
use super::event::files_of;
use super::failure::Failure;
use super::layout::{LOG, REBUILT, RECORDS, has_originals, is_empty};
use super::payload::Number;
use super::replay::replay;
use super::sled_backend::SledBackend;
use super::{StoreError, StoreOptions, files, keys, migrate, record};
use crate::model::Generation;
use jiff::Timestamp;
use std::path::Path;
use std::sync::Arc;

/// Records checked per scan.
const CHUNK: usize = 256;

/// Families the log cannot give back; their intact records are carried over.
const CARRIED: [&[u8]; 7] = [
    keys::DICTIONARY,
    keys::BASELINE,
    keys::GENERATION,
    keys::JOB,
    keys::QUEUE,
    keys::USAGE,
    keys::IDEMPOTENCY,
];

/// Opens the records, rebuilding them first where they are damaged.
pub(super) fn open_records(
    data: &Path,
    options: &StoreOptions,
    failure: &Arc<Failure>,
    recovery: &mut Vec<String>,
) -> Result<SledBackend, StoreError> {
    let sled = data.join(RECORDS);
    remove_directory(&data.join("sled.rebuilding"))?;
    if data.join(REBUILT).exists() {
        put_in_place(data, recovery)?;
    }
    let (damage, salvaged) = match SledBackend::open(&sled, options.cache_bytes, failure.clone()) {
        Ok(backend) => match verify(&backend) {
            Ok(()) => return Ok(backend),
            Err(damage @ StoreError::Damaged { .. }) => (damage, salvage(&backend)),
            Err(other) => return Err(other),
        },
        Err(damage @ StoreError::Damaged { .. }) => (damage, Vec::new()),
        Err(other) => return Err(other),
    };
    if failure.is_disk_full() {
        // Without space the engine fails in ways that look like damage. Looked at again once there is space.
        return Err(StoreError::Full {
            detail: format!("open the records ({damage})"),
        });
    }
    let log = data.join(LOG);
    if !log.exists() || (is_empty(&log) && has_originals(data)) {
        return Err(StoreError::damaged(
            format!("the data directory {}", data.display()),
            format!("{damage}, and there is no catalogue log to rebuild from; restore a backup"),
        ));
    }
    tracing::error!(%damage, "the records are damaged; rebuilding them");
    recovery.push(format!(
        "the records were damaged ({damage}) and have been rebuilt"
    ));
    rebuild(data, options, salvaged, recovery)?;
    put_in_place(data, recovery)?;
    SledBackend::open(&sled, options.cache_bytes, failure.clone())
}

/// Checks the envelope of every record.
pub(super) fn verify(backend: &dyn Backend) -> Result<(), StoreError> {
    let mut after: Option<Vec<u8>> = None;
    loop {
        let entries = backend.scan(b"", after.as_deref(), CHUNK)?;
        let Some((last, _)) = entries.last() else {
            return Ok(());
        };
        after = Some(last.clone());
        for (key, value) in &entries {
            record::check(key, value)?;
        }
    }
}

/// The intact records of the families the log cannot give back. Stops where the engine fails.
fn salvage(backend: &dyn Backend) -> Vec<Entry> {
    let mut found = Vec::new();
    for prefix in CARRIED.into_iter().chain([keys::META_GENERATION]) {
        let mut after: Option<Vec<u8>> = None;
        while let Ok(entries) = backend.scan(prefix, after.as_deref(), CHUNK) {
            let Some((last, _)) = entries.last() else { break };
            after = Some(last.clone());
            found.extend(entries.into_iter().filter(|(k, v)| record::check(k, v).is_ok()));
        }
    }
    found
}

fn rebuild(
    data: &Path,
    options: &StoreOptions,
    salvaged: Vec<Entry>,
    recovery: &mut Vec<String>,
) -> Result<(), StoreError> {
    let building = data.join("sled.rebuilding");
    // One that meets a full disk gives up: nothing of what is being made is needed yet.
    let backend = SledBackend::open(&building, options.cache_bytes, Arc::new(Failure::none(&building)))?;
    migrate::run(&backend)?;
    let carried = salvaged.len();
    for chunk in salvaged.chunks(CHUNK) {
        let mut batch = Batch::default();
        for (key, value) in chunk {
            batch.put(key.clone(), value.clone());
        }
        backend.apply(&batch)?;
    }
    backend.flush()?;
    let (scan, replayed) = replay(&backend, &data.join(LOG))?;
    recovery.push(format!(
        "{replayed} changes of the catalogue were replayed, {carried} intact records of jobs and dictionaries kept"
    ));
    for (line, detail) in &scan.damaged {
        recovery.push(format!(
            "line {line} of the catalogue log could not be read, so what it says is lost: {detail}"
        ));
    }
    drop_broken_links(&backend, recovery)?;
    report_missing_files(data, &backend, recovery)?;
    drop(backend);
    rename(&building, &data.join(REBUILT))?;
    files::sync_directory(data)
}

/// A generation that misses a dictionary cannot be served, and a queue entry without its job cannot be run.
fn drop_broken_links(backend: &dyn Backend, recovery: &mut Vec<String>) -> Result<(), StoreError> {
    let mut batch = Batch::default();
    if let Some(Number(number)) = get::<Number>(backend, keys::META_GENERATION)? {
        let generation: Option<Generation> = get(backend, &keys::generation(number))?;
        let whole = match &generation {
            None => false,
            Some(generation) => generation
                .dictionary_keys()
                .map(|key| backend.get(&keys::dictionary(key)))
                .collect::<Result<Vec<_>, _>>()?
                .iter()
                .all(Option::is_some),
        };
        if !whole {
            batch.delete(keys::META_GENERATION.to_vec());
        }
    }
    for (key, _) in backend.scan(keys::QUEUE, None, usize::MAX)? {
        let job = [keys::JOB, &key[keys::QUEUE.len()..]].concat();
        if backend.get(&job)?.is_none() {
            batch.delete(key);
        }
    }
    backend.apply(&batch)?;
    backend.flush()?;
    if backend.get(keys::META_GENERATION)?.is_none() {
        recovery.push(
            "the index was lost and has to be learnt again; its classes and shapes are there".to_owned(),
        );
    }
    Ok(())
}

fn report_missing_files(
    data: &Path,
    backend: &dyn Backend,
    recovery: &mut Vec<String>,
) -> Result<(), StoreError> {
    for (key, value) in backend.scan(keys::SHAPE, None, usize::MAX)? {
        let shape: crate::model::Shape = record::unseal(&key, &value)?;
        for content in files_of(&shape) {
            let name = content.to_string();
            if !data.join("originals").join(&name[..2]).join(&name).exists() {
                recovery.push(format!("the file {name} of shape {} is missing", shape.id));
            }
        }
    }
    Ok(())
}

/// Moves `sled` aside and `sled.rebuilt` into its place.
fn put_in_place(data: &Path, recovery: &mut Vec<String>) -> Result<(), StoreError> {
    let sled = data.join(RECORDS);
    if sled.exists() {
        let aside = format!("sled.damaged-{}", Timestamp::now().as_millisecond());
        rename(&sled, &data.join(&aside))?;
        recovery.push(format!("the damaged records are kept in '{aside}'"));
    }
    rename(&data.join(REBUILT), &sled)?;
    files::sync_directory(data)
}

fn rename(from: &Path, to: &Path) -> Result<(), StoreError> {
    std::fs::rename(from, to).map_err(|e| StoreError::io(format!("rename {}", from.display()), &e))
}

fn remove_directory(path: &Path) -> Result<(), StoreError> {
    match std::fs::remove_dir_all(path) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(StoreError::io(format!("remove {}", path.display()), &error)),
    }
}
