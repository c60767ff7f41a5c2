//! Load on a running service: how many queries a second it answers, how long they take, and what it refuses.
//!
//! ```text
//! cargo bench --bench load                       # 1 to 64 clients, with and without a reindex, about 3 minutes
//! cargo bench --bench load -- --seconds 5 --clients 1,16 --json
//! cargo bench --bench load -- --query-threads 2 --indexing-threads 1
//! ```
//!
//! Starts the `shapelex` binary of this build on a free port of the loopback address with a zoo of its own in a
//! temporary directory, and stops it at the end. Every client is a thread that sends one query after another.

mod client;
mod service;

use client::{Sample, ask, percentile};
use serde_json::{Value, json};
use service::Service;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What to measure.
struct Options {
    clients: Vec<usize>,
    seconds: f64,
    classes: usize,
    serve: Vec<String>,
    json: bool,
}

impl Options {
    fn parse() -> Self {
        let mut options = Self {
            clients: vec![1, 2, 4, 8, 16, 32, 64],
            seconds: 10.0,
            classes: 8,
            serve: Vec::new(),
            json: false,
        };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || {
                arguments
                    .next()
                    .unwrap_or_else(|| panic!("{argument} needs a value"))
            };
            match argument.as_str() {
                "--bench" => {}
                "--json" => options.json = true,
                "--clients" => {
                    options.clients = value()
                        .split(',')
                        .map(|n| n.parse::<usize>().expect("a number of clients").clamp(1, 64))
                        .collect();
                }
                "--seconds" => options.seconds = value().parse::<f64>().expect("seconds").clamp(0.5, 60.0),
                "--classes" => options.classes = value().parse::<usize>().expect("classes").clamp(2, 64),
                other if other.starts_with("--") => options.serve.extend([argument.clone(), value()]),
                other => panic!("unknown argument {other}"),
            }
        }
        options
    }
}

fn main() {
    let options = Options::parse();
    let service = Service::start(&options.serve, options.classes);
    let mut rows = Vec::new();
    for with_reindex in [false, true] {
        for &clients in &options.clients {
            // Settled first, so that a round does not pay for the one before.
            service.wait_idle();
            rows.push(round(&service, clients, options.seconds, with_reindex));
        }
    }
    service.wait_idle();
    let stopped: Vec<Value> = service
        .scans
        .iter()
        .map(|(vertices, mesh)| leave(&service, *vertices, mesh))
        .collect();
    let peak = service.peak_memory();
    let result = json!({
        "rounds": rows,
        "left": stopped,
        "peak_memory_mb": peak,
    });
    if options.json {
        println!("{result:#}");
        return;
    }
    println!("| clients | reindex | queries/s | p50 ms | p99 ms | worst ms | refused (503) | other |");
    println!("|---|---|---|---|---|---|---|---|");
    for row in &rows {
        println!(
            "| {} | {} | {:.2} | {:.0} | {:.0} | {:.0} | {} | {} |",
            row["clients"],
            if row["reindex"] == true { "running" } else { "no" },
            row["per_second"].as_f64().unwrap_or(f64::NAN),
            row["p50_ms"].as_f64().unwrap_or(f64::NAN),
            row["p99_ms"].as_f64().unwrap_or(f64::NAN),
            row["worst_ms"].as_f64().unwrap_or(f64::NAN),
            row["refused"],
            row["other"],
        );
    }
    println!("\n| left in the middle | computes for ms | stopped after: p50 ms | worst ms | tries |");
    println!("|---|---|---|---|---|");
    for row in &stopped {
        println!(
            "| {} vertices | {:.0} | {:.0} | {:.0} | {} |",
            row["vertices"],
            row["computes_ms"].as_f64().unwrap_or(f64::NAN),
            row["p50_ms"].as_f64().unwrap_or(f64::NAN),
            row["worst_ms"].as_f64().unwrap_or(f64::NAN),
            row["tries"],
        );
    }
    println!("\npeak memory: {peak} MB");
}

/// Leaves queries at moments spread over the time they compute.
fn leave(service: &Service, vertices: usize, mesh: &[u8]) -> Value {
    const TRIES: u32 = 20;
    // The first one is slower than those after it.
    let _ = client::time_to_answer(service, mesh);
    let computes = client::time_to_answer(service, mesh);
    let stopped: Vec<f64> = (0..TRIES)
        .filter_map(|k| client::time_to_stop(service, mesh, computes * k / TRIES))
        .collect();
    json!({
        "vertices": vertices,
        "computes_ms": computes.as_secs_f64() * 1e3,
        "p50_ms": percentile(&stopped, 0.5),
        "worst_ms": percentile(&stopped, 1.0),
        "tries": stopped.len(),
    })
}

/// Loads the service for a while with so many clients.
fn round(service: &Service, clients: usize, seconds: f64, with_reindex: bool) -> Value {
    let ended = AtomicBool::new(false);
    let began = Instant::now();
    let until = began + Duration::from_secs_f64(seconds);
    let (samples, jobs) = std::thread::scope(|scope| {
        let reindexing = with_reindex.then(|| scope.spawn(|| service.keep_reindexing(&ended)));
        let workers: Vec<_> = (0..clients)
            .map(|k| scope.spawn(move || ask(service, k, until)))
            .collect();
        let samples: Vec<Sample> = workers
            .into_iter()
            .flat_map(|w| w.join().expect("a client"))
            .collect();
        ended.store(true, Ordering::Relaxed);
        (samples, reindexing.map(|r| r.join().expect("the reindexer")))
    });
    let took = began.elapsed().as_secs_f64();
    let mut codes: BTreeMap<u16, usize> = BTreeMap::new();
    for sample in &samples {
        *codes.entry(sample.status).or_default() += 1;
    }
    let answered: Vec<f64> = samples
        .iter()
        .filter(|s| s.status == 200)
        .map(|s| s.milliseconds)
        .collect();
    let refused = codes.get(&503).copied().unwrap_or(0);
    json!({
        "clients": clients,
        "reindex": with_reindex,
        "reindex_jobs": jobs,
        "seconds": took,
        "answered": answered.len(),
        "per_second": answered.len() as f64 / took,
        "p50_ms": percentile(&answered, 0.5),
        "p99_ms": percentile(&answered, 0.99),
        "worst_ms": percentile(&answered, 1.0),
        "refused": refused,
        "other": samples.len() - answered.len() - refused,
        "codes": codes,
    })
}
