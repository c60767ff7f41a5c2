//! Hours of mixed traffic on a running service, and whether anything grows meanwhile.
//!
//! ```text
//! cargo bench --bench soak                                     # two hours, soak.csv
//! cargo bench --bench soak -- --minutes 30 --settle 10 --csv /tmp/soak.csv --memory-mib 512
//! MALLOC_ARENA_MAX=2 cargo bench --bench soak                  # the service inherits the environment
//! ```
//!
//! Starts the `shapelex` binary of this build on a free port of the loopback address with a zoo of its own in a
//! temporary directory. Queries, uploads, deletions, reindexes, snapshots and clients that misbehave go on at a low rate;
//! resident memory, descriptors and threads of the process are written down every 10 s. At the end it prints how each
//! grew per hour once the service had settled. Arguments it does not know go to `serve`.

mod process;
mod traffic;

use process::{Process, Sample};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use traffic::{Counts, Material};

/// Time between two samples.
const EVERY: Duration = Duration::from_secs(10);

struct Options {
    minutes: f64,
    settle: f64,
    csv: PathBuf,
    /// Seconds between two requests of one kind are multiplied by this.
    slower: f64,
    serve: Vec<String>,
}

impl Options {
    fn parse() -> Self {
        let mut options = Self {
            minutes: 120.0,
            settle: 20.0,
            csv: PathBuf::from("soak.csv"),
            slower: 1.0,
            serve: Vec::new(),
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
                "--minutes" => options.minutes = value().parse().expect("minutes"),
                "--settle" => options.settle = value().parse().expect("minutes"),
                "--slower" => options.slower = value().parse().expect("a factor"),
                "--csv" => options.csv = value().into(),
                other if other.starts_with("--") => options.serve.extend([argument.clone(), value()]),
                other => panic!("unknown argument {other}"),
            }
        }
        options.settle = options.settle.min(options.minutes / 2.0);
        options
    }
}

fn main() {
    let options = Options::parse();
    let process = Process::start(&options.serve);
    let material = Material::new();
    traffic::teach(&process, &material);
    let counts = Counts::default();
    let ended = AtomicBool::new(false);
    let samples = std::thread::scope(|scope| {
        traffic::start(scope, &process, &material, &counts, &ended, options.slower);
        let samples = watch(&process, &counts, &options);
        ended.store(true, Ordering::Relaxed);
        samples
    });
    report(&samples, &options);
}

/// Takes a sample every 10 s until the time is over, and writes each down at once.
fn watch(process: &Process, counts: &Counts, options: &Options) -> Vec<Sample> {
    let mut csv = std::fs::File::create(&options.csv).expect("the file of samples");
    writeln!(csv, "{},{}", Sample::COLUMNS, Counts::COLUMNS).expect("written");
    let began = Instant::now();
    let mut samples = Vec::new();
    while began.elapsed().as_secs_f64() < 60.0 * options.minutes {
        std::thread::sleep(EVERY.saturating_sub(Duration::from_millis(1)));
        let Some(sample) = process.sample(began) else {
            println!("the service is gone after {:.0} s", began.elapsed().as_secs_f64());
            std::process::exit(1);
        };
        writeln!(csv, "{},{}", sample.row(), counts.row()).expect("written");
        samples.push(sample);
    }
    println!("{} samples in {}", samples.len(), options.csv.display());
    println!("{}\n{}", Counts::COLUMNS, counts.row());
    samples
}

/// What is measured, its unit, and how it is read off a sample.
type Series = (&'static str, &'static str, fn(&Sample) -> f64);

const SERIES: [Series; 3] = [
    ("resident memory", "MB", |s| s.resident_kib as f64 / 1e3),
    ("descriptors", "", |s| s.descriptors as f64),
    ("threads", "", |s| s.threads as f64),
];

fn report(samples: &[Sample], options: &Options) {
    let settled: Vec<&Sample> = samples
        .iter()
        .filter(|s| s.seconds > 60.0 * options.settle)
        .collect();
    let mut text = format!(
        "| after the first {:.0} min | first tenth | last tenth | largest | per hour |\n|---|---|---|---|---|\n",
        options.settle
    );
    for (name, unit, value) in SERIES {
        let values: Vec<f64> = settled.iter().map(|s| value(s)).collect();
        let hours: Vec<f64> = settled.iter().map(|s| s.seconds / 3600.0).collect();
        let tenth = values.len().div_ceil(10);
        let _ = writeln!(
            text,
            "| {name} {unit} | {:.1} | {:.1} | {:.1} | {:+.2} |",
            median(&values[..tenth]),
            median(&values[values.len() - tenth..]),
            values.iter().copied().fold(f64::NAN, f64::max),
            slope(&hours, &values)
        );
    }
    println!("{text}");
}

/// Least squares.
fn slope(x: &[f64], y: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (mx, my) = (mean(x), mean(y));
    let up: f64 = x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum();
    let down: f64 = x.iter().map(|x| (x - mx) * (x - mx)).sum();
    up / down
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
