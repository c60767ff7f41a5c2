//! Starts on a full disk: every one comes up, shows what was acknowledged, refuses writes, and takes them again by itself
//! once there is space. A new directory is refused with a sentence, and nothing of it is left in the way.

use crate::client::Client;
use crate::disk::Disk;
use crate::disk_full::wait_for;
use crate::kills::small;
use crate::mesh;
use crate::process::{Service, spawn, tail};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

/// How the process before ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Before {
    Stopped,
    Killed,
    KilledInAReindex,
    RecordsLost,
    Never,
}

const BEFORE: [Before; 5] = [
    Before::Stopped,
    Before::KilledInAReindex,
    Before::Never,
    Before::Killed,
    Before::RecordsLost,
];
const FREE: [usize; 8] = [
    0,
    4 << 10,
    16 << 10,
    64 << 10,
    256 << 10,
    1 << 20,
    3 << 20,
    5 << 20,
];

/// A life that leaves a catalogue, an index and jobs. Returns the classes' names.
fn live(directory: &Path, before: Before, pause: Duration) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    if before == Before::Never {
        return names;
    }
    let service = Service::start(directory, &[]);
    let client = Client::new(&service.url);
    for class in 0..4 {
        for seed in [10 * class, 10 * class + 1] {
            let path = format!("/v1/classes/class{class}/shapes?create=true&name={seed}.off");
            let answer = client.send("POST", &path, "model/off", mesh(seed).into_bytes());
            assert_eq!(answer.unwrap().status, 201);
        }
        names.insert(format!("class{class}"));
    }
    let job = client.json("POST", "/v1/reindex", &small()).unwrap().value();
    wait_for_jobs(&client);
    assert_eq!(
        client
            .get(&format!("/v1/jobs/{}", job["id"].as_str().unwrap()))
            .value()["state"],
        "succeeded"
    );
    if before == Before::KilledInAReindex {
        let mut all = small();
        all["scope"] = json!("all");
        assert_eq!(client.json("POST", "/v1/reindex", &all).unwrap().status, 202);
        std::thread::sleep(pause);
    }
    match before {
        Before::Stopped => service.stop(),
        _ => service.kill(),
    }
    if before == Before::RecordsLost {
        std::fs::remove_dir_all(directory.join("data/sled")).unwrap();
    }
    names
}

fn wait_for_jobs(client: &Client) {
    wait_for("the end of the jobs", || {
        let unfinished = |job: &Value| ["enqueued", "processing"].contains(&job["state"].as_str().unwrap());
        !client.list("/v1/jobs").iter().any(unfinished)
    });
}

/// Reads are answered, writes are taken or refused with the documented problem.
fn check_full(client: &Client, names: &BTreeSet<String>, before: Before) -> u16 {
    let found: BTreeSet<String> = client
        .list("/v1/classes")
        .iter()
        .map(|class| class["name"].as_str().unwrap().to_owned())
        .collect();
    assert_eq!(&found, names);
    for class in &found {
        for shape in client.list(&format!("/v1/classes/{class}/shapes")) {
            let seed: u32 = shape["name"]
                .as_str()
                .unwrap()
                .strip_suffix(".off")
                .unwrap()
                .parse()
                .unwrap();
            assert!(client.get(shape["original"].as_str().unwrap()).body == mesh(seed).into_bytes());
        }
    }
    let query = client
        .send("POST", "/v1/query", "model/off", mesh(3).into_bytes())
        .unwrap();
    // Without the records there is no index until a reindex, which waits for space.
    let learnt = ![Before::RecordsLost, Before::Never].contains(&before);
    let expected = [200, 507].contains(&query.status) || (!learnt && query.code() == "index_empty");
    assert!(expected, "{}", query.text());
    let write = client
        .json("POST", "/v1/classes", &json!({"name": "written while full"}))
        .unwrap();
    assert!([201, 507].contains(&write.status), "{}", write.text());
    write.status
}

#[test]
fn every_start_on_a_full_disk_comes_up_and_recovers_by_itself() {
    let directory = tempfile::tempdir().unwrap();
    let data = directory.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let number = |name: &str, default| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    let (starts, seed) = (number("SHAPELEX_STARTS", 16), number("SHAPELEX_SEED", 1));
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut refused_writes, mut refused_starts) = (0, 0);
    for i in 0..starts as usize {
        let Some(disk) = Disk::small(&data, 32) else {
            println!("every_start_on_a_full_disk_comes_up: skipped, no file system can be mounted here");
            return;
        };
        let before = BEFORE[i % BEFORE.len()];
        let free = FREE[random.random_range(0..FREE.len())];
        let pause = Duration::from_millis(random.random_range(0..400));
        let names = live(directory.path(), before, pause);
        let without_reserve = random.random_bool(0.5);
        if without_reserve {
            let _ = std::fs::remove_file(data.join("reserve"));
        }
        disk.fill(free);
        println!("start {i}: {before:?}, {free} bytes free, reserve gone: {without_reserve}");
        let started = Service::try_start(spawn(directory.path(), &[]));
        let service = match started {
            Ok(service) => service,
            Err(status) if before == Before::Never => {
                let said = tail(directory.path());
                let said = said.lines().last().unwrap();
                assert_eq!(status.code(), Some(1), "{said}");
                assert!(
                    said.contains("the disk is full") && said.contains("start again"),
                    "{said}"
                );
                refused_starts += 1;
                disk.free();
                let service = Service::start(directory.path(), &[]);
                let client = Client::new(&service.url);
                assert_eq!(
                    client
                        .json("POST", "/v1/classes", &json!({"name": "first"}))
                        .unwrap()
                        .status,
                    201
                );
                service.kill();
                continue;
            }
            Err(status) => panic!("it did not start ({status}):\n{}", tail(directory.path())),
        };
        let client = Client::new(&service.url);
        refused_writes += usize::from(check_full(&client, &names, before) == 507);
        disk.free();
        wait_for("recovery", || {
            client.send("GET", "/readyz", "", Vec::new()).unwrap().status == 200
        });
        let written = client
            .json("POST", "/v1/classes", &json!({"name": "after"}))
            .unwrap();
        assert_eq!(written.status, 201, "{}", written.text());
        wait_for_jobs(&client);
        if before != Before::Never {
            let query = client
                .send("POST", "/v1/query", "model/off", mesh(3).into_bytes())
                .unwrap();
            assert_eq!(query.status, 200, "{}", query.text());
            assert_eq!(query.value()["classes"].as_array().unwrap().len(), names.len());
        }
        service.kill();
        // And the next start finds all of it.
        let service = Service::start(directory.path(), &[]);
        let classes = Client::new(&service.url).list("/v1/classes").len();
        assert!(classes > names.len(), "{classes} classes");
        service.kill();
    }
    println!(
        "{starts} starts on a full disk, seed {seed}: all came up and recovered but {refused_starts} of a new directory, \
         which said so; {refused_writes} refused writes until there was space"
    );
}
