//! Small files as a power cut may leave them: empty, cut or of zeros. None keeps the store from starting, and nothing
//! that was acknowledged is lost.

use crate::{name, shape};
use shapelex::model::{Class, Shape, SnapshotOrigin};
use shapelex::store::{OriginalDamage, Store, StoreError, StoreOptions};
use std::path::Path;
use tempfile::TempDir;

fn open(path: &Path) -> Result<Store, StoreError> {
    Store::open(path, &StoreOptions::default())
}

fn filled(path: &Path) -> Vec<(Class, Vec<Shape>)> {
    let store = open(path).unwrap();
    for i in 0..3 {
        let class = store.create_class(name(&format!("class {i}"))).unwrap().id;
        store
            .add_shapes(class, vec![shape(&format!("{i}"), None)])
            .unwrap();
    }
    store.create_snapshot(SnapshotOrigin::Requested).unwrap();
    catalogue(&store)
}

fn catalogue(store: &Store) -> Vec<(Class, Vec<Shape>)> {
    let classes = store.list_classes(None, 1000).unwrap();
    classes
        .into_iter()
        .map(|class| {
            let shapes = store.list_shapes(class.id, None, 1000).unwrap();
            (class, shapes)
        })
        .collect()
}

/// Contents a power cut may leave in the place of a file's.
fn leftovers(whole: &[u8]) -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("empty", Vec::new()),
        ("half", whole[..whole.len() / 2].to_vec()),
        ("zeros", vec![0; whole.len()]),
        ("noise", whole.iter().map(|byte| byte ^ 0x9c).collect()),
    ]
}

#[test]
fn small_files_that_were_cut_do_not_keep_the_store_from_starting() {
    for file in ["format", "lock", "reserve", "catalogue.log", "scrub.json"] {
        let directory = TempDir::new().unwrap();
        let before = filled(directory.path());
        let path = directory.path().join(file);
        let store = open(directory.path()).unwrap();
        store.scrub(&mut |_| std::ops::ControlFlow::Continue(())).unwrap();
        drop(store);
        let whole = std::fs::read(&path).unwrap();
        for (what, contents) in leftovers(&whole) {
            std::fs::write(&path, contents).unwrap();
            let store = open(directory.path()).unwrap_or_else(|error| panic!("{file} {what}: {error}"));
            assert_eq!(catalogue(&store), before, "{file} {what}");
            assert_eq!(store.health(), shapelex::store::Health::Ready, "{file} {what}");
            drop(store);
            if file == "format" {
                let text = std::fs::read_to_string(&path).unwrap();
                assert_eq!(text.trim(), "1", "{file} {what} is written anew");
            }
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(catalogue(&open(directory.path()).unwrap()), before, "{file} gone");
    }
}

#[test]
fn a_format_that_was_lost_does_not_hide_a_newer_one() {
    let directory = TempDir::new().unwrap();
    filled(directory.path());
    std::fs::write(directory.path().join("format"), "7\n").unwrap();
    assert!(matches!(
        open(directory.path()),
        Err(StoreError::NewerFormat { found: 7, .. })
    ));
}

#[test]
fn files_of_no_length_are_damage_and_healed_by_an_upload() {
    let directory = TempDir::new().unwrap();
    let before = filled(directory.path());
    let store = open(directory.path()).unwrap();
    for (i, (class, shapes)) in before.iter().enumerate() {
        let content = shapes[0].content;
        std::fs::write(store.original_path(content), b"").unwrap();
        let damaged = StoreError::Original {
            content,
            damage: OriginalDamage::Changed,
        };
        assert_eq!(store.original(content).unwrap_err(), damaged);
        assert_eq!(store.open_original(content).unwrap_err(), damaged);
        assert_eq!(store.damage().originals.len(), 1);
        let added = store
            .add_shapes(class.id, vec![shape(&format!("{i}"), None)])
            .unwrap();
        assert!(!added[0].created);
        assert_eq!(store.original(content).unwrap(), format!("{i}").into_bytes());
        assert!(store.damage().is_empty());
    }
    assert_eq!(catalogue(&store), before);
}

#[test]
fn a_description_of_a_snapshot_that_was_cut_is_written_anew() {
    let directory = TempDir::new().unwrap();
    filled(directory.path());
    let store = open(directory.path()).unwrap();
    let snapshots = store.list_snapshots(None, 10).unwrap();
    let id = snapshots[0].id;
    let note = directory.path().join(format!("snapshots/{id}.json"));
    let whole = std::fs::read(&note).unwrap();
    let second = store.create_snapshot(SnapshotOrigin::Requested).unwrap();
    for (what, contents) in leftovers(&whole) {
        std::fs::write(&note, contents).unwrap();
        // One damaged description does not hide the other snapshots.
        assert_eq!(
            store.list_snapshots(None, 10).unwrap(),
            vec![second.clone()],
            "{what}"
        );
    }
    drop(store);
    let store = open(directory.path()).unwrap();
    assert_eq!(store.snapshot(id).unwrap(), snapshots[0]);
    drop(store);
    // A half-written file without a description goes.
    std::fs::remove_file(&note).unwrap();
    let file = directory.path().join(format!("snapshots/{id}.tar.zst"));
    std::fs::write(&file, b"half").unwrap();
    let store = open(directory.path()).unwrap();
    assert!(!file.exists());
    assert_eq!(store.list_snapshots(None, 10).unwrap(), vec![second]);
}

#[test]
fn a_first_start_that_was_cut_off_anywhere_starts_again() {
    // What a first start makes, in the order it makes it.
    let steps: [&[(&str, &[u8])]; 4] = [
        &[("lock", b"")],
        &[("lock", b""), ("format", b"1\n")],
        &[("lock", b""), ("format", b"1\n"), ("catalogue.log", b"")],
        &[
            ("lock", b""),
            ("format", b"1\n"),
            ("catalogue.log", b""),
            ("sled/conf", b"half"),
            ("sled/db", b""),
        ],
    ];
    for files in steps {
        let directory = TempDir::new().unwrap();
        for (file, contents) in files {
            let path = directory.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, contents).unwrap();
        }
        let store = open(directory.path()).unwrap_or_else(|error| panic!("{files:?}: {error}"));
        store.create_class(name("first")).unwrap();
    }
}

#[test]
fn files_whose_catalogue_is_gone_are_not_taken_for_a_new_directory() {
    let directory = TempDir::new().unwrap();
    filled(directory.path());
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    std::fs::write(directory.path().join("catalogue.log"), b"").unwrap();
    std::fs::write(directory.path().join("format"), b"").unwrap();
    for _ in 0..2 {
        let Err(error) = open(directory.path()) else {
            panic!("started empty over stored files");
        };
        assert!(error.to_string().contains("catalogue.log"), "{error}");
    }
}
