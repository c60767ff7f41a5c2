//! The queue, the indexing worker and the live index, on small real meshes.

use crate::name;
use bytes::Bytes;
use shapelex::jobs::{JobError, JobOptions, Jobs};
use shapelex::model::{ClassId, Job, JobId, JobKind, JobState, NewShape, ReindexScope};
use shapelex::store::{Store, StoreError, StoreOptions};
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{Format, Limits, PrepareReport, Source};
use shapelex_core::parameters::{Channel, Parameters};
use shapelex_core::pipeline::describe_query;
use shapelex_core::ranking::rank;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::path::Path;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The latest jobs.
fn page(jobs: &Jobs, limit: usize) -> Vec<Job> {
    jobs.page::<StoreError>(None, limit, |_| Ok(())).unwrap().items
}

/// A closed surface as an OBJ file: a sphere with `lobes` lobes, stretched a little by the pose.
fn surface(lobes: f64, pose: usize, rings: usize) -> Vec<u8> {
    let columns = rings + rings / 2;
    let stretch = 1.0 + 0.05 * pose as f64;
    let mut obj = String::new();
    let mut vertex = |theta: f64, phi: f64| {
        let r = 1.0 + 0.35 * theta.sin().powi(2) * (lobes * phi).cos();
        let (x, y, z) = (theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        writeln!(obj, "v {} {} {}", r * x * stretch, r * y, r * z).unwrap();
    };
    vertex(0.0, 0.0);
    for i in 1..rings {
        for j in 0..columns {
            vertex(PI * i as f64 / rings as f64, TAU * j as f64 / columns as f64);
        }
    }
    vertex(PI, 0.0);
    let last = 2 + (rings - 1) * columns;
    let at = |i: usize, j: usize| 2 + (i - 1) * columns + j % columns;
    for j in 0..columns {
        writeln!(obj, "f 1 {} {}", at(1, j), at(1, j + 1)).unwrap();
        writeln!(obj, "f {last} {} {}", at(rings - 1, j + 1), at(rings - 1, j)).unwrap();
        for i in 1..rings - 1 {
            writeln!(obj, "f {} {} {}", at(i, j), at(i + 1, j), at(i + 1, j + 1)).unwrap();
            writeln!(obj, "f {} {} {}", at(i, j), at(i + 1, j + 1), at(i, j + 1)).unwrap();
        }
    }
    obj.into_bytes()
}

fn mesh(bytes: Vec<u8>) -> NewShape {
    NewShape {
        name: None,
        bytes: Bytes::from(bytes),
        companions: Vec::new(),
        format: Format::Obj,
        pose: None,
        report: PrepareReport::default(),
    }
}

pub fn surface_shape(lobes: f64, pose: usize) -> NewShape {
    mesh(surface(lobes, pose, 14))
}

pub fn small() -> Parameters {
    Parameters {
        eigenpairs: 40,
        energies: 40,
        atoms: 12,
        iterations: 8,
        batch: 64,
        samples_per_shape: 150,
        query_samples: 80,
        lambda: 0.1,
        ..Parameters::default()
    }
}

pub fn open(path: &Path) -> Store {
    Store::open(path, &StoreOptions::default()).unwrap()
}

pub fn start(store: &Store) -> Jobs {
    let options = JobOptions {
        indexing_threads: 2,
        queue_limit: 3,
        ..JobOptions::default()
    };
    Jobs::start(store.clone(), options).unwrap()
}

pub fn reindex(scope: ReindexScope, parameters: Option<Parameters>) -> JobKind {
    JobKind::Reindex { scope, parameters }
}

/// Follows a job to its end.
pub fn wait(jobs: &Jobs, id: JobId) -> Job {
    let mut job = jobs.subscribe(id).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    runtime.block_on(async { while job.changed().await.is_ok() {} });
    let job = job.borrow().clone();
    assert!(job.state.is_finished());
    assert_eq!(jobs.job(id).unwrap(), job);
    job
}

pub fn done(jobs: &Jobs, kind: JobKind) -> Job {
    let id = jobs.enqueue(kind).unwrap().id;
    let job = wait(jobs, id);
    assert_eq!(job.state, JobState::Succeeded, "{:?}", job.failure);
    job
}

pub fn class_of(store: &Store, text: &str, lobes: f64, poses: std::ops::Range<usize>) -> ClassId {
    let id = store.create_class(name(text)).unwrap().id;
    let shapes = poses.map(|pose| mesh(surface(lobes, pose, 14))).collect();
    store.add_shapes(id, shapes).unwrap();
    id
}

fn best(jobs: &Jobs, lobes: f64) -> String {
    let bytes = surface(lobes, 3, 14);
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    let (_, soup) = shapelex_core::mesh::read(&source, &Limits::default()).unwrap();
    let live = jobs.live_index();
    let query = describe_query(
        soup,
        &live.search.dictionaries.parameters,
        &Cancel::new(),
        &|_| {},
    )
    .unwrap();
    let ranking = rank(
        &query.views,
        &live.search.dictionaries,
        live.search.dictionaries.parameters.rank_by,
        &Cancel::new(),
    )
    .unwrap();
    ranking.classes[0].label.clone()
}

#[test]
fn an_index_lives_through_changes_of_its_classes() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    let three = class_of(&store, "three", 3.0, 0..3);
    let one = class_of(&store, "one", 1.0, 0..3);
    let empty = store.create_class(name("empty")).unwrap().id;
    let jobs = start(&store);
    assert!(jobs.live_index().generation.is_none());

    let first = done(&jobs, reindex(ReindexScope::Stale, Some(small())));
    let report = first.result.unwrap();
    assert_eq!((first.generation, first.attempts), (Some(1), 1));
    assert_eq!(
        (report.relearned.len(), report.described, report.described_before),
        (2, 6, 0)
    );
    assert_eq!(report.skipped.len(), 1);
    assert_eq!(
        (report.skipped[0].class, report.skipped[0].reason.as_str()),
        (empty, "it has no shapes")
    );
    let steps: Vec<_> = first
        .steps
        .iter()
        .map(|s| (s.name.as_str(), s.finished, s.total))
        .collect();
    assert_eq!(
        steps,
        [
            ("describe shapes", 6, 6),
            ("learn classes", 2, 2),
            ("learn baselines", 2, 2),
            ("switch", 1, 1)
        ]
    );
    assert_eq!(best(&jobs, 3.0), three.to_string());
    assert_eq!(best(&jobs, 1.0), one.to_string());

    // Nothing changed: nothing is learnt, and the generation stays.
    let again = done(&jobs, reindex(ReindexScope::Stale, None));
    assert_eq!(again.generation, Some(1));
    assert_eq!(again.result.unwrap().reused, [three, one]);

    // One class changed: it alone is learnt, and only its new shape described.
    let held = jobs.live_index();
    store.add_shapes(three, vec![mesh(surface(3.0, 4, 14))]).unwrap();
    let changed = done(&jobs, reindex(ReindexScope::Stale, None));
    let report = changed.result.unwrap();
    assert_eq!((changed.generation, report.reused), (Some(2), vec![one]));
    assert_eq!(
        (report.relearned[0].class, report.relearned[0].shapes),
        (three, 4)
    );
    assert_eq!((report.described, report.described_before), (1, 3));
    assert_eq!(
        held.generation.as_ref().unwrap().number,
        1,
        "a query keeps the index it began with"
    );

    // Other learning parameters: all is learnt, nothing described.
    let other = Parameters {
        lambda: 0.2,
        ..small()
    };
    let report = done(&jobs, reindex(ReindexScope::Stale, Some(other.clone())))
        .result
        .unwrap();
    assert_eq!(
        (report.relearned.len(), report.described, report.described_before),
        (2, 0, 7)
    );

    // Only the named class, though both are asked for by their changes.
    store.add_shapes(one, vec![mesh(surface(1.0, 4, 14))]).unwrap();
    store.add_shapes(three, vec![mesh(surface(3.0, 5, 14))]).unwrap();
    let named = done(&jobs, reindex(ReindexScope::Classes(vec![one]), None));
    let report = named.result.unwrap();
    assert_eq!((report.relearned[0].class, report.reused), (one, vec![three]));
    let generation = jobs.live_index().generation.clone().unwrap();
    let revision = |id| {
        (
            generation.class(id).unwrap().revision,
            store.class(id).unwrap().revision,
        )
    };
    assert_ne!(revision(three).0, revision(three).1, "still stale");
    assert_eq!(revision(one).0, revision(one).1);

    // A deleted class leaves the index, and its dictionary the store.
    let key = generation.class(one).unwrap().dictionary.clone();
    store.delete_class(one).unwrap();
    done(&jobs, reindex(ReindexScope::Stale, None));
    assert_eq!(jobs.live_index().search.dictionaries.classes.len(), 1);
    assert!(store.dictionaries(&key).unwrap().is_none());

    let live = jobs.live_index();
    assert!(jobs.shutdown(Duration::from_secs(10)));
    assert!(matches!(
        jobs.enqueue(reindex(ReindexScope::Stale, None)),
        Err(JobError::ShuttingDown)
    ));
    drop((jobs, store));
    let store = open(directory.path());
    let jobs = start(&store);
    assert_eq!(jobs.live_index().generation, live.generation);
    assert_eq!(jobs.live_index().search.dictionaries.parameters, other);
    assert_eq!(best(&jobs, 3.0), three.to_string());
    assert_eq!(page(&jobs, 2).len(), 2);
}

#[test]
fn a_shape_that_cannot_be_read_fails_alone() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    let good = class_of(&store, "good", 3.0, 0..2);
    let bad = store
        .add_shapes(good, vec![mesh(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n".to_vec())])
        .unwrap()[0]
        .shape
        .id;
    let worse = store.create_class(name("worse")).unwrap().id;
    store.add_shapes(worse, vec![mesh(b"no mesh".to_vec())]).unwrap();
    let jobs = start(&store);
    let job = done(&jobs, reindex(ReindexScope::Stale, Some(small())));
    let report = job.result.unwrap();
    assert_eq!((report.relearned[0].class, report.relearned[0].shapes), (good, 2));
    let failed = report.failed_shapes.iter().find(|f| f.shape == bad).unwrap();
    assert_eq!(failed.code, "mesh_unusable");
    assert!(failed.detail.contains("vertex"), "{}", failed.detail);
    assert_eq!(report.skipped[0].class, worse);

    store.delete_class(good).unwrap();
    let id = jobs.enqueue(reindex(ReindexScope::All, None)).unwrap().id;
    let job = wait(&jobs, id);
    assert_eq!(job.state, JobState::Failed);
    assert_eq!(job.failure.unwrap().code, "all_shapes_failed");
    assert_eq!(
        jobs.live_index().generation.as_ref().unwrap().number,
        1,
        "the index is as it was"
    );
}

#[test]
fn interrupted_jobs_run_again_but_not_for_ever() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    class_of(&store, "three", 3.0, 0..2);
    let interrupted = |attempts| {
        let mut job = Job::new(
            reindex(ReindexScope::Stale, Some(small())),
            jiff::Timestamp::now(),
        );
        job.state = JobState::Processing;
        job.attempts = attempts;
        store.put_job(&job).unwrap();
        job.id
    };
    let (once, thrice) = (interrupted(1), interrupted(3));
    let jobs = start(&store);
    let job = wait(&jobs, once);
    assert_eq!((job.state, job.attempts), (JobState::Succeeded, 2));
    let job = wait(&jobs, thrice);
    assert_eq!(job.state, JobState::Failed);
    assert_eq!(job.failure.unwrap().code, "crashed_repeatedly");
}

/// A class that takes seconds to learn.
fn slow_class(store: &Store) -> ClassId {
    let id = store.create_class(name("slow")).unwrap().id;
    let shapes = (0..40).map(|pose| mesh(surface(4.0, pose, 36))).collect();
    store.add_shapes(id, shapes).unwrap();
    id
}

fn until_processing(jobs: &Jobs, id: JobId) {
    let end = Instant::now() + Duration::from_secs(60);
    while jobs.job(id).unwrap().state != JobState::Processing {
        assert!(Instant::now() < end);
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn jobs_wait_in_a_bounded_queue_and_can_be_cancelled() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    slow_class(&store);
    let jobs = start(&store);
    let kind = || {
        reindex(
            ReindexScope::Stale,
            Some(Parameters {
                samples_per_shape: 0,
                ..Parameters::default()
            }),
        )
    };
    let running = jobs.enqueue(kind()).unwrap().id;
    until_processing(&jobs, running);
    let waiting: Vec<_> = (0..3).map(|_| jobs.enqueue(kind()).unwrap().id).collect();
    assert!(matches!(
        jobs.enqueue(kind()),
        Err(JobError::QueueFull { limit: 3 })
    ));
    assert_eq!(jobs.queue_depth(), 4);
    for id in &waiting {
        assert_eq!(jobs.cancel(*id).unwrap().state, JobState::Cancelled);
    }
    assert_eq!(jobs.queue_depth(), 1);
    jobs.cancel(running).unwrap();
    let job = wait(&jobs, running);
    assert_eq!(job.state, JobState::Cancelled);
    assert!(matches!(
        jobs.cancel(running),
        Err(JobError::Finished {
            state: JobState::Cancelled,
            ..
        })
    ));
    assert!(matches!(jobs.cancel(JobId::new()), Err(JobError::NoJob { .. })));
    assert!(jobs.live_index().generation.is_none());
    let mut bad = small();
    bad.lambda = -1.0;
    assert!(matches!(
        jobs.enqueue(reindex(ReindexScope::All, Some(bad))),
        Err(JobError::Parameter(_))
    ));
    assert!(jobs.is_running());
}

#[test]
fn a_job_running_at_shutdown_goes_back_to_the_queue() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    let slow = slow_class(&store);
    let jobs = start(&store);
    let kind = reindex(
        ReindexScope::Stale,
        Some(Parameters {
            samples_per_shape: 0,
            ..Parameters::default()
        }),
    );
    let id = jobs.enqueue(kind).unwrap().id;
    until_processing(&jobs, id);
    assert!(jobs.shutdown(Duration::from_secs(30)));
    drop((jobs, store));
    let store = open(directory.path());
    let left = store.unfinished_jobs().unwrap();
    assert_eq!(
        (left[0].id, left[0].state, left[0].attempts),
        (id, JobState::Enqueued, 0)
    );
    store.delete_class(slow).unwrap();
    class_of(&store, "three", 3.0, 0..1);
    let jobs = start(&store);
    assert_eq!(wait(&jobs, id).state, JobState::Succeeded);
}

fn atoms(jobs: &Jobs, class: ClassId) -> Vec<f64> {
    let live = jobs.live_index();
    let class = live
        .search
        .dictionaries
        .classes
        .iter()
        .find(|c| c.label == class.to_string())
        .unwrap();
    let atoms = class.dictionaries[&Channel::Plain].atoms();
    let atoms = atoms.as_ref();
    (0..atoms.ncols())
        .flat_map(|j| (0..atoms.nrows()).map(move |i| atoms[(i, j)]))
        .collect()
}

#[test]
fn a_lost_index_is_learnt_again_to_the_same_bytes() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    let class = class_of(&store, "three", 3.0, 0..3);
    let jobs = start(&store);
    done(&jobs, reindex(ReindexScope::Stale, Some(small())));
    let before = atoms(&jobs, class);
    drop((jobs, store));
    std::fs::remove_dir_all(directory.path().join("sled")).unwrap();
    let store = open(directory.path());
    let jobs = start(&store);
    let queued = page(&jobs, 10);
    assert_eq!(queued.len(), 1, "a reindex was queued unasked");
    let job = wait(&jobs, queued[0].id);
    assert_eq!((job.state, job.generation), (JobState::Succeeded, Some(2)));
    assert_eq!(jobs.live_index().search.dictionaries.parameters, small());
    assert_eq!(atoms(&jobs, class), before);
}

#[test]
fn the_order_of_uploads_does_not_change_what_is_learnt() {
    let learn = |order: &[usize]| {
        let directory = TempDir::new().unwrap();
        let store = open(directory.path());
        let class = store.create_class(name("three")).unwrap().id;
        for pose in order {
            store
                .add_shapes(class, vec![mesh(surface(3.0, *pose, 14))])
                .unwrap();
        }
        let jobs = start(&store);
        done(&jobs, reindex(ReindexScope::Stale, Some(small())));
        atoms(&jobs, class)
    };
    assert_eq!(learn(&[0, 1, 2]), learn(&[2, 0, 1]));
}

#[test]
fn shapes_get_dictionaries_of_their_own_where_asked() {
    let directory = TempDir::new().unwrap();
    let store = open(directory.path());
    let class = class_of(&store, "three", 3.0, 0..2);
    let jobs = start(&store);
    let parameters = Parameters {
        per_shape: true,
        ..small()
    };
    done(&jobs, reindex(ReindexScope::Stale, Some(parameters)));
    let live = jobs.live_index();
    let labels: Vec<_> = live.search.dictionaries.classes[0]
        .shapes
        .iter()
        .map(|s| s.label.clone())
        .collect();
    let shapes = store.list_shapes(class, None, 10).unwrap();
    assert_eq!(labels.len(), 2);
    assert!(shapes.iter().all(|s| labels.contains(&s.id.to_string())));
}
