//! Small requests that ask for much: each is answered with a precise problem, within 5 s, by a process that stays
//! below 512 MB.

#[allow(dead_code, reason = "shared with tests/service")]
#[path = "../service/harness.rs"]
mod harness;
#[allow(dead_code, reason = "shared with tests/service")]
#[path = "../service/meshes.rs"]
mod meshes;

mod archives;
mod gltf;
mod large;
mod surfaces;

use harness::{App, small};
use serde_json::json;
use std::time::{Duration, Instant};

const LIMIT: Duration = Duration::from_secs(5);
const MEMORY: usize = 512 << 20;

/// What is sent, as what, and the status and code it is answered with.
type Case = (&'static str, &'static str, Vec<u8>, u16, &'static str);

/// The process's largest resident set since it was last reset, in bytes; `None` where the system does not say.
fn peak() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: usize = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes << 10)
}

/// Lets the peak start afresh at what is resident now, which is returned: the system's allocator keeps what the cases
/// before have freed.
fn reset_peak() -> usize {
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    peak().unwrap_or(0)
}

/// Sends a case as a query and returns what is wrong with the answer.
async fn attempt(app: &App, (what, media_type, body, status, code): Case) -> Option<String> {
    // Linux starts counting the peak anew.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let began = Instant::now();
    let answer = app.post("/v1/query", media_type, body).await;
    let took = began.elapsed();
    let peak = peak().unwrap_or(0);
    println!(
        "{what}: {} {}, {:.2} s, peak {} MB",
        answer.status,
        answer.text().chars().take(120).collect::<String>(),
        took.as_secs_f64(),
        peak >> 20
    );
    let found = answer.problem();
    if found != (status, code.to_owned()) {
        return Some(format!(
            "{what}: {found:?}, expected {status} {code}: {}",
            answer.text()
        ));
    }
    if took > LIMIT || peak > MEMORY {
        return Some(format!("{what}: {took:?}, {} MB", peak >> 20));
    }
    None
}

// One test, so that the memory of one case is not counted for another.
#[tokio::test(flavor = "multi_thread")]
async fn each_is_answered_with_its_problem() {
    let app = App::indexed().await;
    let makers: Vec<fn() -> Case> = [archives::CASES, surfaces::CASES].concat();
    let mut wrong = Vec::new();
    for make in makers {
        wrong.extend(attempt(&app, make()).await);
    }
    wrong.extend(gltf::read_all());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));

    let before = reset_peak();
    let answer = app.post("/v1/query", "application/zip", gltf::spellings()).await;
    assert_eq!(answer.status, 200, "{}", answer.text());
    let taken = peak().unwrap_or(0).saturating_sub(before);
    assert!(taken < MEMORY, "one file under many names: {} MB", taken >> 20);

    for (name, body) in surfaces::answerable() {
        let began = Instant::now();
        let answer = app.post("/v1/query", "application/octet-stream", body).await;
        assert_eq!(answer.status, 200, "{name}: {}", answer.text());
        assert!(began.elapsed() < LIMIT, "{name}: {:?}", began.elapsed());
    }

    // Followed to its end, where a tetrahedron is; it is refined, and answered with a warning.
    let began = Instant::now();
    let answer = app
        .post("/v1/query", "application/octet-stream", surfaces::chain())
        .await;
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert_eq!(answer.value()["mesh"]["vertices"], 4);
    assert!(answer.text().contains("Only 4 vertices"), "{}", answer.text());
    assert!(began.elapsed() < LIMIT, "a chain of nodes: {:?}", began.elapsed());

    let nested = format!("{{\"name\": {}{}}}", "[".repeat(100_000), "]".repeat(100_000));
    let answer = app.post("/v1/classes", "application/json", nested).await;
    answer.fails(422, "invalid_field");

    many_equal_pieces(&app).await;
    large_surfaces(&app).await;
}

/// Memory for a mesh at the limits of size, beside the file itself: 96 bytes per vertex and 64 per face while it is
/// prepared (`prepare_within`), and the mesh as read.
const LARGE_MEMORY: usize = 640 << 20;
/// Processor time for it: 5 s, and as much again for a busy machine.
const LARGE_LIMIT: Duration = Duration::from_secs(10);

/// Meshes just below the limits of size: answered, or refused by name, in [`LARGE_LIMIT`] of processor time and [`LARGE_MEMORY`].
async fn large_surfaces(app: &App) {
    let mut parameters = small();
    parameters["working_size"] = json!(2000);
    parameters["components"] = json!("largest");
    let job = app.reindex(json!({"parameters": parameters})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let mut wrong = Vec::new();
    for make in large::CASES {
        let (what, media_type, body, expected) = make();
        // The sender is in this process too, with a copy of its own.
        let most = LARGE_MEMORY + body.len();
        let before = reset_peak();
        let began = processor_time();
        let answer = app.post("/v1/query", media_type, body).await;
        let took = processor_time().saturating_sub(began);
        let peak = peak().unwrap_or(0).saturating_sub(before);
        println!(
            "{what}: {} {}, {:.2} s of processor time, peak {} MB",
            answer.status,
            answer.text().chars().take(160).collect::<String>(),
            took.as_secs_f64(),
            peak >> 20
        );
        if answer.status != expected || took > LARGE_LIMIT || peak > most {
            wrong.push(format!(
                "{what}: {} in {took:?}, {} MB",
                answer.status,
                peak >> 20
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Processor time of the process so far, to a hundredth of a second; 0 where the system does not say.
fn processor_time() -> Duration {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name, in brackets, may hold anything; the 12th and 13th field after it are ticks of 10 ms.
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace();
    let ticks: u64 = fields
        .skip(11)
        .take(2)
        .filter_map(|t| t.parse::<u64>().ok())
        .sum();
    Duration::from_millis(10 * ticks)
}

/// More equal pieces than the solver's blocks find copies of an eigenvalue, in a mesh too large for the dense one.
async fn many_equal_pieces(app: &App) {
    let mut parameters = small();
    for (key, value) in [
        ("components", json!("all")),
        ("working_size", json!(0)),
        ("eigenpairs", json!(120)),
    ] {
        parameters[key] = value;
    }
    let job = app.reindex(json!({"parameters": parameters})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let began = Instant::now();
    let answer = app.post("/v1/query", "model/off", surfaces::pieces(40)).await;
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert_eq!(answer.value()["mesh"]["components"], 40);
    assert!(began.elapsed() < LIMIT, "{:?}", began.elapsed());
}
