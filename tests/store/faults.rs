//! A backend that fails at every write in turn, checked against a model in plain maps.

use crate::{name, shape};
use proptest::prelude::*;
use shapelex::model::{ClassId, NewShape, ShapeId};
use shapelex::store::{Health, MemoryBackend, Store, StoreError};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// A change; numbers pick among what is there.
#[derive(Clone, Debug)]
enum Change {
    Create(u8),
    Fill(u8, Vec<(u8, Option<u8>)>),
    Rename(usize, u8),
    DeleteClass(usize),
    AddShapes(usize, Vec<(u8, Option<u8>)>),
    DeleteShape(usize, usize),
    Crash(usize),
}

type Shapes = BTreeMap<ShapeId, (String, Option<usize>)>;
/// What a store must hold.
type Model = BTreeMap<ClassId, (String, Shapes)>;
/// The same without identifiers, to compare what a failed change may have made.
type Outline = Vec<(String, Vec<(String, Option<usize>)>)>;

fn outline(model: &Model) -> Outline {
    let mut outline: Outline = model
        .values()
        .map(|(name, shapes)| {
            let mut shapes: Vec<_> = shapes.values().cloned().collect();
            shapes.sort();
            (name.clone(), shapes)
        })
        .collect();
    outline.sort();
    outline
}

/// Everything the store holds, checked for being consistent in itself.
fn read(store: &Store) -> Model {
    let mut model = Model::new();
    for class in store.list_classes(None, usize::MAX).unwrap() {
        assert_eq!(store.class_by_name(&class.name).unwrap().as_ref(), Some(&class));
        let mut shapes = Shapes::new();
        let mut bytes = 0;
        for shape in store.list_shapes(class.id, None, usize::MAX).unwrap() {
            assert_eq!(store.shape(shape.id).unwrap(), shape);
            let contents = String::from_utf8(store.original(shape.content).unwrap()).unwrap();
            bytes += shape.bytes;
            shapes.insert(shape.id, (contents, shape.pose.map(|p| p.index)));
        }
        assert_eq!((class.shapes, class.bytes), (shapes.len() as u64, bytes));
        model.insert(class.id, (class.name.as_str().to_owned(), shapes));
    }
    model
}

fn pick<K: Copy>(keys: impl ExactSizeIterator<Item = K>, n: usize) -> Option<K> {
    let mut keys = keys;
    let length = keys.len();
    if length == 0 { None } else { keys.nth(n % length) }
}

/// What a shape holds, as the model has it.
fn contents((n, pose): &(u8, Option<u8>)) -> (String, Option<usize>) {
    (format!("mesh {n}"), pose.map(usize::from))
}

fn new_shapes(list: &[(u8, Option<u8>)]) -> Vec<NewShape> {
    list.iter()
        .map(|entry| {
            let (text, pose) = contents(entry);
            shape(&text, pose)
        })
        .collect()
}

fn class_name(n: u8) -> String {
    format!("class {n}")
}

/// Does a change to the store; on success returns what the model is then.
fn change(store: &Store, model: &Model, change: &Change) -> Result<Model, StoreError> {
    let mut after = model.clone();
    match change {
        Change::Create(n) => {
            let class = store.create_class(name(&class_name(*n)))?;
            after.insert(class.id, (class_name(*n), Shapes::new()));
        }
        Change::Fill(n, list) => {
            let added = store.create_filled_class(name(&class_name(*n)), new_shapes(list))?;
            let class = added[0].shape.class;
            let shapes = list.iter().zip(added).map(|(entry, added)| {
                assert_eq!(added.shape.class, class);
                (added.shape.id, contents(entry))
            });
            after.insert(class, (class_name(*n), shapes.collect()));
        }
        Change::Rename(c, n) => {
            if let Some(id) = pick(model.keys().copied(), *c) {
                store.rename_class(id, name(&class_name(*n)))?;
                after.get_mut(&id).unwrap().0 = class_name(*n);
            }
        }
        Change::DeleteClass(c) => {
            if let Some(id) = pick(model.keys().copied(), *c) {
                store.delete_class(id)?;
                after.remove(&id);
            }
        }
        Change::AddShapes(c, list) => {
            if let Some(id) = pick(model.keys().copied(), *c) {
                let added = store.add_shapes(id, new_shapes(list))?;
                let shapes = &mut after.get_mut(&id).unwrap().1;
                for (entry, added) in list.iter().zip(added) {
                    let entry = contents(entry);
                    let known = shapes.values().any(|e| *e == entry);
                    assert_eq!(added.created, !known);
                    if known {
                        assert_eq!(shapes.get(&added.shape.id), Some(&entry));
                    }
                    shapes.insert(added.shape.id, entry);
                }
            }
        }
        Change::DeleteShape(c, s) => {
            if let Some(id) = pick(model.keys().copied(), *c)
                && let Some(shape) = pick(model[&id].1.keys().copied(), *s)
            {
                store.delete_shape(shape)?;
                after.get_mut(&id).unwrap().1.remove(&shape);
            }
        }
        Change::Crash(_) => {}
    }
    Ok(after)
}

/// What a change would lead to in a store of its own; `None` where it is refused.
fn expected(model: &Model, what: &Change) -> Option<Outline> {
    let mut outline = outline(model);
    let class_of = |c: &usize| pick(model.keys().copied(), *c).map(|id| model[&id].0.clone());
    let taken = |outline: &Outline, n: &u8| outline.iter().any(|(name, _)| *name == class_name(*n));
    match what {
        Change::Create(n) if taken(&outline, n) => return None,
        Change::Create(n) => outline.push((class_name(*n), Vec::new())),
        Change::Fill(n, _) if taken(&outline, n) => return None,
        Change::Fill(n, list) => {
            let mut shapes: Vec<_> = list.iter().map(contents).collect();
            shapes.sort();
            shapes.dedup();
            outline.push((class_name(*n), shapes));
        }
        Change::Rename(c, n) => {
            let Some(old) = class_of(c) else {
                return Some(outline);
            };
            if old != class_name(*n) && taken(&outline, n) {
                return None;
            }
            outline
                .iter_mut()
                .filter(|(name, _)| *name == old)
                .for_each(|e| e.0 = class_name(*n));
        }
        Change::DeleteClass(c) => {
            let old = class_of(c);
            outline.retain(|(name, _)| Some(name) != old.as_ref());
        }
        Change::AddShapes(c, list) => {
            let old = class_of(c);
            for (_, shapes) in outline.iter_mut().filter(|(name, _)| Some(name) == old.as_ref()) {
                for entry in list {
                    let entry = contents(entry);
                    if !shapes.contains(&entry) {
                        shapes.push(entry);
                    }
                }
                shapes.sort();
            }
        }
        Change::DeleteShape(c, s) => {
            if let Some(id) = pick(model.keys().copied(), *c)
                && let Some(shape) = pick(model[&id].1.keys().copied(), *s)
            {
                let mut model = model.clone();
                model.get_mut(&id).unwrap().1.remove(&shape);
                return Some(self::outline(&model));
            }
        }
        Change::Crash(_) => {}
    }
    outline.sort();
    Some(outline)
}

fn refused(error: &StoreError) -> bool {
    matches!(error, StoreError::NameTaken { .. })
}

/// Runs the changes with a write that fails, if any, and returns how many writes were made before it.
fn run(path: &Path, changes: &[Change], fail_at: Option<u64>) -> u64 {
    let mut backend = Arc::new(MemoryBackend::new());
    let mut store = Store::open_with(path, backend.clone()).unwrap();
    let mut model = Model::new();
    let mut writes = 0;
    if let Some(n) = fail_at {
        backend.fail_after(n);
    }
    for what in changes {
        if let Change::Crash(survivors) = what {
            writes += backend.writes();
            drop(store);
            backend = Arc::new(backend.after_crash(*survivors));
            store = Store::open_with(path, backend.clone()).unwrap();
            assert_eq!(read(&store), model, "after a crash");
            continue;
        }
        match change(&store, &model, what) {
            Ok(after) => {
                model = after;
                assert_eq!(read(&store), model, "after {what:?}");
            }
            Err(error) if refused(&error) => {
                assert_eq!(expected(&model, what), None, "{what:?} was refused: {error}");
                assert_eq!(read(&store), model);
            }
            Err(error) => {
                assert!(backend.has_failed(), "{what:?}: {error}");
                assert!(matches!(store.health(), Health::ReadOnly { .. }));
                let again = store.create_class(name("more"));
                assert!(matches!(again, Err(StoreError::ReadOnly { .. })), "{again:?}");
                for survivors in [0, 1, 9] {
                    // Every clone of the store must be gone before the directory opens again.
                    drop(std::mem::replace(&mut store, reopen_elsewhere()));
                    let crashed = Arc::new(backend.after_crash(survivors));
                    store = Store::open_with(path, crashed).unwrap();
                    let found = read(&store);
                    let outline = outline(&found);
                    assert!(
                        outline == self::outline(&model) || Some(&outline) == expected(&model, what).as_ref(),
                        "{what:?} failed and left {outline:?}, neither before nor after"
                    );
                    for (id, (_, shapes)) in &model {
                        if let Some((_, there)) = found.get(id) {
                            let gone = shapes.keys().filter(|s| !there.contains_key(s)).count();
                            assert!(gone <= 1, "acknowledged shapes are gone");
                        }
                    }
                }
                store.create_class(name("writable again")).unwrap();
                return writes;
            }
        }
    }
    writes + backend.writes()
}

/// A store to hold in place of one that is dropped.
fn reopen_elsewhere() -> Store {
    let directory = TempDir::new().unwrap();
    Store::open_with(directory.path(), Arc::new(MemoryBackend::new())).unwrap()
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let one = prop_oneof![
        4 => (0_u8..5).prop_map(Change::Create),
        2 => (0_u8..5, prop::collection::vec((0_u8..6, prop::option::of(0_u8..3)), 1..4))
            .prop_map(|(n, list)| Change::Fill(n, list)),
        2 => (0_usize..8, 0_u8..5).prop_map(|(c, n)| Change::Rename(c, n)),
        1 => (0_usize..8).prop_map(Change::DeleteClass),
        6 => (0_usize..8, prop::collection::vec((0_u8..6, prop::option::of(0_u8..3)), 1..4))
            .prop_map(|(c, list)| Change::AddShapes(c, list)),
        3 => (0_usize..8, 0_usize..8).prop_map(|(c, s)| Change::DeleteShape(c, s)),
        1 => (0_usize..3).prop_map(Change::Crash),
    ];
    prop::collection::vec(one, 1..20)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_store_is_its_model(changes in changes()) {
        let directory = TempDir::new().unwrap();
        run(directory.path(), &changes, None);
    }

    #[test]
    fn a_full_disk_loses_nothing(changes in changes(), fill_at in 0_u64..30, survivors in 0_usize..3) {
        let directory = TempDir::new().unwrap();
        run_full(directory.path(), &changes, fill_at, survivors);
    }

    #[test]
    fn a_failed_write_leaves_before_or_after(changes in changes(), fail_at in 0_u64..30) {
        let directory = TempDir::new().unwrap();
        run(directory.path(), &changes, Some(fail_at));
    }
}

/// Runs the changes on a disk that is full from the `fill_at`-th write on until somebody frees space. Whatever it
/// refuses is refused, the store takes writes again without being opened anew, and nothing acknowledged is gone.
fn run_full(path: &Path, changes: &[Change], fill_at: u64, survivors: usize) -> bool {
    let backend = Arc::new(MemoryBackend::new());
    let store = Store::open_with(path, backend.clone()).unwrap();
    let mut model = Model::new();
    let mut was_full = false;
    backend.fill_after(fill_at);
    for what in changes.iter().filter(|c| !matches!(c, Change::Crash(_))) {
        match change(&store, &model, what) {
            Ok(after) => model = after,
            Err(error) if refused(&error) => assert_eq!(expected(&model, what), None),
            Err(StoreError::Full { .. }) => {
                was_full = true;
                assert!(matches!(store.health(), Health::ReadOnly { .. }));
                let again = store.create_class(name("more"));
                assert!(matches!(again, Err(StoreError::Full { .. })), "{again:?}");
                backend.heal(survivors);
                store.recover().unwrap();
                assert_eq!(store.health(), Health::Ready);
                let found = read(&store);
                assert!(
                    outline(&found) == outline(&model)
                        || Some(&outline(&found)) == expected(&model, what).as_ref(),
                    "{what:?} found the disk full and left {found:?}"
                );
                for id in model.keys().filter(|_| !matches!(what, Change::DeleteClass(_))) {
                    assert!(found.contains_key(id), "an acknowledged class is gone");
                }
                model = found;
            }
            Err(error) => panic!("{what:?}: {error}"),
        }
        assert_eq!(read(&store), model, "after {what:?}");
    }
    drop(store);
    let crashed = Arc::new(backend.after_crash(0));
    assert_eq!(read(&Store::open_with(path, crashed).unwrap()), model);
    was_full
}

/// A life with every kind of change.
fn life() -> Vec<Change> {
    vec![
        Change::Create(0),
        Change::Create(1),
        Change::AddShapes(0, vec![(0, None), (1, Some(0)), (1, Some(1))]),
        Change::AddShapes(1, vec![(0, None), (2, None)]),
        Change::Rename(0, 2),
        Change::DeleteShape(0, 1),
        Change::AddShapes(0, vec![(3, None)]),
        Change::DeleteClass(1),
        Change::Fill(3, vec![(4, None), (5, Some(2))]),
        Change::Create(1),
    ]
}

#[test]
fn a_disk_is_full_once_at_every_write_of_a_life() {
    let mut full = 0;
    for survivors in [0, 1, 9] {
        for fill_at in 0.. {
            let directory = TempDir::new().unwrap();
            if !run_full(directory.path(), &life(), fill_at, survivors) {
                break;
            }
            full += 1;
        }
    }
    assert!(full >= 54, "{full} times");
}

#[test]
fn every_write_of_a_life_fails_once() {
    let life = life();
    let directory = TempDir::new().unwrap();
    let writes = run(directory.path(), &life, None);
    assert!(writes >= 18, "{writes} writes");
    for fail_at in 0..writes {
        let directory = TempDir::new().unwrap();
        run(directory.path(), &life, Some(fail_at));
    }
}

#[test]
fn a_rotten_record_is_refused_not_misread() {
    let directory = TempDir::new().unwrap();
    let backend = Arc::new(MemoryBackend::new());
    let store = Store::open_with(directory.path(), backend.clone()).unwrap();
    let class = store.create_class(name("cat")).unwrap().id;
    let key = backend
        .keys()
        .into_iter()
        .find(|k| k.starts_with(b"class/"))
        .unwrap();
    for at in 0..40 {
        backend.corrupt(&key, at);
        assert!(
            matches!(store.class(class), Err(StoreError::Damaged { .. })),
            "byte {at}"
        );
        backend.corrupt(&key, at);
    }
    assert!(store.class(class).is_ok());
}
