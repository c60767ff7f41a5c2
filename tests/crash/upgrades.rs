//! Killed while it takes over the data directory of an earlier format, whole or with its records lost.

use crate::client::Client;
use crate::kills::number;
use crate::process::{Service, start_and_kill, tail};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::time::Duration;

fn unpack(fixture: &Path, data: &Path) {
    let file = flate2::read::GzDecoder::new(std::fs::File::open(fixture).unwrap());
    tar::Archive::new(file).unpack(data).unwrap();
}

#[test]
fn every_earlier_format_is_taken_over_through_every_kill() {
    let kills = number("SHAPELEX_KILLS", 30);
    let mut rng = ChaCha8Rng::seed_from_u64(number("SHAPELEX_SEED", 1));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/store/fixtures");
    let fixtures: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    let (mut killed, mut rebuilt, mut starts) = (0, 0, 0);
    while killed < kills {
        let fixture = &fixtures[rng.random_range(0..fixtures.len())];
        let directory = tempfile::tempdir().unwrap();
        let data = directory.path().join("data");
        unpack(fixture, &data);
        let lost = rng.random_bool(0.5);
        if lost {
            std::fs::remove_dir_all(data.join("sled")).unwrap();
            rebuilt += 1;
        }
        for _ in 0..rng.random_range(1..=3) {
            start_and_kill(
                directory.path(),
                &[],
                Duration::from_micros(rng.random_range(0..60_000)),
            );
            killed += 1;
        }
        let service = Service::start(directory.path(), &[]);
        starts += 1;
        let client = Client::new(&service.url);
        let mut names = Vec::new();
        for class in client.list("/v1/classes") {
            let id = class["id"].as_str().unwrap();
            let shapes = client.list(&format!("/v1/classes/{id}/shapes"));
            assert_eq!(shapes.len(), 2, "{}", tail(directory.path()));
            for shape in shapes {
                let file = client.get(shape["original"].as_str().unwrap()).body;
                assert_eq!(shape["bytes"], file.len());
            }
            names.push(class["name"].as_str().unwrap().to_owned());
        }
        names.sort();
        assert_eq!(names, ["man", "woman"], "{}", tail(directory.path()));
        let generation = client.get("/v1/index").value()["generation"].clone();
        // Without its records the index is learnt again; with them it is there.
        assert!(lost || generation == 1, "{generation}");
    }
    println!("taken over {starts} times after {killed} kills, {rebuilt} of them without records");
}
