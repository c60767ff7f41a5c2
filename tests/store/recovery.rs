//! Damage of every part of the data directory, on the real engine.

use crate::{name, shape};
use shapelex::model::{Class, Job, JobKind, ReindexScope, Shape};
use shapelex::store::{Store, StoreError, StoreOptions};
use std::path::Path;
use tempfile::TempDir;

fn open(path: &Path) -> Result<Store, StoreError> {
    Store::open(path, &StoreOptions::default())
}

type Catalogue = Vec<(Class, Vec<Shape>)>;

fn catalogue(store: &Store) -> Catalogue {
    let classes = store.list_classes(None, 1000).unwrap();
    classes
        .into_iter()
        .map(|class| {
            let shapes = store.list_shapes(class.id, None, 1000).unwrap();
            (class, shapes)
        })
        .collect()
}

/// A store with some history, a waiting job, and what it holds.
fn filled(path: &Path) -> (Catalogue, Job) {
    let store = open(path).unwrap();
    for i in 0..6 {
        let class = store.create_class(name(&format!("class {i}"))).unwrap().id;
        let shapes = (0..4).map(|k| shape(&format!("{i}-{k}"), None)).collect();
        let added = store.add_shapes(class, shapes).unwrap();
        store.delete_shape(added[1].shape.id).unwrap();
        if i % 3 == 0 {
            store.rename_class(class, name(&format!("renamed {i}"))).unwrap();
        }
        if i == 4 {
            store.delete_class(class).unwrap();
        }
    }
    let kind = JobKind::Reindex {
        scope: ReindexScope::Stale,
        parameters: None,
    };
    let job = Job::new(kind, jiff::Timestamp::now());
    store.put_job(&job).unwrap();
    (catalogue(&store), job)
}

fn damaged_directories(path: &Path) -> usize {
    std::fs::read_dir(path)
        .unwrap()
        .flatten()
        .filter(|e| e.file_name().to_string_lossy().starts_with("sled.damaged-"))
        .count()
}

#[test]
fn a_changed_record_is_found_and_the_records_rebuilt() {
    let directory = TempDir::new().unwrap();
    let (before, job) = filled(directory.path());
    let db = sled::open(directory.path().join("sled")).unwrap();
    let (key, value) = db.scan_prefix(b"class/").next().unwrap().unwrap();
    let mut bad = value.to_vec();
    let last = bad.len() - 1;
    bad[last] ^= 1;
    db.insert(key, bad).unwrap();
    db.flush().unwrap();
    drop(db);

    let store = open(directory.path()).unwrap();
    assert_eq!(catalogue(&store), before);
    assert_eq!(store.unfinished_jobs().unwrap(), vec![job]);
    let told = store.recovery().join("\n");
    assert!(
        told.contains("checksum") && told.contains("sled.damaged-"),
        "{told}"
    );
    assert_eq!(damaged_directories(directory.path()), 1);
    store.create_class(name("after")).unwrap();
    let after = catalogue(&store);
    drop(store);
    let store = open(directory.path()).unwrap();
    assert_eq!(store.recovery(), &[] as &[String]);
    assert_eq!(catalogue(&store), after);
}

#[test]
fn records_that_do_not_open_are_rebuilt() {
    for (what, damage) in [
        ("zeros", vec![0_u8; 1 << 20]),
        (
            "noise",
            (0..1_u32 << 18)
                .flat_map(|i| i.wrapping_mul(2_654_435_761).to_le_bytes())
                .collect(),
        ),
    ] {
        let directory = TempDir::new().unwrap();
        let (before, _) = filled(directory.path());
        std::fs::write(directory.path().join("sled/db"), &damage).unwrap();
        std::fs::write(directory.path().join("sled/conf"), &damage[..64]).unwrap();
        let store = open(directory.path()).unwrap();
        assert_eq!(catalogue(&store), before, "{what}: {:?}", store.recovery());
        assert!(!store.recovery().is_empty(), "{what}");
    }
}

#[test]
fn lost_records_are_replayed_and_never_come_back_empty() {
    let directory = TempDir::new().unwrap();
    let (before, _) = filled(directory.path());
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    let store = open(directory.path()).unwrap();
    assert_eq!(catalogue(&store), before);
    assert!(
        store.recovery()[0].contains("catalogue log"),
        "{:?}",
        store.recovery()
    );
}

#[test]
fn a_lost_log_is_written_anew_and_serves_as_well() {
    let directory = TempDir::new().unwrap();
    let (before, _) = filled(directory.path());
    std::fs::remove_file(directory.path().join("catalogue.log")).unwrap();
    let store = open(directory.path()).unwrap();
    assert_eq!(catalogue(&store), before);
    assert!(!store.recovery().is_empty());
    drop(store);
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    let store = open(directory.path()).unwrap();
    assert_eq!(catalogue(&store), before);
}

#[test]
fn damage_in_the_middle_of_the_log_is_repaired_from_the_records() {
    let directory = TempDir::new().unwrap();
    let (before, _) = filled(directory.path());
    let log = directory.path().join("catalogue.log");
    let mut text = std::fs::read(&log).unwrap();
    let middle = text.len() / 2;
    text[middle] ^= 4;
    std::fs::write(&log, &text).unwrap();
    let store = open(directory.path()).unwrap();
    assert_eq!(catalogue(&store), before);
    assert!(
        store.recovery()[0].contains("could not be read"),
        "{:?}",
        store.recovery()
    );
    drop(store);
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    assert_eq!(catalogue(&open(directory.path()).unwrap()), before);
}

#[test]
fn a_line_cut_off_at_any_byte_is_forgotten() {
    let directory = TempDir::new().unwrap();
    let (before, _) = filled(directory.path());
    let log = directory.path().join("catalogue.log");
    let text = std::fs::read(&log).unwrap();
    let line: Vec<u8> = text
        .split_inclusive(|&b| b == b'\n')
        .next_back()
        .unwrap()
        .to_vec();
    for cut in [1, 7, 8, 9, 20, line.len() - 1] {
        let mut torn = text.clone();
        torn.extend_from_slice(&line[..cut]);
        std::fs::write(&log, &torn).unwrap();
        let store = open(directory.path()).unwrap();
        assert_eq!(catalogue(&store), before, "cut {cut}");
        assert_eq!(store.recovery(), &[] as &[String], "cut {cut}");
        drop(store);
        assert_eq!(std::fs::read(&log).unwrap(), text, "cut {cut}");
    }
}

#[test]
fn a_directory_without_records_and_log_is_not_started_empty() {
    let directory = TempDir::new().unwrap();
    filled(directory.path());
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    std::fs::remove_file(directory.path().join("catalogue.log")).unwrap();
    let Err(error) = open(directory.path()) else {
        panic!("started empty over stored files");
    };
    assert!(error.to_string().contains("catalogue.log"), "{error}");
}

#[test]
fn an_interrupted_rebuild_goes_on() {
    let directory = TempDir::new().unwrap();
    let (before, _) = filled(directory.path());
    let at = |name: &str| directory.path().join(name);
    // Killed while rebuilding: the half-made records are thrown away.
    std::fs::create_dir_all(at("sled.rebuilding")).unwrap();
    std::fs::write(at("sled.rebuilding/db"), b"half").unwrap();
    assert_eq!(catalogue(&open(directory.path()).unwrap()), before);
    assert!(!at("sled.rebuilding").exists());
    // Killed between the two renames.
    std::fs::rename(at("sled"), at("sled.rebuilt")).unwrap();
    assert_eq!(catalogue(&open(directory.path()).unwrap()), before);
    assert!(at("sled").exists() && !at("sled.rebuilt").exists());
}

#[test]
fn a_leftover_unfinished_snapshot_of_the_engine_does_no_harm() {
    let directory = TempDir::new().unwrap();
    let (before, _) = filled(directory.path());
    std::fs::write(
        directory.path().join("sled/snap.00000000000000FF.generating"),
        b"half",
    )
    .unwrap();
    let store = open(directory.path()).unwrap();
    assert_eq!(catalogue(&store), before);
    assert_eq!(store.recovery(), &[] as &[String]);
}

#[test]
fn a_changed_or_missing_file_is_found() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path()).unwrap();
    let class = store.create_class(name("cat")).unwrap().id;
    let content = store.add_shapes(class, vec![shape("mesh", None)]).unwrap()[0]
        .shape
        .content;
    std::fs::write(store.original_path(content), b"nesh").unwrap();
    assert!(matches!(
        store.original(content),
        Err(StoreError::Original { .. })
    ));
    // Sending the file again heals it.
    store.add_shapes(class, vec![shape("mesh", None)]).unwrap();
    assert_eq!(store.original(content).unwrap(), b"mesh");
    std::fs::remove_file(store.original_path(content)).unwrap();
    assert!(matches!(
        store.original(content),
        Err(StoreError::Original { .. })
    ));
}

/// Every file below a directory with its contents.
fn files(directory: &Path) -> std::collections::BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut found = std::collections::BTreeMap::new();
    for entry in std::fs::read_dir(directory).unwrap().flatten() {
        if entry.path().is_dir() {
            found.extend(files(&entry.path()));
        } else {
            found.insert(entry.path(), std::fs::read(entry.path()).unwrap());
        }
    }
    found
}

#[test]
fn a_directory_opened_read_only_shows_the_catalogue_and_writes_nothing() {
    let directory = TempDir::new().unwrap();
    let (before, job) = filled(directory.path());
    let on_disk = files(directory.path());
    let denied = || StoreError::Denied {
        what: "open the data directory".to_owned(),
        detail: "read-only".to_owned(),
    };
    // Held by another process, as a directory that is mounted twice: no lock is needed.
    let lock = std::fs::File::open(directory.path().join("lock")).unwrap();
    lock.lock().unwrap();
    let store = Store::open_read_only(directory.path(), denied()).unwrap();
    assert_eq!(catalogue(&store), before);
    assert!(store.recovery_mode().unwrap().contains("cannot be written"));
    let refused = |error: StoreError| matches!(error, StoreError::RecoveryMode { .. });
    assert!(refused(store.create_class(name("new")).unwrap_err()));
    assert!(refused(store.put_job(&job).unwrap_err()));
    assert!(refused(store.recover().unwrap_err()));
    // What the log does not hold is refused, never missing.
    assert!(refused(store.job(job.id).unwrap_err()));
    assert!(refused(store.list_jobs(None, 10).unwrap_err()));
    assert!(refused(store.generation().unwrap_err()));
    drop(store);
    assert!(files(directory.path()) == on_disk);
    std::fs::remove_file(directory.path().join("catalogue.log")).unwrap();
    let Err(error) = Store::open_read_only(directory.path(), denied()) else {
        panic!("shown without a log");
    };
    assert_eq!(error, denied());
}
