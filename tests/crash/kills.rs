//! Killed while it starts, recovers, takes uploads, learns and switches.

use crate::client::Client;
use crate::mesh;
use crate::model::Worker;
use crate::process::{Service, start_and_kill, tail};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Clients that change the catalogue at the same time.
const WORKERS: u32 = 3;

pub fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap())
}

/// What is known of the jobs and the index, beside the workers' classes.
#[derive(Default)]
struct Seen {
    /// Acknowledged jobs, with the final state where one was seen.
    jobs: BTreeMap<String, Option<String>>,
    /// The latest generation that answered.
    generation: u64,
    /// Acknowledged snapshots with the hash of their file.
    snapshots: BTreeMap<String, String>,
    /// Jobs and snapshots acknowledged so far.
    acknowledged: u64,
}

/// What happened, for the report.
#[derive(Debug, Default)]
struct Tally {
    killed_working: u64,
    killed_starting: u64,
    damaged: BTreeMap<&'static str, u64>,
    queries: u64,
    interrupted: u64,
}

/// Parameters that learn within some ten milliseconds.
pub fn small() -> Value {
    json!({"parameters": {
        "eigenpairs": 12, "energies": 12, "atoms": 4, "iterations": 2, "batch": 32, "samples_per_shape": 40,
        "query_samples": 40,
    }})
}

#[test]
fn everything_acknowledged_survives_every_kill() {
    let kills = number("SHAPELEX_KILLS", 30);
    let seed = number("SHAPELEX_SEED", 1);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut workers: Vec<Worker> = (1..=WORKERS)
        .map(|n| Worker::new(n, ChaCha8Rng::seed_from_u64(seed ^ u64::from(n) << 32)))
        .collect();
    let mut seen = Seen::default();
    let mut tally = Tally::default();
    let began = Instant::now();
    let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        while tally.killed_working + tally.killed_starting < kills {
            if rng.random_bool(0.12) {
                damage(path, &mut rng, &mut seen, &mut tally);
            }
            while rng.random_bool(0.4) {
                start_and_kill(path, &[], Duration::from_micros(rng.random_range(0..90_000)));
                tally.killed_starting += 1;
            }
            let service = Service::start(path, &[]);
            check(&service, &mut workers, &mut seen, &mut tally);
            let after = Duration::from_millis(rng.random_range(1..350));
            work_and_kill(service, &mut workers, &mut seen, after);
            tally.killed_working += 1;
        }
        let service = Service::start(path, &[]);
        check(&service, &mut workers, &mut seen, &mut tally);
        settle(&service, &mut workers);
    }));
    if let Err(panic) = outcome {
        eprintln!(
            "after {tally:?} with seed {seed}; the service's log ends:\n{}",
            tail(path)
        );
        std::panic::resume_unwind(panic);
    }
    let acknowledged: u64 = workers.iter().map(|w| w.acknowledged).sum();
    println!(
        "survived {} of {kills} kills in {:.0} s: {acknowledged} changes and {} jobs and snapshots acknowledged; {tally:?}",
        tally.killed_working + tally.killed_starting,
        began.elapsed().as_secs_f64(),
        seen.acknowledged,
    );
    // The engine panics over records damaged on purpose, which is caught and recovered from; nothing of ours may.
    let log = std::fs::read_to_string(path.join("log")).unwrap();
    let ours: Vec<&str> = log
        .lines()
        .filter(|line| line.contains("panicked at") && !line.contains("/sled-"))
        .collect();
    assert!(ours.is_empty(), "{ours:#?}");
    assert!(acknowledged >= kills, "hardly anything was acknowledged");
    assert!(
        seen.acknowledged >= kills / 3,
        "hardly a job or snapshot was acknowledged"
    );
}

/// Everything acknowledged is there.
fn check(service: &Service, workers: &mut [Worker], seen: &mut Seen, tally: &mut Tally) {
    let client = Client::new(&service.url);
    client.get("/readyz");
    for worker in workers.iter_mut() {
        worker.check(&client);
    }
    for (id, ended) in &mut seen.jobs {
        let job = client.get(&format!("/v1/jobs/{id}")).value();
        let state = job["state"].as_str().unwrap();
        if let Some(ended) = ended {
            assert_eq!(state, ended, "a job that had ended changed: {job}");
        }
        match state {
            "enqueued" | "processing" => tally.interrupted += 1,
            "failed" => assert_eq!(job["failure"]["code"], "crashed_repeatedly", "{job}"),
            "succeeded" => {}
            other => panic!("{other}: {job}"),
        }
        if !["enqueued", "processing"].contains(&state) {
            *ended = Some(state.to_owned());
        }
    }
    let generation = client.get("/v1/index").value()["generation"]
        .as_u64()
        .unwrap_or(0);
    assert!(
        generation >= seen.generation,
        "generation {generation} after {} had answered",
        seen.generation
    );
    seen.generation = generation;
    for (id, hash) in &seen.snapshots {
        let file = client.get(&format!("/v1/snapshots/{id}/file")).body;
        assert_eq!(
            blake3::hash(&file).to_hex().as_str(),
            hash,
            "snapshot {id} changed"
        );
    }
    query(&client, tally);
}

/// A query answers, or says that nothing is indexed.
fn query(client: &Client, tally: &mut Tally) {
    let body = mesh(7).into_bytes();
    let answer = client
        .send("POST", "/v1/query", "model/off", body)
        .expect("no answer");
    match (answer.status, answer.code().as_str()) {
        (200, _) => tally.queries += 1,
        (409, "index_empty") => {}
        _ => panic!("a query was answered {}", answer.text()),
    }
}

/// Lets the workers change the catalogue and learn, and kills the service in the middle of it.
fn work_and_kill(service: Service, workers: &mut [Worker], seen: &mut Seen, after: Duration) {
    let ended = AtomicBool::new(false);
    let client = Client::new(&service.url);
    let jobs = Mutex::new(Vec::new());
    let snapshots = Mutex::new(std::mem::take(&mut seen.snapshots));
    let made = AtomicU64::new(0);
    std::thread::scope(|scope| {
        for worker in workers.iter_mut() {
            let (client, ended) = (client.clone(), &ended);
            scope.spawn(move || {
                while !ended.load(Ordering::Relaxed) {
                    let change = worker.choose();
                    if !worker.ask(&client, change) {
                        break;
                    }
                }
            });
        }
        let (reindexing, ended_here, jobs) = (client.clone(), &ended, &jobs);
        scope.spawn(move || {
            while !ended_here.load(Ordering::Relaxed) {
                let Some(answer) = reindexing.json("POST", "/v1/reindex", &small()) else {
                    return;
                };
                if answer.status == 202 {
                    let id = answer.value()["id"].as_str().unwrap().to_owned();
                    jobs.lock().unwrap().push(id);
                } else {
                    assert_eq!(answer.code(), "nothing_to_index", "{}", answer.text());
                }
                std::thread::sleep(Duration::from_millis(25));
            }
        });
        let (snapshotting, ended_here, snapshots, made) = (client.clone(), &ended, &snapshots, &made);
        scope.spawn(move || {
            while !ended_here.load(Ordering::Relaxed) {
                let Some(answer) = snapshotting.json("POST", "/v1/snapshots", &json!({})) else {
                    return;
                };
                assert_eq!(answer.status, 201, "{}", answer.text());
                let text = |name: &str| answer.value()[name].as_str().unwrap().to_owned();
                snapshots.lock().unwrap().insert(text("id"), text("hash"));
                made.fetch_add(1, Ordering::Relaxed);
                // No longer counted on from the moment its deletion is asked for.
                let oldest = match snapshots.lock().unwrap() {
                    mut all if all.len() > 3 => all.pop_first(),
                    _ => None,
                };
                if let Some((id, _)) = oldest {
                    let path = format!("/v1/snapshots/{id}");
                    let Some(answer) = snapshotting.json("DELETE", &path, &json!({})) else {
                        return;
                    };
                    assert_eq!(answer.status, 204, "{}", answer.text());
                }
                std::thread::sleep(Duration::from_millis(40));
            }
        });
        // Counted from the first snapshot on, so that a busy machine is killed at work too and not before it; that
        // one itself is interrupted in every fourth round.
        let began = Instant::now();
        while !after.as_millis().is_multiple_of(4)
            && made.load(Ordering::Relaxed) == 0
            && began.elapsed() < Duration::from_secs(5)
        {
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(after);
        service.kill();
        ended.store(true, Ordering::Relaxed);
    });
    seen.snapshots = snapshots.into_inner().unwrap();
    let jobs = jobs.into_inner().unwrap();
    seen.acknowledged += jobs.len() as u64 + made.into_inner();
    seen.jobs.extend(jobs.into_iter().map(|id| (id, None)));
    // Long lists of jobs would only slow the checks down; the latest are those a crash can touch.
    while seen.jobs.len() > 40 {
        seen.jobs.pop_first();
    }
}

/// Damages what the service must be able to rebuild.
fn damage(path: &Path, rng: &mut ChaCha8Rng, seen: &mut Seen, tally: &mut Tally) {
    let data = path.join("data");
    if !data.join("catalogue.log").exists() || !data.join("sled/db").exists() {
        return;
    }
    let what = match rng.random_range(0..4) {
        0 => {
            std::fs::remove_dir_all(data.join("sled")).unwrap();
            "records lost"
        }
        1 => {
            let db = std::fs::read(data.join("sled/db")).unwrap();
            std::fs::write(data.join("sled/db"), &db[..db.len() / 2]).unwrap();
            "records cut in half"
        }
        2 => {
            let mut db = std::fs::read(data.join("sled/db")).unwrap();
            for _ in 0..200 {
                let at = rng.random_range(0..db.len());
                db[at] ^= 1 << rng.random_range(0..8);
            }
            std::fs::write(data.join("sled/db"), &db).unwrap();
            "records with flipped bits"
        }
        _ => {
            std::fs::remove_file(data.join("catalogue.log")).unwrap();
            *tally.damaged.entry("log lost").or_default() += 1;
            // One thing at a time: the log is whole again after this.
            drop(Service::start(path, &[]));
            return;
        }
    };
    *tally.damaged.entry(what).or_default() += 1;
    // Jobs and the index are not in the log; they are forgotten, and learnt again.
    seen.jobs.clear();
    seen.generation = 0;
}

/// All jobs end, the index can be learnt, and a query finds the class of a shape that is there.
fn settle(service: &Service, workers: &mut [Worker]) {
    let client = Client::new(&service.url);
    let worker = &mut workers[0];
    let name = format!("{}at the end", worker.prefix);
    assert!(worker.ask(&client, crate::model::Change::Upload(name, vec![77, 78])));
    let job = client.json("POST", "/v1/reindex", &small()).unwrap().value();
    let id = job["id"].as_str().unwrap();
    let began = Instant::now();
    loop {
        let job = client.get(&format!("/v1/jobs/{id}")).value();
        match job["state"].as_str().unwrap() {
            "succeeded" => break,
            "enqueued" | "processing" => std::thread::sleep(Duration::from_millis(50)),
            other => panic!("{other}: {job}"),
        }
        assert!(began.elapsed() < Duration::from_secs(120), "stuck: {job}");
    }
    let answer = client
        .send("POST", "/v1/query", "model/off", mesh(77).into_bytes())
        .unwrap();
    assert_eq!(answer.status, 200, "{}", answer.text());
    worker.check(&client);
}
