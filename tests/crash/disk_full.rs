//! A disk that is full: writes are refused with 507, reading goes on, nothing is lost, and writes are taken again once
//! there is space, without a restart.

use crate::client::{Answer, Client};
use crate::disk::Disk;
use crate::kills::small;
use crate::mesh;
use crate::model::{Change, Worker};
use crate::process::Service;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use std::time::{Duration, Instant};

fn upload(client: &Client, class: &str, seed: u32) -> Answer {
    let path = format!("/v1/classes/{class}/shapes?create=true&name={seed}.off");
    client
        .send("POST", &path, "model/off", mesh(seed).into_bytes())
        .expect("the service went away")
}

pub fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let began = Instant::now();
    while !there() {
        assert!(
            began.elapsed() < Duration::from_secs(40),
            "{what} does not happen"
        );
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn a_full_disk_is_said_loses_nothing_and_is_got_over() {
    let directory = tempfile::tempdir().unwrap();
    let data = directory.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let Some(disk) = Disk::small(&data, 24) else {
        println!(
            "a_full_disk_is_said_loses_nothing_and_is_got_over: skipped, no file system can be mounted here"
        );
        return;
    };
    let service = Service::start(directory.path(), &[]);
    let client = Client::new(&service.url);
    let mut worker = Worker::new(1, ChaCha8Rng::seed_from_u64(1));
    for class in 0..4 {
        let seeds = (10 * class..10 * class + 3).collect();
        assert!(worker.ask(&client, Change::Upload(format!("worker 1 class{class}"), seeds)));
    }
    let (mut seed, mut accepted, mut refused, mut met_by_records) = (1000, Vec::new(), 0, 0);
    // Another space left each time, so that it ends at another write each time: of a file, the log, the records. Which
    // of them it is, is the allocator's; eight times at least, and on until the records have met it.
    let mut times = 0;
    let kibibytes = [0, 4, 12, 24, 40, 64, 128, 300].into_iter();
    for but in kibibytes.chain((8..200).step_by(12)) {
        if times >= 8 && met_by_records > 0 {
            break;
        }
        times += 1;
        disk.fill(but << 10);
        for _ in 0..400 {
            seed += 1;
            let answer = upload(&client, &format!("filler{seed}"), seed);
            match answer.status {
                201 => accepted.push(seed),
                507 => {
                    assert_eq!(answer.code(), "storage_full", "{}", answer.text());
                    refused += 1;
                    break;
                }
                other => panic!("{other}: {}", answer.text()),
            }
        }
        // Changes that write no file meet the records and the log; a dozen, so that each gets its turn.
        for i in 0..12 {
            let name = json!({"name": format!("small {but} {i}")});
            let answer = client.json("POST", "/v1/classes", &name).unwrap();
            assert!([201, 507].contains(&answer.status), "{}", answer.text());
            refused += u64::from(answer.status == 507);
        }
        let job = client.json("POST", "/v1/reindex", &small()).unwrap();
        assert!([202, 507].contains(&job.status), "{}", job.text());
        let ready = client.send("GET", "/readyz", "", Vec::new()).unwrap();
        if ready.status == 503 {
            met_by_records += 1;
            assert!(ready.text().contains("the disk is full"), "{}", ready.text());
        }
        // Reading goes on.
        worker.check(&client);
        disk.free();
        wait_for("recovery", || {
            client.send("GET", "/readyz", "", Vec::new()).unwrap().status == 200
        });
        worker.check(&client);
        seed += 1;
        let answer = upload(&client, &format!("after{seed}"), seed);
        assert_eq!(answer.status, 201, "there is space again: {}", answer.text());
        accepted.push(seed);
        if job.status == 202 {
            let id = job.value()["id"].as_str().unwrap().to_owned();
            wait_for("the end of the job", || {
                let job = client.get(&format!("/v1/jobs/{id}")).value();
                ["succeeded", "failed"].contains(&job["state"].as_str().unwrap())
            });
        }
    }
    assert!(
        refused > 8 && met_by_records > 0,
        "{refused} refused, {met_by_records} times read-only"
    );
    let there = |client: &Client| {
        let mut seeds = Vec::new();
        for class in client.list("/v1/classes") {
            let (name, id) = (class["name"].as_str().unwrap(), class["id"].as_str().unwrap());
            let shapes = client.list(&format!("/v1/classes/{id}/shapes"));
            assert!(
                !name.starts_with("filler") || shapes.len() == 1,
                "half there: {class}"
            );
            for shape in shapes {
                let file = shape["name"].as_str().unwrap();
                let seed: u32 = file.strip_suffix(".off").unwrap().parse().unwrap();
                let original = client.get(shape["original"].as_str().unwrap());
                assert!(original.body == mesh(seed).into_bytes());
                seeds.push(seed);
            }
        }
        seeds
    };
    let before = there(&client);
    assert!(
        accepted.iter().all(|seed| before.contains(seed)),
        "an acknowledged shape is gone"
    );
    service.kill();
    let service = Service::start(directory.path(), &[]);
    let client = Client::new(&service.url);
    assert_eq!(there(&client), before, "another start finds something else");
    worker.check(&client);
    println!(
        "full {times} times: {refused} writes refused with 507, read-only {met_by_records} times, {} shapes acknowledged and there",
        accepted.len()
    );
    service.kill();
    drop(disk);
}
