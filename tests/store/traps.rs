//! What is known to go wrong with the engine, held in figures. `recovery.rs` has the leftover snapshot.

use crate::name;
use faer::Mat;
use shapelex::model::{Job, JobKind, ReindexScope};
use shapelex::store::{Dictionaries, Store, StoreOptions};
use shapelex_core::coding::Dictionary;
use shapelex_core::parameters::Channel;
use std::path::Path;
use std::sync::Arc;
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
    let mut sizes = Vec::new();
    for round in 0..600_u64 {
        // Of the default size: 128 atoms of 100 numbers, 51 kB.
        let mut atoms = Mat::from_fn(100, 128, |r, c| {
            ((r * 31 + c * 17) as u64 + round) as f64 % 101.0 + 1.0
        });
        for atom in atoms.col_iter_mut() {
            let norm = atom.norm_l2();
            atom.iter_mut().for_each(|x| *x /= norm);
        }
        let dictionary = Arc::new(Dictionary::new(atoms).unwrap());
        let entry = Dictionaries::from([(Channel::Plain, dictionary)]);
        store.put_dictionaries("class-0", &entry).unwrap();
        if round % 150 == 149 {
            sizes.push(size(&directory.path().join("sled")) >> 10);
        }
    }
    println!("after 150, 300, 450 and 600 overwrites of 51 kB: {sizes:?} KiB");
    // 30 MB were written; what is there is a fraction of it.
    assert!(sizes.iter().all(|size| *size < 12 << 10), "{sizes:?} KiB");
}

#[test]
fn an_idle_store_writes_nothing_by_itself() {
    let directory = TempDir::new().unwrap();
    let store = Store::open(directory.path(), &StoreOptions::default()).unwrap();
    store.create_class(name("cat")).unwrap();
    store.put_progress(&job()).unwrap();
    let modified = || -> (SystemTime, u64) {
        let sled = directory.path().join("sled");
        let db = std::fs::metadata(sled.join("db")).unwrap();
        (db.modified().unwrap(), size(&sled))
    };
    // What the engine was still about when it was asked.
    std::thread::sleep(Duration::from_millis(400));
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
