//! Imported classes and narrow scopes: what a reindex keeps, learns and refuses.

use crate::jobs::{class_of, done, open, reindex, small, start, surface_shape, wait};
use crate::name;
use shapelex::jobs::Jobs;
use shapelex::model::{ClassId, Generation, GenerationClass, JobState, Origin, ReindexScope};
use shapelex::store::Store;
use shapelex_core::parameters::Parameters;
use tempfile::TempDir;

/// A store whose class `imported` has dictionaries and no shapes, as `import` leaves it.
fn with_imported(store: &Store) -> ClassId {
    let teacher = class_of(store, "teacher", 3.0, 0..2);
    let jobs = start(store);
    done(&jobs, reindex(ReindexScope::Stale, Some(small())));
    drop(jobs);
    let learnt = store.generation().unwrap().unwrap();
    let imported = store.create_class(name("imported")).unwrap();
    let key = format!("{}-imported-2", imported.id);
    let (dictionaries, _) = store
        .dictionaries(&learnt.classes[0].dictionary)
        .unwrap()
        .unwrap();
    let bytes = store.put_dictionaries(&key, &dictionaries).unwrap();
    store.delete_class(teacher).unwrap();
    let class = GenerationClass {
        class: imported.id,
        name: imported.name,
        origin: Origin::Imported,
        revision: imported.revision,
        dictionary: key,
        bytes,
        ..learnt.classes[0].clone()
    };
    store
        .put_generation_and_switch(&Generation {
            number: store.next_generation_number().unwrap(),
            classes: vec![class],
            baselines: None,
            ..learnt
        })
        .unwrap();
    imported.id
}

fn indexed(jobs: &Jobs) -> Vec<(String, Origin)> {
    let live = jobs.live_index();
    let generation = live.generation.as_ref().unwrap();
    assert_eq!(generation.classes.len(), live.search.dictionaries.classes.len());
    generation
        .classes
        .iter()
        .map(|c| (c.name.to_string(), c.origin))
        .collect()
}

#[test]
fn imported_classes_stay_until_they_get_shapes_or_are_deleted() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    let imported = with_imported(&store);
    let jobs = start(&store);
    let kept = ("imported".to_owned(), Origin::Imported);
    for scope in [
        ReindexScope::Stale,
        ReindexScope::All,
        ReindexScope::Classes(vec![imported]),
    ] {
        let report = done(&jobs, reindex(scope, None)).result.unwrap();
        assert_eq!(report.reused, [imported]);
        assert!(report.skipped.is_empty(), "{:?}", report.skipped);
        assert_eq!(indexed(&jobs), std::slice::from_ref(&kept));
    }
    let own = class_of(&store, "own", 1.0, 0..3);
    let report = done(&jobs, reindex(ReindexScope::Stale, None)).result.unwrap();
    assert_eq!((report.reused, report.relearned[0].class), (vec![imported], own));
    assert_eq!(indexed(&jobs), [kept.clone(), ("own".to_owned(), Origin::Learnt)]);

    // It survives a restart.
    drop(jobs);
    let jobs = start(&store);
    assert_eq!(indexed(&jobs)[0], kept);

    // With shapes of its own it is learnt, though not where another class is named.
    store
        .add_shapes(imported, vec![surface_shape(3.0, 0), surface_shape(3.0, 1)])
        .unwrap();
    done(&jobs, reindex(ReindexScope::Classes(vec![own]), None));
    assert_eq!(indexed(&jobs)[0], kept);
    done(&jobs, reindex(ReindexScope::Stale, None));
    assert_eq!(indexed(&jobs)[0], ("imported".to_owned(), Origin::Learnt));
    store.delete_class(imported).unwrap();
    done(&jobs, reindex(ReindexScope::Stale, None));
    assert_eq!(indexed(&jobs).len(), 1);
}

#[test]
fn a_reindex_that_would_lose_an_imported_class_is_refused() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    let imported = with_imported(&store);
    class_of(&store, "own", 1.0, 0..2);
    let jobs = start(&store);
    let other = Parameters {
        lambda: 0.2,
        ..small()
    };
    let id = jobs
        .enqueue(reindex(ReindexScope::All, Some(other.clone())))
        .unwrap()
        .id;
    let job = wait(&jobs, id);
    assert_eq!(job.state, JobState::Failed);
    let failure = job.failure.unwrap();
    assert_eq!(failure.code, "imported_classes_incompatible");
    assert!(
        failure.detail.contains("imported") && failure.detail.contains("delete"),
        "{}",
        failure.detail
    );
    assert_eq!(indexed(&jobs).len(), 1, "the index is as it was");
    // What is only asked of queries does not touch dictionaries.
    let queries = Parameters {
        query_samples: 70,
        ..small()
    };
    done(&jobs, reindex(ReindexScope::Stale, Some(queries)));
    assert_eq!(indexed(&jobs).len(), 2);
    store.delete_class(imported).unwrap();
    done(&jobs, reindex(ReindexScope::All, Some(other)));
    assert_eq!(indexed(&jobs), [("own".to_owned(), Origin::Learnt)]);
}

#[test]
fn the_first_reindex_of_named_classes_learns_these_only() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    let one = class_of(&store, "one", 1.0, 0..2);
    let three = class_of(&store, "three", 3.0, 0..2);
    let jobs = start(&store);
    let named = ReindexScope::Classes(vec![one]);
    let report = done(&jobs, reindex(named.clone(), Some(small()))).result.unwrap();
    assert_eq!((report.relearned.len(), report.described), (1, 2));
    assert_eq!((report.skipped[0].class, indexed(&jobs).len()), (three, 1));

    // Other parameters and a scope that leaves indexed classes out do not go together.
    done(&jobs, reindex(ReindexScope::Stale, None));
    let other = Parameters {
        lambda: 0.2,
        ..small()
    };
    let id = jobs.enqueue(reindex(named, Some(other))).unwrap().id;
    let failure = wait(&jobs, id).failure.unwrap();
    assert_eq!(failure.code, "scope_too_narrow");
    assert!(
        failure.detail.contains("three is in the index"),
        "{}",
        failure.detail
    );
    assert_eq!(indexed(&jobs).len(), 2);
}
