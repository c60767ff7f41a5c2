//! What the engine's records cost in memory once a service is open.

use crate::process::Service;
use faer::Mat;
use shapelex::store::{Dictionaries, Store, StoreOptions};
use shapelex_core::coding::Dictionary;
use shapelex_core::parameters::Channel;
use std::path::Path;
use std::sync::Arc;

/// Resident memory of a process, in KiB.
fn resident(pid: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

#[test]
fn records_cost_a_bounded_multiple_of_their_size_in_memory() {
    if !Path::new("/proc/self/status").exists() {
        println!("records_cost_a_bounded_multiple_of_their_size_in_memory: skipped, there is no /proc here");
        return;
    }
    let open = |dictionaries: usize| {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(&directory.path().join("data"), &StoreOptions::default()).unwrap();
        let mut bytes = 0;
        for i in 0..dictionaries {
            // Of the default size: 128 atoms of 100 numbers.
            let mut atoms = Mat::from_fn(100, 128, |r, c| ((r * 31 + c * 17 + i * 7) % 101) as f64 + 1.0);
            for atom in atoms.col_iter_mut() {
                let norm = atom.norm_l2();
                atom.iter_mut().for_each(|x| *x /= norm);
            }
            let dictionary = Arc::new(Dictionary::new(atoms).unwrap());
            let entry = Dictionaries::from([(Channel::Plain, dictionary)]);
            bytes += store.put_dictionaries(&format!("class-{i}"), &entry).unwrap();
        }
        drop(store);
        let service = Service::start(directory.path(), &[]);
        let found = resident(service.pid());
        service.kill();
        (bytes >> 10, found)
    };
    let (_, empty) = open(0);
    let (kib, full) = open(400);
    let cost = full.saturating_sub(empty);
    println!(
        "400 dictionaries, {kib} KiB: {full} KiB resident after the start, {empty} without them, so {cost}"
    );
    assert!(cost < 6 * kib, "{cost} KiB for {kib} KiB of records");
}
