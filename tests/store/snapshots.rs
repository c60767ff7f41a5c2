//! Snapshots: consistent while everything changes, checked before they take over, and taken over wholly or not at all.

use crate::{name, shape};
use shapelex::model::{Class, Shape, SnapshotOrigin};
use shapelex::store::{Store, StoreError, StoreOptions};
use std::fs::File;
use std::io::{Cursor, Read, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use tempfile::TempDir;

const LIMIT: u64 = 1 << 30;

fn open(path: &Path) -> Store {
    Store::open(path, &StoreOptions::default()).unwrap()
}

type Contents = Vec<(Class, Vec<(Shape, Vec<u8>)>)>;

fn contents(store: &Store) -> Contents {
    let classes = store.list_classes(None, usize::MAX).unwrap();
    classes
        .into_iter()
        .map(|class| {
            let shapes = store.list_shapes(class.id, None, usize::MAX).unwrap();
            let shapes = shapes
                .into_iter()
                .map(|shape| {
                    let bytes = store.original(shape.content).unwrap();
                    (shape, bytes)
                })
                .collect();
            (class, shapes)
        })
        .collect()
}

fn filled(path: &Path) -> Store {
    let store = open(path);
    for class in ["cat", "dog", "owl"] {
        let shapes = (0..4)
            .map(|i| shape(&format!("{class} {i} {}", "x".repeat(2000)), None))
            .collect();
        store.create_filled_class(name(class), shapes).unwrap();
    }
    store
}

/// The members of a snapshot's file.
fn members(path: &Path) -> Vec<(String, Vec<u8>)> {
    let mut archive = tar::Archive::new(zstd::Decoder::new(File::open(path).unwrap()).unwrap());
    archive
        .entries()
        .unwrap()
        .map(|entry| {
            let mut entry = entry.unwrap();
            let name = entry.path().unwrap().to_str().unwrap().to_owned();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).unwrap();
            (name, bytes)
        })
        .collect()
}

/// A snapshot's file of these members, whatever they are.
fn packed(members: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut archive = tar::Builder::new(zstd::Encoder::new(Vec::new(), 3).unwrap());
    for (name, bytes) in members {
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        // Set as raw bytes: the builder refuses paths that an attacker would not.
        header.as_ustar_mut().unwrap().name[..name.len()].copy_from_slice(name.as_bytes());
        header.set_cksum();
        archive.append(&header, &bytes[..]).unwrap();
    }
    archive.into_inner().unwrap().finish().unwrap()
}

/// The members with a changed manifest and the checksum it then needs.
fn with_manifest(
    members: &[(String, Vec<u8>)],
    change: impl FnOnce(&mut serde_json::Value),
) -> Vec<(String, Vec<u8>)> {
    let mut members = members.to_vec();
    let mut manifest = serde_json::from_slice(&members[0].1).unwrap();
    change(&mut manifest);
    members[0].1 = serde_json::to_vec(&manifest).unwrap();
    members[1].1 = blake3::hash(&members[0].1).to_hex().as_bytes().to_vec();
    members
}

#[test]
fn what_was_there_comes_back_on_the_same_and_on_another_directory() {
    let here = TempDir::new().unwrap();
    let store = filled(here.path());
    let before = contents(&store);
    let snapshot = store.create_snapshot(SnapshotOrigin::Requested).unwrap();
    assert_eq!(
        (snapshot.classes, snapshot.shapes, snapshot.originals),
        (3, 12, 12)
    );
    assert_eq!(
        snapshot.bytes,
        std::fs::metadata(store.snapshot_path(snapshot.id)).unwrap().len()
    );
    let file = std::fs::read(store.snapshot_path(snapshot.id)).unwrap();
    assert_eq!(
        snapshot.hash.to_string(),
        blake3::hash(&file).to_hex().to_string()
    );

    store.delete_class(before[0].0.id).unwrap();
    store.create_class(name("later")).unwrap();
    let restored = store
        .stage_own_snapshot(snapshot.id, LIMIT)
        .unwrap()
        .switch()
        .unwrap();
    assert_eq!((restored.classes, restored.shapes, restored.missing), (3, 12, 0));
    assert_eq!(contents(&store), before);
    // It takes writes, and what it holds survives another start, also without the records.
    store.create_class(name("after")).unwrap();
    let after = contents(&store);
    drop(store);
    std::fs::remove_dir_all(here.path().join("sled")).unwrap();
    assert_eq!(contents(&open(here.path())), after);
    for left in ["restore.unpacking", "restore.ready", "restore.replaced"] {
        assert!(!here.path().join(left).exists(), "{left}");
    }

    let elsewhere = TempDir::new().unwrap();
    let store = open(elsewhere.path());
    store.stage_snapshot(&file[..], LIMIT).unwrap().switch().unwrap();
    assert_eq!(contents(&store), before);
    drop(store);
    assert_eq!(contents(&open(elsewhere.path())), before);
}

#[test]
fn a_snapshot_taken_amid_changes_is_of_one_moment() {
    let here = TempDir::new().unwrap();
    let store = open(here.path());
    let class = store.create_class(name("pairs")).unwrap().id;
    let ended = AtomicBool::new(false);
    let mut snapshots = Vec::new();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut i = 0;
            // Two shapes come and go together, so a moment has an even number of each class's shapes.
            while !ended.load(Ordering::Relaxed) {
                let pair = vec![
                    shape(&format!("left {i}"), None),
                    shape(&format!("right {i}"), None),
                ];
                store.add_shapes(class, pair).unwrap();
                let other = vec![shape(&format!("l {i}"), None), shape(&format!("r {i}"), None)];
                let made = store
                    .create_filled_class(name(&format!("class {i}")), other)
                    .unwrap();
                if i % 2 == 0 {
                    store.delete_class(made[0].shape.class).unwrap();
                }
                i += 1;
            }
        });
        for _ in 0..5 {
            std::thread::sleep(std::time::Duration::from_millis(30));
            snapshots.push(store.create_snapshot(SnapshotOrigin::Requested).unwrap());
        }
        ended.store(true, Ordering::Relaxed);
    });
    for snapshot in snapshots {
        assert_eq!(snapshot.missing, 0, "a file went while the snapshot was made");
        let there = TempDir::new().unwrap();
        let other = open(there.path());
        let file = File::open(store.snapshot_path(snapshot.id)).unwrap();
        other.stage_snapshot(file, LIMIT).unwrap().switch().unwrap();
        for (class, shapes) in contents(&other) {
            assert_eq!(shapes.len() % 2, 0, "{class:?}");
        }
    }
    // What was deleted while a snapshot needed it is gone now.
    let count = |path: &Path| walk(&path.join("originals")).len() as u64;
    assert_eq!(count(here.path()), store.statistics().unwrap().shapes);
}

fn walk(root: &Path) -> Vec<std::path::PathBuf> {
    let folders = std::fs::read_dir(root).unwrap().flatten();
    folders
        .flat_map(|f| std::fs::read_dir(f.path()).unwrap().flatten())
        .map(|f| f.path())
        .collect()
}

#[test]
fn whatever_is_wrong_with_a_snapshot_changes_nothing() {
    let here = TempDir::new().unwrap();
    let store = filled(here.path());
    let before = contents(&store);
    let snapshot = store.create_snapshot(SnapshotOrigin::Requested).unwrap();
    let path = store.snapshot_path(snapshot.id);
    let good = std::fs::read(&path).unwrap();
    let parts = members(&path);
    assert_eq!(parts.len(), 15);

    let mut bad: Vec<(&str, Vec<u8>)> = vec![
        ("nothing", Vec::new()),
        ("no archive", b"hello".to_vec()),
        ("an empty archive", packed(&[])),
        ("a missing file", packed(&parts[..parts.len() - 1])),
        ("no checksum", packed(&[&parts[..1], &parts[2..]].concat())),
        (
            "a file too many",
            packed(&[&parts[..], &[("originals/more".to_owned(), vec![1])]].concat()),
        ),
    ];
    let mut changed = parts.clone();
    changed[0].1.push(b' ');
    bad.push(("a manifest without its checksum", packed(&changed)));
    let mut changed = parts.clone();
    changed[5].1[0] ^= 1;
    bad.push(("a changed file", packed(&changed)));
    let mut changed = parts.clone();
    let middle = changed[2].1.len() / 2;
    changed[2].1[middle] ^= 1;
    bad.push(("changed records", packed(&changed)));
    let hash = blake3::hash(&changed[2].1).to_hex().to_string();
    let honest = with_manifest(&changed, |m| m["records"]["hash"] = hash.into());
    bad.push(("records that fail their own checksums", packed(&honest)));
    let mut changed = parts.clone();
    changed[5].0 = "../../escaped".to_owned();
    bad.push(("a path that leaves", packed(&changed)));
    for (what, change) in [
        ("newer", serde_json::json!({"arrangement": 9})),
        ("unknown", serde_json::json!({"surprise": 1})),
        ("miscounted", serde_json::json!({"shapes": 11})),
        (
            "huge",
            serde_json::json!({"records": {"hash": "0".repeat(64), "bytes": u64::MAX}}),
        ),
    ] {
        let other = with_manifest(&parts, |m| {
            for (key, value) in change.as_object().unwrap() {
                m[key] = value.clone();
            }
        });
        bad.push((what, packed(&other)));
    }
    for cut in (0..good.len()).step_by(good.len() / 40 + 1) {
        bad.push(("cut short", good[..cut].to_vec()));
    }
    for at in (0..good.len()).step_by(good.len() / 60 + 1) {
        let mut flipped = good.clone();
        flipped[at] ^= 0x10;
        bad.push(("a flipped bit", flipped));
    }
    let unpacked = zstd::decode_all(&good[..]).unwrap();
    for (what, file) in bad {
        // A few bits of a compressed stream mean nothing: what unpacks to the same bytes is the same snapshot.
        if what == "a flipped bit" && zstd::decode_all(&file[..]).is_ok_and(|tar| tar == unpacked) {
            continue;
        }
        let refused = store.stage_snapshot(Cursor::new(file), LIMIT);
        let Err(error) = refused else {
            panic!("{what}: accepted")
        };
        assert!(
            matches!(error, StoreError::BadSnapshot { .. }),
            "{what}: {error:?}"
        );
        assert!(!here.path().join("restore.unpacking").exists(), "{what}");
    }
    assert_eq!(contents(&store), before);
    store.create_class(name("still writable")).unwrap();
    // And the good one is good.
    store.stage_snapshot(&good[..], LIMIT).unwrap().switch().unwrap();
    assert_eq!(contents(&store), before);
}

#[test]
fn a_bomb_is_refused_before_it_goes_off() {
    let here = TempDir::new().unwrap();
    let store = filled(here.path());
    let snapshot = store.create_snapshot(SnapshotOrigin::Requested).unwrap();
    let refused = store
        .stage_own_snapshot(snapshot.id, snapshot.unpacked_bytes - 1)
        .err();
    assert!(
        refused.as_ref().is_some_and(|e| e.to_string().contains("limit")),
        "{refused:?}"
    );
    store
        .stage_own_snapshot(snapshot.id, snapshot.unpacked_bytes)
        .unwrap();
    // A gigabyte of zeros where the manifest belongs: some kilobytes on the wire.
    let mut encoder = zstd::Encoder::new(Vec::new(), 19).unwrap();
    let mut header = tar::Header::new_ustar();
    header.set_path("manifest.json").unwrap();
    header.set_size(1 << 30);
    header.set_cksum();
    encoder.write_all(header.as_bytes()).unwrap();
    for _ in 0..64 {
        encoder.write_all(&vec![0; 1 << 20]).unwrap();
    }
    let bomb = encoder.finish().unwrap();
    let refused = store.stage_snapshot(&bomb[..], LIMIT).err();
    assert!(
        matches!(refused, Some(StoreError::BadSnapshot { .. })),
        "{refused:?}"
    );
    // A name without an end, which tar readers collect in memory: refused for its own name, and not read.
    for kind in [tar::EntryType::GNULongName, tar::EntryType::XHeader] {
        let mut encoder = zstd::Encoder::new(Vec::new(), 3).unwrap();
        let mut header = tar::Header::new_ustar();
        header.set_path("long").unwrap();
        header.set_size(1 << 33);
        header.set_entry_type(kind);
        header.set_cksum();
        encoder.write_all(header.as_bytes()).unwrap();
        for _ in 0..64 {
            encoder.write_all(&vec![b'a'; 1 << 20]).unwrap();
        }
        let refused = store.stage_snapshot(&encoder.finish().unwrap()[..], LIMIT).err();
        assert!(
            matches!(&refused, Some(StoreError::BadSnapshot { detail }) if detail.contains("it holds 'long'")),
            "{refused:?}"
        );
    }
}

#[test]
fn a_switch_killed_anywhere_is_the_old_or_the_new() {
    // Before it is declared: the old state. After: the new one, from wherever the renames stopped.
    let source = TempDir::new().unwrap();
    let store = filled(source.path());
    let new = contents(&store);
    drop(store);
    for stopped_after in 0..=6 {
        let here = TempDir::new().unwrap();
        let store = open(here.path());
        store
            .create_filled_class(name("old"), vec![shape("old mesh", None)])
            .unwrap();
        let old = contents(&store);
        drop(store);
        let at = |path: &str| here.path().join(path);
        copy(source.path(), &at("restore.unpacking"));
        let mut steps: Vec<(String, String)> = vec![("restore.unpacking".into(), "restore.ready".into())];
        for part in ["sled", "catalogue.log", "originals"] {
            steps.push((part.into(), format!("restore.replaced/{part}")));
            steps.push((format!("restore.ready/{part}"), part.into()));
        }
        std::fs::create_dir(at("restore.replaced")).unwrap();
        for (from, to) in &steps[..stopped_after] {
            std::fs::rename(at(from), at(to)).unwrap();
        }
        let store = open(here.path());
        let wanted = if stopped_after == 0 { &old } else { &new };
        assert_eq!(&contents(&store), wanted, "stopped after {stopped_after} renames");
        store.create_class(name("writable")).unwrap();
        for left in ["restore.unpacking", "restore.ready", "restore.replaced"] {
            assert!(!at(left).exists(), "{left} after {stopped_after} renames");
        }
    }
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let place = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &place);
        } else {
            std::fs::copy(entry.path(), place).unwrap();
        }
    }
}

#[test]
fn snapshots_are_listed_pruned_and_deleted() {
    let here = TempDir::new().unwrap();
    let store = filled(here.path());
    let kept = store.create_snapshot(SnapshotOrigin::Requested).unwrap();
    let scheduled: Vec<_> = (0..4)
        .map(|_| store.create_snapshot(SnapshotOrigin::Scheduled).unwrap())
        .collect();
    assert_eq!(store.prune_snapshots(2).unwrap(), 2);
    let ids = |store: &Store| -> Vec<_> {
        let listed = store.list_snapshots(None, usize::MAX).unwrap();
        listed.into_iter().map(|s| s.id).collect()
    };
    assert_eq!(ids(&store), vec![kept.id, scheduled[2].id, scheduled[3].id]);
    assert_eq!(store.list_snapshots(Some(kept.id), 1).unwrap()[0], scheduled[2]);
    store.delete_snapshot(kept.id).unwrap();
    assert!(matches!(
        store.delete_snapshot(kept.id),
        Err(StoreError::NoSnapshot { .. })
    ));
    assert!(!store.snapshot_path(kept.id).exists());
    // What an interrupted snapshot or deletion leaves goes at the next start.
    std::fs::remove_file(here.path().join(format!("snapshots/{}.json", scheduled[2].id))).unwrap();
    std::fs::write(here.path().join("snapshots/.writing-abc"), b"half").unwrap();
    drop(store);
    let store = open(here.path());
    assert_eq!(ids(&store), vec![scheduled[3].id]);
    assert_eq!(
        std::fs::read_dir(here.path().join("snapshots")).unwrap().count(),
        2
    );
}

#[test]
fn a_file_that_is_gone_is_told_and_keeps_no_snapshot_from_being_made() {
    let here = TempDir::new().unwrap();
    let store = filled(here.path());
    let class = store.list_classes(None, 1).unwrap()[0].id;
    let shapes = store.list_shapes(class, None, 2).unwrap();
    std::fs::remove_file(store.original_path(shapes[0].content)).unwrap();
    std::fs::write(store.original_path(shapes[1].content), b"rotten").unwrap();
    let snapshot = store.create_snapshot(SnapshotOrigin::Requested).unwrap();
    assert_eq!((snapshot.missing, snapshot.originals), (2, 10));
    let restored = store
        .stage_own_snapshot(snapshot.id, LIMIT)
        .unwrap()
        .switch()
        .unwrap();
    assert_eq!((restored.missing, restored.shapes), (2, 12));
}
