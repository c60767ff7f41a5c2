//! Quotas of API keys: held by the store in the change's own transaction, and counted whatever happens afterwards.

use crate::{name, shape};
use shapelex::model::{KeyId, KeyLimits};
use shapelex::store::{Maker, Quota, Store, StoreError, StoreOptions, Usage};

fn maker(classes: Option<u64>, stored_bytes: Option<u64>) -> Maker {
    Maker {
        key: KeyId::new(),
        limits: KeyLimits {
            queries_per_minute: None,
            stored_bytes,
            classes,
        },
    }
}

#[test]
fn a_quota_holds_for_threads_with_handles_of_their_own() {
    let directory = tempfile::tempdir().unwrap();
    let store = Store::open(directory.path(), &StoreOptions::default()).unwrap();
    let maker = maker(Some(3), None);
    let made: usize = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..24)
            .map(|i| {
                let (store, maker) = (store.clone(), &maker);
                scope.spawn(move || {
                    let name = name(&format!("class {i}"));
                    match i % 2 {
                        0 => store.create_class_by(Some(maker), name).map(drop),
                        _ => store
                            .create_filled_class_by(
                                Some(maker),
                                name,
                                vec![shape(&format!("mesh {i}"), None)],
                            )
                            .map(drop),
                    }
                    .is_ok()
                })
            })
            .collect();
        threads
            .into_iter()
            .map(|thread| usize::from(thread.join().unwrap()))
            .sum()
    });
    assert_eq!((made, store.usage(maker.key).unwrap().classes), (3, 3));
    assert_eq!(store.statistics().unwrap().classes, 3);
    let refused = store.create_class_by(Some(&maker), name("more")).unwrap_err();
    let expected = StoreError::QuotaExceeded {
        quota: Quota::Classes,
        limit: 3,
        used: 3,
        more: 1,
    };
    assert_eq!(refused, expected);
}

#[test]
fn shapes_a_class_has_already_cost_nothing_and_refused_ones_leave_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let store = Store::open(directory.path(), &StoreOptions::default()).unwrap();
    let class = store.create_class(name("a")).unwrap().id;
    let maker = maker(None, Some(7));
    store
        .add_shapes_by(Some(&maker), class, vec![shape("12345", None)])
        .unwrap();
    let again = store
        .add_shapes_by(Some(&maker), class, vec![shape("12345", None)])
        .unwrap();
    assert!(!again[0].created);
    let refused = store.add_shapes_by(Some(&maker), class, vec![shape("678", None)]);
    assert!(
        matches!(refused, Err(StoreError::QuotaExceeded { used: 5, more: 3, .. })),
        "{refused:?}"
    );
    assert_eq!(store.class(class).unwrap().shapes, 1);
    assert!(
        store
            .add_shapes_by(Some(&maker), class, vec![shape("67", None)])
            .is_ok()
    );
}

#[test]
fn what_was_made_counts_after_the_records_were_lost_and_until_it_is_deleted() {
    let directory = tempfile::tempdir().unwrap();
    let open = || Store::open(directory.path(), &StoreOptions::default()).unwrap();
    let maker = maker(Some(9), Some(99));
    {
        let store = open();
        let class = store.create_class_by(Some(&maker), name("a")).unwrap().id;
        store
            .add_shapes_by(Some(&maker), class, vec![shape("123", None)])
            .unwrap();
        store
            .create_filled_class_by(Some(&maker), name("b"), vec![shape("4567", None)])
            .unwrap();
        store.create_class(name("another's")).unwrap();
    }
    // The catalogue log knows who made what.
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    let store = open();
    let all = Usage {
        classes: 2,
        shapes: 2,
        bytes: 7,
    };
    assert_eq!(store.usage(maker.key).unwrap(), all);
    let b = store.class_by_name(&name("b")).unwrap().unwrap().id;
    store.delete_class(b).unwrap();
    let rest = Usage {
        classes: 1,
        shapes: 1,
        bytes: 3,
    };
    assert_eq!(store.usage(maker.key).unwrap(), rest);
}
