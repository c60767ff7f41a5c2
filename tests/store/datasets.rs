//! Many classes at once: all of them or none, also after the records were lost.

use crate::{name, shape};
use shapelex::model::{ClassName, KeyId, KeyLimits};
use shapelex::store::{ClassShapes, FilledClass, Maker, Store, StoreError, StoreOptions};

fn open(path: &std::path::Path) -> Store {
    Store::open(path, &StoreOptions::default()).unwrap()
}

fn dataset(classes: &[(&str, &[&str])]) -> Vec<ClassShapes> {
    let class = |(class, contents): &(&str, &[&str])| ClassShapes {
        name: name(class),
        shapes: contents.iter().map(|one| shape(one, None)).collect(),
    };
    classes.iter().map(class).collect()
}

fn told(filled: &[FilledClass]) -> Vec<(String, bool, Vec<bool>)> {
    let one = |class: &FilledClass| {
        let created = class.shapes.iter().map(|shape| shape.created).collect();
        (class.class.name.to_string(), class.created, created)
    };
    filled.iter().map(one).collect()
}

#[test]
fn classes_are_made_and_filled_and_come_back_from_the_log() {
    let directory = tempfile::tempdir().unwrap();
    let before = {
        let store = open(directory.path());
        store
            .create_filled_class(name("cat"), vec![shape("1", None)])
            .unwrap();
        let filled = store
            .fill_classes_by(None, dataset(&[("cat", &["1", "2", "2"]), ("dog", &["1"])]))
            .unwrap();
        assert_eq!(
            told(&filled),
            [
                ("cat".to_owned(), false, vec![false, true, false]),
                ("dog".to_owned(), true, vec![true])
            ]
        );
        let again = store
            .fill_classes_by(None, dataset(&[("cat", &["2"]), ("dog", &["1"])]))
            .unwrap();
        assert!(
            again
                .iter()
                .all(|class| !class.created && !class.shapes[0].created)
        );
        store.list_classes(None, 9).unwrap()
    };
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    let store = open(directory.path());
    assert_eq!(store.list_classes(None, 9).unwrap(), before);
    let shapes = |class: &ClassName| {
        let id = store.class_by_name(class).unwrap().unwrap().id;
        let found = store.list_shapes(id, None, 9).unwrap();
        assert!(found.iter().all(|shape| shape.class == id));
        assert!(found.iter().all(|shape| store.original(shape.content).is_ok()));
        found.len()
    };
    assert_eq!((shapes(&name("cat")), shapes(&name("dog"))), (2, 1));
}

#[test]
fn a_refused_dataset_leaves_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let store = open(directory.path());
    let maker = |classes, stored_bytes| Maker {
        key: KeyId::new(),
        limits: KeyLimits {
            queries_per_minute: None,
            classes,
            stored_bytes,
        },
    };
    let three = dataset(&[("a", &["12"]), ("b", &["34"]), ("c", &["56"])]);
    for maker in [maker(Some(2), None), maker(None, Some(5))] {
        let refused = store.fill_classes_by(Some(&maker), three.clone());
        assert!(
            matches!(refused, Err(StoreError::QuotaExceeded { .. })),
            "{refused:?}"
        );
    }
    let twice = store.fill_classes_by(None, dataset(&[("a", &["12"]), ("a", &["34"])]));
    assert!(matches!(twice, Err(StoreError::NameTaken { .. })), "{twice:?}");
    assert_eq!(store.statistics().unwrap().classes, 0);
    let exact = maker(Some(3), Some(6));
    store.fill_classes_by(Some(&exact), three).unwrap();
    let usage = store.usage(exact.key).unwrap();
    assert_eq!((usage.classes, usage.shapes, usage.bytes), (3, 3, 6));
}
