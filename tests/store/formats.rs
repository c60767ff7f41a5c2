//! Directories of earlier formats open, newer ones are refused, and a start killed at any write is taken up again.

use crate::{name, shape};
use shapelex::model::JobState;
use shapelex::store::{FORMAT, MemoryBackend, Store, StoreError, StoreOptions};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// The data directories kept from every format there was, each with two classes of two shapes, learnt once.
fn fixtures() -> Vec<(u32, PathBuf)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/store/fixtures");
    let mut found: Vec<(u32, PathBuf)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter_map(|path| {
            let name = path.file_name()?.to_str()?;
            let format = name.strip_prefix("format-")?.strip_suffix(".tar.gz")?;
            Some((format.parse().unwrap(), path.clone()))
        })
        .collect();
    found.sort();
    found
}

fn unpack(fixture: &Path) -> TempDir {
    let directory = TempDir::new().unwrap();
    let file = flate2::read::GzDecoder::new(File::open(fixture).unwrap());
    tar::Archive::new(file).unpack(directory.path()).unwrap();
    directory
}

fn check(store: &Store, format: u32) {
    let classes = store.list_classes(None, 10).unwrap();
    let names: Vec<&str> = classes.iter().map(|class| class.name.as_str()).collect();
    assert_eq!(names, ["woman", "man"], "format {format}");
    for class in &classes {
        let shapes = store.list_shapes(class.id, None, 10).unwrap();
        assert_eq!(shapes.len(), 2);
        for shape in shapes {
            let bytes = store.original(shape.content).unwrap();
            assert_eq!(bytes.len() as u64, shape.bytes);
            assert!(
                shape
                    .name
                    .is_some_and(|name| name.starts_with(class.name.as_str()))
            );
        }
    }
}

#[test]
fn every_format_there_was_opens_with_all_it_holds() {
    let fixtures = fixtures();
    let formats: Vec<u32> = fixtures.iter().map(|(format, _)| *format).collect();
    assert_eq!(formats, (1..=FORMAT).collect::<Vec<_>>(), "a fixture per format");
    for (format, fixture) in fixtures {
        let directory = unpack(&fixture);
        let store = Store::open(directory.path(), &StoreOptions::default()).unwrap();
        assert_eq!(store.recovery(), &[] as &[String], "format {format}");
        check(&store, format);
        let generation = store.generation().unwrap().unwrap();
        assert_eq!(generation.number, 1);
        let index = store.load_index(&generation).unwrap();
        assert_eq!(index.classes.len(), 2);
        assert!(
            index
                .classes
                .iter()
                .all(|class| class.dictionaries.values().all(|d| d.len() == 8))
        );
        let jobs = store.list_jobs(None, 10).unwrap();
        assert_eq!(jobs.len(), 1);
        assert_eq!(jobs[0].state, JobState::Succeeded);
        store.create_class(name("new")).unwrap();
        drop(store);
        let text = std::fs::read_to_string(directory.path().join("format")).unwrap();
        assert_eq!(text.trim(), FORMAT.to_string());
    }
}

#[test]
fn the_catalogue_logs_of_every_format_give_the_records_back() {
    for (format, fixture) in fixtures() {
        let directory = unpack(&fixture);
        std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
        let store = Store::open(directory.path(), &StoreOptions::default()).unwrap();
        check(&store, format);
        assert!(!store.recovery().is_empty());
    }
}

#[test]
fn a_migration_killed_at_any_write_is_taken_up_again() {
    let mut killed = 0;
    for survivors in [0, 1, 9] {
        for at in 0.. {
            let directory = TempDir::new().unwrap();
            let backend = Arc::new(MemoryBackend::new());
            backend.fail_after(at);
            if Store::open_with(directory.path(), backend.clone()).is_ok() {
                break;
            }
            killed += 1;
            let crashed = Arc::new(backend.after_crash(survivors));
            let store = Store::open_with(directory.path(), crashed.clone()).unwrap();
            let class = store.create_class(name("first")).unwrap();
            store.add_shapes(class.id, vec![shape("mesh", None)]).unwrap();
            drop(store);
            let store = Store::open_with(directory.path(), Arc::new(crashed.after_crash(0))).unwrap();
            assert_eq!(store.statistics().unwrap().shapes, 1, "killed at write {at}");
        }
    }
    // Applying and flushing the migration, applying and flushing its number.
    assert!(killed >= 3 * 4, "{killed}");
}

#[test]
fn a_newer_format_is_refused_and_left_alone() {
    let (_, fixture) = fixtures().pop().unwrap();
    let directory = unpack(&fixture);
    let newer = (FORMAT + 1).to_string();
    std::fs::write(directory.path().join("format"), &newer).unwrap();
    let refused = Store::open(directory.path(), &StoreOptions::default()).err();
    assert!(
        matches!(refused, Some(StoreError::NewerFormat { .. })),
        "{refused:?}"
    );
    let text = std::fs::read_to_string(directory.path().join("format")).unwrap();
    assert_eq!(text, newer);
}
