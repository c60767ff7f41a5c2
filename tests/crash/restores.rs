//! Killed while a snapshot is unpacked, checked and switched to: the old state or the new one, never something between.

use crate::client::Client;
use crate::kills::number;
use crate::model::{Change, Worker};
use crate::process::{Service, start_and_kill};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use std::time::{Duration, Instant};

#[test]
fn a_restore_killed_anywhere_is_the_old_or_the_new() {
    // A tenth of the kills of the large test.
    let kills = number("SHAPELEX_KILLS", 30).div_ceil(10).max(6);
    let seed = number("SHAPELEX_SEED", 1);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let worker = |seed| Worker::new(1, ChaCha8Rng::seed_from_u64(seed));

    let service = Service::start(path, &[]);
    let client = Client::of_owner(&service.url, &path.join("data"));
    let mut snapshotted = worker(seed);
    for _ in 0..12 {
        let change = snapshotted.choose();
        assert!(snapshotted.ask(&client, change));
    }
    let made = client.json("POST", "/v1/snapshots", &json!({})).unwrap().value();
    let restore = format!("/v1/snapshots/{}/restore", made["id"].as_str().unwrap());
    // What is there when a restore begins; it grows by what each round adds to what it finds.
    let mut current = worker(seed + 1);
    current.known.clone_from(&snapshotted.known);
    drop((client, service));

    let (mut old, mut new, mut starting) = (0, 0, 0);
    for round in 0..kills {
        let service = Service::start(path, &[]);
        let client = Client::of_owner(&service.url, &path.join("data"));
        let name = format!("{}round {round}", current.prefix);
        assert!(current.ask(
            &client,
            Change::Upload(name, vec![u32::try_from(round).unwrap() + 900_000])
        ));
        std::thread::scope(|scope| {
            let restoring = client.clone();
            let restore = &restore;
            let answered = scope.spawn(move || restoring.json("POST", restore, &json!({})));
            let began = Instant::now();
            // A busy machine takes longer: up to the moment it answers, and in places a little beyond.
            let within = Duration::from_micros(rng.random_range(0..300_000));
            while began.elapsed() < within && !answered.is_finished() {
                std::thread::sleep(Duration::from_micros(500));
            }
            service.kill();
        });
        while rng.random_bool(0.4) {
            // The switch may be under way here too.
            start_and_kill(path, &[], Duration::from_micros(rng.random_range(0..60_000)));
            starting += 1;
        }
        let service = Service::start(path, &[]);
        let client = Client::of_owner(&service.url, &path.join("data"));
        let found = crate::model::read(&client, &current.prefix);
        if crate::model::agrees(&found, &current.known) {
            old += 1;
        } else {
            assert!(
                crate::model::agrees(&found, &snapshotted.known),
                "neither the old nor the new:\nfound {found:#?}\nold {:#?}\nnew {:#?}",
                current.known,
                snapshotted.known
            );
            new += 1;
        }
        current.known = found;
        for left in ["restore.unpacking", "restore.ready", "restore.replaced"] {
            assert!(!path.join("data").join(left).exists(), "{left}");
        }
    }
    let service = Service::start(path, &[]);
    let client = Client::of_owner(&service.url, &path.join("data"));
    let answer = client.json("POST", &restore, &json!({})).unwrap();
    assert_eq!(answer.status, 200, "{}", answer.text());
    snapshotted.check(&client);
    println!(
        "restores: survived {} of {} kills, {old} times the old state, {new} times the new",
        kills + starting,
        kills + starting
    );
}
