//! What is known to go wrong with the engine, held in figures. `recovery.rs` has the leftover snapshot.

use crate::name;
use shapelex::model::{Job, JobKind, ReindexScope};
use shapelex::store::{Store, StoreOptions};
use std::path::Path;
use std::time::{Duration, SystemTime};
use tempfile::TempDir;

fn size(path: &Path) -> u64 {
    let entries = std::fs::read_dir(path).unwrap().flatten();
    entries
        .map(|entry| match entry.path().is_dir() {
            true => size(&entry.path()),
            false => entry.metadata().unwrap().len(),
        })
        .sum()
}

fn job() -> Job {
    let kind = JobKind::Reindex {
        scope: ReindexScope::All,
        parameters: None,
    };
    Job::new(kind, jiff::Timestamp::now())
}

#[test]
fn overwriting_does_not_grow_the_directory_without_end() {
    let directory = TempDir::new().unwrap();
    let store = Store::open(directory.path(), &StoreOptions::default()).unwrap();
    let job = job();
    let mut sizes = Vec::new();
    for round in 0..20_000 {
        store.put_job(&job, round % 50 == 49).unwrap();
        if round % 5000 == 4999 {
            sizes.push(size(&directory.path().join("sled")) >> 10);
        }
    }
    println!("after 5000, 10000, 15000, 20000 overwrites of one record: {sizes:?} KiB");
    assert!(sizes[3] < 16 << 10, "{sizes:?} KiB");
    assert!(
        sizes[3] < 4 * sizes[0].max(1024),
        "it grows with every write: {sizes:?} KiB"
    );
}

#[test]
fn an_idle_store_writes_nothing_by_itself() {
    let directory = TempDir::new().unwrap();
    let store = Store::open(directory.path(), &StoreOptions::default()).unwrap();
    store.create_class(name("cat")).unwrap();
    store.put_job(&job(), false).unwrap();
    let modified = || -> (SystemTime, u64) {
        let sled = directory.path().join("sled");
        let db = std::fs::metadata(sled.join("db")).unwrap();
        (db.modified().unwrap(), size(&sled))
    };
    let before = modified();
    // More than twice the engine's own timer, which is off.
    std::thread::sleep(Duration::from_millis(1200));
    assert_eq!(modified(), before);
    store.flush().unwrap();
    assert_ne!(
        modified(),
        before,
        "what was waiting is written when it is asked for"
    );
}
