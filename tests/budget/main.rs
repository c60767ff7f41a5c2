//! One budget for memory: whatever clients do within the limits, the process stays below `--memory-mib` and 300 MB, and
//! `/healthz` answers meanwhile.
//!
//! ```text
//! cargo test --release --test budget -- --nocapture                                 # 256 MiB, under a minute
//! SHAPELEX_BUDGET_MINUTES=30 SHAPELEX_BUDGET_MIB=2048 cargo test --release --test budget -- --nocapture
//! ```
//!
//! The long form goes round the same attacks with 1000 connections until the time is over. Clients speak over real sockets
//! to the real binary; its resident size comes from `/proc`.
#![cfg(target_os = "linux")]

#[allow(dead_code, reason = "shared with tests/service")]
#[path = "../service/meshes.rs"]
mod meshes;
#[allow(dead_code, reason = "shared with tests/crash")]
#[path = "../crash/process.rs"]
mod process;

mod attacks;
mod files;
mod watch;

use attacks::{ATTACKS, Target};
use process::Service;
use std::time::{Duration, Instant};
use watch::Watch;

/// What the process may take beside its budget.
const BESIDE_MIB: u64 = 300;

fn setting(name: &str) -> Option<u64> {
    std::env::var(name)
        .ok()
        .map(|text| text.parse().unwrap_or_else(|_| panic!("{name} is a number")))
}

#[test]
fn the_process_stays_within_its_budget_whatever_clients_do() {
    let minutes = setting("SHAPELEX_BUDGET_MINUTES");
    let memory_mib = setting("SHAPELEX_BUDGET_MIB").unwrap_or(256);
    raise_open_files();
    let directory = tempfile::tempdir().unwrap();
    let memory = memory_mib.to_string();
    let service = Service::start(
        directory.path(),
        &[
            "--memory-mib",
            &memory,
            "--query-threads",
            "2",
            "--indexing-threads",
            "2",
            "--upload-timeout-seconds",
            "20",
        ],
    );
    let target = Target {
        address: service.url.trim_start_matches("http://").to_owned(),
        connections: if minutes.is_some() { 1000 } else { 250 },
        memory_mib,
    };
    target.teach();
    let watch = Watch::start(service.pid(), &target.address);
    let until = Instant::now() + Duration::from_secs(60 * minutes.unwrap_or(0));
    let mut round = 0;
    loop {
        for (name, attack) in ATTACKS {
            let began = Instant::now();
            let outcome = attack(&target, round);
            let seen = watch.take();
            println!(
                "{name}: {:.1} s, peak {} MB, health median {:.1} ms worst {:.0} ms, {outcome}",
                began.elapsed().as_secs_f64(),
                seen.peak_mib,
                seen.median_ms,
                seen.worst_ms
            );
            assert!(
                seen.peak_mib < memory_mib + BESIDE_MIB,
                "{name}: {} MiB resident with a budget of {memory_mib}\n{}",
                seen.peak_mib,
                process::tail(directory.path())
            );
            assert!(
                seen.median_ms < 50.0,
                "{name}: /healthz took {:.1} ms",
                seen.median_ms
            );
        }
        round += 1;
        if Instant::now() >= until {
            break;
        }
    }
    target.answers_again();
}

/// Both sides of a thousand connections need descriptors; the service inherits the limit.
fn raise_open_files() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        ..limit
    };
    // Where the system refuses, fewer connections are made.
    let _ = setrlimit(Resource::Nofile, raised);
}
