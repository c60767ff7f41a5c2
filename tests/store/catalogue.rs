//! Classes, shapes and files, on the real engine.

use crate::{name, shape};
use shapelex::model::{ClassId, ContentHash, Job, JobKind, JobState, ReindexScope, ShapeId};
use shapelex::store::{Store, StoreError, StoreOptions};
use shapelex_core::mesh::Companion;
use tempfile::TempDir;

fn open(directory: &TempDir) -> Store {
    Store::open(directory.path(), &StoreOptions::default()).unwrap()
}

#[test]
fn everything_is_there_after_reopening() {
    let directory = TempDir::new().unwrap();
    let store = open(&directory);
    let cat = store.create_class(name("cat")).unwrap();
    let added = store
        .add_shapes(
            cat.id,
            vec![shape("a", None), shape("b", Some(1)), shape("b", Some(2))],
        )
        .unwrap();
    assert!(added.iter().all(|a| a.created));
    let dog = store.create_class(name("dog")).unwrap();
    let dog = store.rename_class(dog.id, name("hound")).unwrap();
    let job = Job::new(
        JobKind::Reindex {
            scope: ReindexScope::All,
            parameters: None,
        },
        jiff::Timestamp::now(),
    );
    store.put_job(&job).unwrap();
    let (classes, shapes) = (
        store.list_classes(None, 10).unwrap(),
        store.list_shapes(cat.id, None, 10).unwrap(),
    );
    assert_eq!(shapes.len(), 3);
    drop(store);

    let store = open(&directory);
    assert_eq!(store.recovery(), &[] as &[String]);
    assert_eq!(store.list_classes(None, 10).unwrap(), classes);
    assert_eq!(store.list_shapes(cat.id, None, 10).unwrap(), shapes);
    assert_eq!(store.class_by_name(&name("hound")).unwrap(), Some(dog));
    assert_eq!(store.class_by_name(&name("dog")).unwrap(), None);
    assert_eq!(store.original(shapes[0].content).unwrap(), b"a");
    assert_eq!(store.unfinished_jobs().unwrap(), vec![job]);
    let class = store.class(cat.id).unwrap();
    assert_eq!((class.shapes, class.revision, class.bytes), (3, 1, 3));
}

#[test]
fn the_same_file_and_pose_is_the_same_shape() {
    let directory = TempDir::new().unwrap();
    let store = open(&directory);
    let cat = store.create_class(name("cat")).unwrap().id;
    let first = store
        .add_shapes(cat, vec![shape("a", None), shape("a", None)])
        .unwrap();
    assert_eq!((first[0].created, first[1].created), (true, false));
    assert_eq!(first[0].shape, first[1].shape);
    let again = store
        .add_shapes(cat, vec![shape("a", None), shape("a", Some(3))])
        .unwrap();
    assert_eq!((again[0].created, again[1].created), (false, true));
    assert_eq!(again[0].shape, first[0].shape);
    let revision = store.class(cat).unwrap().revision;
    store.add_shapes(cat, vec![shape("a", None)]).unwrap();
    assert_eq!(store.class(cat).unwrap().revision, revision, "nothing changed");
    let dog = store.create_class(name("dog")).unwrap().id;
    assert!(store.add_shapes(dog, vec![shape("a", None)]).unwrap()[0].created);
    // Another companion makes another shape of the same file.
    let mut with_buffer = shape("a", None);
    with_buffer.companions = vec![Companion::new("a.bin", b"buffer".to_vec())];
    let added = store.add_shapes(dog, vec![with_buffer]).unwrap();
    assert!(added[0].created);
    assert_eq!(added[0].shape.bytes, 7);
    assert_eq!(store.original(ContentHash::of(b"buffer")).unwrap(), b"buffer");
}

#[test]
fn only_files_nobody_refers_to_are_removed() {
    let directory = TempDir::new().unwrap();
    let store = open(&directory);
    let cat = store.create_class(name("cat")).unwrap().id;
    let dog = store.create_class(name("dog")).unwrap().id;
    store
        .add_shapes(
            cat,
            vec![shape("both", None), shape("cat", Some(0)), shape("cat", Some(1))],
        )
        .unwrap();
    store.add_shapes(dog, vec![shape("both", None)]).unwrap();
    let there = |text: &str| store.original_path(ContentHash::of(text.as_bytes())).exists();
    let poses = store.list_shapes(cat, None, 10).unwrap();
    store.delete_shape(poses[1].id).unwrap();
    assert!(there("cat"), "another pose needs it");
    assert!(store.shape(poses[1].id).is_err());
    store.delete_class(cat).unwrap();
    assert!(!there("cat"));
    assert!(there("both"), "the dog needs it");
    store.delete_class(dog).unwrap();
    assert!(!there("both"));
    assert_eq!(store.statistics().unwrap(), Default::default());
    assert_eq!(
        store.shape(poses[0].id),
        Err(StoreError::NoShape { id: poses[0].id })
    );
}

#[test]
fn what_is_not_there_or_not_free_is_said_so() {
    let directory = TempDir::new().unwrap();
    let store = open(&directory);
    let cat = store.create_class(name("cat")).unwrap().id;
    let dog = store.create_class(name("dog")).unwrap().id;
    let taken = StoreError::NameTaken {
        name: name("cat"),
        id: cat,
    };
    assert_eq!(store.create_class(name("cat")), Err(taken.clone()));
    assert_eq!(store.rename_class(dog, name("cat")), Err(taken));
    assert!(store.rename_class(cat, name("cat")).is_ok());
    assert!(store.create_class(name("Cat")).is_ok(), "case counts");
    let nobody = ClassId::new();
    let none = StoreError::NoClass { id: nobody };
    assert_eq!(store.class(nobody), Err(none.clone()));
    assert_eq!(store.delete_class(nobody), Err(none.clone()));
    assert_eq!(store.list_shapes(nobody, None, 1), Err(none.clone()));
    assert_eq!(store.add_shapes(nobody, vec![shape("a", None)]), Err(none));
    assert!(!store.original_path(ContentHash::of(b"a")).exists());
    assert!(store.delete_shape(ShapeId::new()).is_err());
}

#[test]
fn lists_come_in_pages() {
    let directory = TempDir::new().unwrap();
    let store = open(&directory);
    let ids: Vec<_> = (0..7)
        .map(|i| store.create_class(name(&i.to_string())).unwrap().id)
        .collect();
    let mut seen = Vec::new();
    let mut after = None;
    loop {
        let page = store.list_classes(after, 3).unwrap();
        let Some(last) = page.last() else { break };
        after = Some(last.id);
        seen.extend(page.iter().map(|c| c.id));
    }
    assert_eq!(seen, ids);

    let jobs: Vec<Job> = (0..5)
        .map(|i| {
            let kind = JobKind::Reindex {
                scope: ReindexScope::Classes(vec![ids[i]]),
                parameters: None,
            };
            let mut job = Job::new(kind, jiff::Timestamp::now());
            if i % 2 == 0 {
                job.state = JobState::Cancelled;
            }
            store.put_job(&job).unwrap();
            job
        })
        .collect();
    let newest = store.list_jobs(None, 2).unwrap();
    assert_eq!(newest, vec![jobs[4].clone(), jobs[3].clone()]);
    let rest = store.list_jobs(Some(newest[1].id), 10).unwrap();
    assert_eq!(
        rest.iter().map(|j| j.id).collect::<Vec<_>>(),
        [jobs[2].id, jobs[1].id, jobs[0].id]
    );
    assert_eq!(
        store.unfinished_jobs().unwrap(),
        vec![jobs[1].clone(), jobs[3].clone()]
    );
}

#[test]
fn a_second_user_of_the_directory_is_turned_away() {
    let directory = TempDir::new().unwrap();
    let store = open(&directory);
    let second = Store::open(directory.path(), &StoreOptions::default());
    assert!(matches!(second, Err(StoreError::Locked { .. })));
    drop(store);
    open(&directory);
}

#[test]
fn a_newer_format_is_refused_by_name() {
    let directory = TempDir::new().unwrap();
    drop(open(&directory));
    std::fs::write(directory.path().join("format"), "3\n").unwrap();
    let Err(error) = Store::open(directory.path(), &StoreOptions::default()) else {
        panic!("a newer format was opened");
    };
    assert_eq!(
        error.to_string(),
        "data directory has format 3, this shapelex reads up to 1; use a newer shapelex, or another data directory"
    );
    assert_eq!(
        std::fs::read_to_string(directory.path().join("format")).unwrap(),
        "3\n"
    );
}

#[test]
fn garbage_goes_and_nothing_else() {
    let directory = TempDir::new().unwrap();
    let store = open(&directory);
    let cat = store.create_class(name("cat")).unwrap().id;
    store.add_shapes(cat, vec![shape("a", None)]).unwrap();
    let orphan = store.original_path(ContentHash::of(b"orphan"));
    std::fs::create_dir_all(orphan.parent().unwrap()).unwrap();
    std::fs::write(&orphan, b"orphan").unwrap();
    let unfinished = orphan.with_file_name(".writing-x1");
    std::fs::write(&unfinished, b"half").unwrap();
    let garbage = store.collect_garbage().unwrap();
    assert_eq!((garbage.originals, garbage.dictionaries), (2, 0));
    assert!(!orphan.exists() && !unfinished.exists());
    assert_eq!(store.original(ContentHash::of(b"a")).unwrap(), b"a");
}
