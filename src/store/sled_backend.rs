//! The production backend: sled 0.34, one tree, so that a batch over several record families is atomic.

use super::StoreError;
use super::backend::{Backend, Batch, Entry, prefix_end};
use super::failure::Failure;
use std::ops::Bound;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant};

/// How long a directory is tried again that the engine just closed: its own threads let go of it a little later.
const OPEN_WITHIN: Duration = Duration::from_secs(10);

/// The key-value engine in a directory of its own.
pub struct SledBackend {
    path: PathBuf,
    cache_bytes: u64,
    /// Why it is not open, only where opening it again failed.
    db: RwLock<Result<sled::Db, StoreError>>,
    failure: Arc<Failure>,
}

impl SledBackend {
    /// Opens or creates the engine's directory. A read that meets a full disk tells `failure`.
    ///
    /// # Errors
    /// Whatever keeps sled from opening it. sled can panic on a damaged directory; that is caught and is an error
    /// like the others.
    pub fn open(path: &Path, cache_bytes: u64, failure: Arc<Failure>) -> Result<Self, StoreError> {
        Ok(Self {
            path: path.to_owned(),
            cache_bytes,
            db: RwLock::new(Ok(open(path, cache_bytes)?)),
            failure,
        })
    }

    /// Whether the engine is open; it is not where opening it again failed.
    pub fn is_open(&self) -> bool {
        self.db.read().unwrap_or_else(PoisonError::into_inner).is_ok()
    }

    fn with<T>(&self, what: &str, work: impl FnOnce(&sled::Db) -> sled::Result<T>) -> Result<T, StoreError> {
        let db = self.db.read().unwrap_or_else(PoisonError::into_inner);
        match &*db {
            Ok(db) => caught(what, || work(db)),
            Err(why) => Err(why.clone()),
        }
    }

    /// Like [`with`](Self::with), for reads. The engine finishes what a write left undone when it reads, and after a
    /// write that met a full disk it repeats that failure on and on; opened anew, with the space of the reserve, it
    /// reads.
    fn read<T>(&self, what: &str, work: impl Fn(&sled::Db) -> sled::Result<T>) -> Result<T, StoreError> {
        let full = match self.with(what, &work) {
            Err(full @ StoreError::Full { .. }) => full,
            done => return done,
        };
        let _space = self.failure.hold_space();
        // Another read may have opened it meanwhile.
        match self.with(what, &work) {
            Err(StoreError::Full { .. }) => {}
            done => return done,
        }
        // Before it is opened anew, so that no write that is under way takes itself for done.
        self.failure.remember(full);
        self.reopen(&mut || Ok(()))?;
        self.with(what, work)
    }
}

impl Drop for SledBackend {
    /// Closing flushes, and after a failure that may fail or panic again, in whichever thread held the engine last.
    fn drop(&mut self) {
        let db = self.db.get_mut().unwrap_or_else(PoisonError::into_inner);
        close(std::mem::replace(db, Err(closed())));
    }
}

/// Closes the engine. What counts after a failure is what the next opening finds.
fn close(db: Result<sled::Db, StoreError>) {
    let done = caught("close the key-value store", || {
        drop(db);
        Ok(())
    });
    if let Err(error) = done {
        tracing::warn!(%error, "the key-value store was not closed in good order");
    }
}

/// What stands in the engine's place for as long as nothing is open; nobody sees it but after a panic.
fn closed() -> StoreError {
    StoreError::Io {
        what: "use the key-value store".to_owned(),
        detail: "it was closed and not opened again".to_owned(),
    }
}

fn open(path: &Path, cache_bytes: u64) -> Result<sled::Db, StoreError> {
    remove_unfinished_snapshots(path)?;
    // We flush before every acknowledgement ourselves; sled's timer would only add wake-ups of an idle process.
    let config = sled::Config::new()
        .path(path)
        .cache_capacity(cache_bytes)
        .mode(sled::Mode::LowSpace)
        .flush_every_ms(None);
    let began = Instant::now();
    loop {
        match caught("open the key-value store", || Ok(config.open()))? {
            Ok(db) => return Ok(db),
            // Nobody else can be here, since the data directory is locked: it is our own engine, just closed.
            Err(error) if is_held(&error) && began.elapsed() < OPEN_WITHIN => {
                std::thread::sleep(Duration::from_millis(20));
            }
            Err(error) => return Err(unopened(path, error)),
        }
    }
}

/// Whether somebody holds sled's own lock.
fn is_held(error: &sled::Error) -> bool {
    matches!(error, sled::Error::Io(error) if error.to_string().contains("could not acquire lock"))
}

/// sled writes a snapshot of its page table to `snap.….generating` and renames it. One left over from an abrupt stop
/// holds nothing the log does not, and keeps sled from opening where its name is not what sled expects.
fn remove_unfinished_snapshots(path: &Path) -> Result<(), StoreError> {
    let entries = match std::fs::read_dir(path) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => {
            return Err(StoreError::io(
                format!("list the key-value store {}", path.display()),
                &error,
            ));
        }
    };
    for entry in entries.flatten() {
        if entry.path().extension().is_some_and(|e| e == "generating") {
            std::fs::remove_file(entry.path())
                .map_err(|e| StoreError::io(format!("remove {}", entry.path().display()), &e))?;
        }
    }
    Ok(())
}

/// An engine that does not open its own directory calls that a defect, an unsupported version or a short read; all
/// are damage to us, and have a way out. What the file system refuses has none, and stays what it is.
fn unopened(path: &Path, error: sled::Error) -> StoreError {
    use std::io::ErrorKind as Kind;
    match error {
        sled::Error::Io(error)
            if matches!(
                error.kind(),
                Kind::PermissionDenied
                    | Kind::ReadOnlyFilesystem
                    | Kind::OutOfMemory
                    | Kind::ResourceBusy
                    | Kind::StorageFull
                    | Kind::QuotaExceeded
            ) =>
        {
            StoreError::io(format!("open the key-value store {}", path.display()), &error)
        }
        other => StoreError::damaged("the key-value store", other.to_string()),
    }
}

fn caught<T>(what: &str, work: impl FnOnce() -> sled::Result<T>) -> Result<T, StoreError> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(sled::Error::Io(error))) => Err(StoreError::io(what, &error)),
        Ok(Err(error @ sled::Error::Corruption { .. })) => {
            Err(StoreError::damaged("the key-value store", error.to_string()))
        }
        Ok(Err(error)) => Err(StoreError::Io {
            what: what.to_owned(),
            detail: error.to_string(),
        }),
        Err(panic) => Err(StoreError::damaged(
            "the key-value store",
            format!("the engine panicked: {}", panic_text(panic.as_ref())),
        )),
    }
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

impl Backend for SledBackend {
    fn get(&self, key: &[u8]) -> Result<Option<Vec<u8>>, StoreError> {
        self.read("read a record", |db| db.get(key))
            .map(|value| value.map(|v| v.to_vec()))
    }

    fn scan(&self, prefix: &[u8], after: Option<&[u8]>, limit: usize) -> Result<Vec<Entry>, StoreError> {
        let low = after.filter(|key| *key >= prefix).map_or_else(
            || Bound::Included(prefix.to_vec()),
            |key| Bound::Excluded(key.to_vec()),
        );
        let high = prefix_end(prefix).map_or(Bound::Unbounded, Bound::Excluded);
        if let (Bound::Excluded(low), Bound::Excluded(high)) = (&low, &high)
            && low >= high
        {
            return Ok(Vec::new());
        }
        self.read("scan records", |db| {
            db.range((low.clone(), high.clone()))
                .take(limit)
                .map(|entry| entry.map(|(k, v)| (k.to_vec(), v.to_vec())))
                .collect()
        })
    }

    fn scan_back(
        &self,
        prefix: &[u8],
        before: Option<&[u8]>,
        limit: usize,
    ) -> Result<Vec<Entry>, StoreError> {
        let end = prefix_end(prefix);
        let high = match (before, &end) {
            (Some(key), Some(end)) if key < end.as_slice() => Bound::Excluded(key.to_vec()),
            (Some(key), None) => Bound::Excluded(key.to_vec()),
            (_, Some(end)) => Bound::Excluded(end.clone()),
            (None, None) => Bound::Unbounded,
        };
        if let Bound::Excluded(high) = &high
            && high.as_slice() <= prefix
        {
            return Ok(Vec::new());
        }
        self.read("scan records", |db| {
            db.range((Bound::Included(prefix.to_vec()), high.clone()))
                .rev()
                .take(limit)
                .map(|entry| entry.map(|(k, v)| (k.to_vec(), v.to_vec())))
                .collect()
        })
    }

    fn apply(&self, batch: &Batch) -> Result<(), StoreError> {
        let mut sled_batch = sled::Batch::default();
        for (key, value) in &batch.writes {
            match value {
                Some(value) => sled_batch.insert(key.as_slice(), value.as_slice()),
                None => sled_batch.remove(key.as_slice()),
            }
        }
        self.with("write records", |db| db.apply_batch(sled_batch))
    }

    fn flush(&self) -> Result<(), StoreError> {
        self.with("flush the key-value store", |db| db.flush())
            .map(|_| ())
    }

    fn reopen(&self, meanwhile: &mut dyn FnMut() -> Result<(), StoreError>) -> Result<(), StoreError> {
        let mut db = self.db.write().unwrap_or_else(PoisonError::into_inner);
        close(std::mem::replace(&mut *db, Err(closed())));
        let done = meanwhile();
        *db = open(&self.path, self.cache_bytes);
        match &*db {
            Ok(_) => done,
            Err(error) => Err(error.clone()),
        }
    }
}
