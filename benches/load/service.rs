//! The service under load: the real binary in a process of its own.

use serde_json::{Value, json};
use shapelex_eval::sample::{ZooOptions, creatures, species, write_obj};
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Poses of a class that it learns from, and unseen ones it is asked about.
const POSES: usize = 3;
const UNSEEN: usize = 2;

pub struct Service {
    process: Child,
    port: u16,
    _directory: tempfile::TempDir,
    /// Meshes to ask with.
    pub queries: Vec<Vec<u8>>,
    /// Scans to leave in the middle of, by their number of vertices.
    pub scans: Vec<(usize, Vec<u8>)>,
}

impl Service {
    /// Starts the service with more arguments for `serve`, teaches it so many classes and waits for its index.
    pub fn start(arguments: &[String], classes: usize) -> Self {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let port = {
            let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
            free.local_addr().expect("its address").port()
        };
        let process = Command::new(env!("CARGO_BIN_EXE_shapelex"))
            .args([
                "serve",
                "--log",
                "error",
                "--listen",
                &format!("127.0.0.1:{port}"),
                "--data",
            ])
            .arg(directory.path().join("data"))
            .args(arguments)
            .stdout(Stdio::null())
            .spawn()
            .expect("the service starts");
        let mut service = Self {
            process,
            port,
            _directory: directory,
            queries: Vec::new(),
            scans: Vec::new(),
        };
        service.wait_for("/readyz", |status, _| status == 200);
        let options = ZooOptions::default();
        let kinds = species(1, classes);
        for creature in creatures(&kinds, POSES + UNSEEN, 1, &options) {
            let creature = creature.expect("a creature");
            let bytes = write_obj(&creature.mesh);
            if creature.pose >= POSES {
                service.queries.push(bytes);
                continue;
            }
            let path = format!(
                "/v1/classes/{}/shapes?create=true&name={}.obj",
                creature.class, creature.pose
            );
            let (status, answer) = service.post(&path, "model/obj", &bytes);
            assert_eq!(status, 201, "{answer}");
        }
        service.scans = [100, 200, 400].map(|side| (side * side, sphere(side))).into();
        service.reindex(1);
        service.wait_idle();
        service
    }

    pub fn address(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address())
    }

    /// A client with a connection of its own, which takes every status for an answer.
    pub fn agent(&self) -> ureq::Agent {
        ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(Duration::from_secs(120)))
            .proxy(None)
            .build()
            .into()
    }

    fn post(&self, path: &str, media_type: &str, body: &[u8]) -> (u16, String) {
        let answer = self
            .agent()
            .post(self.url(path))
            .content_type(media_type)
            .send(body);
        let mut answer = answer.expect("an answer");
        (
            answer.status().as_u16(),
            answer.body_mut().read_to_string().unwrap_or_default(),
        )
    }

    fn get(&self, path: &str) -> Option<(u16, String)> {
        let mut answer = self.agent().get(self.url(path)).call().ok()?;
        Some((answer.status().as_u16(), answer.body_mut().read_to_string().ok()?))
    }

    fn wait_for(&self, path: &str, done: impl Fn(u16, &str) -> bool) {
        let began = Instant::now();
        while !self.get(path).is_some_and(|(status, text)| done(status, &text)) {
            assert!(began.elapsed() < Duration::from_secs(300), "{path}: not yet");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Asks for all classes to be learnt again, with another seed so that nothing is reused.
    fn reindex(&self, seed: u64) -> u16 {
        let body = json!({"scope": "all", "parameters": {"seed": seed}}).to_string();
        self.post("/v1/reindex", "application/json", body.as_bytes()).0
    }

    /// Waits until no job is left.
    pub fn wait_idle(&self) {
        self.wait_for("/v1/jobs?limit=1000", |status, text| {
            let jobs: Value = serde_json::from_str(text).unwrap_or_default();
            let running = |job: &Value| job["state"] == "enqueued" || job["state"] == "processing";
            status == 200
                && jobs["items"]
                    .as_array()
                    .is_some_and(|jobs| !jobs.iter().any(running))
        });
    }

    /// Keeps a reindex running until told that the round has ended; returns how many were begun.
    pub fn keep_reindexing(&self, ended: &AtomicBool) -> u64 {
        let mut begun = 0;
        while !ended.load(Ordering::Relaxed) {
            if self.gauge("shapelex_jobs_pending") < 1.0 {
                begun += 1;
                assert_eq!(self.reindex(1000 + begun), 202);
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        begun
    }

    /// A number of the service's metrics; 0 where it is not there.
    pub fn gauge(&self, name: &str) -> f64 {
        let Some((_, text)) = self.get("/metrics") else {
            return 0.0;
        };
        text.lines()
            .find_map(|line| line.strip_prefix(name)?.trim().parse().ok())
            .unwrap_or(0.0)
    }

    /// The process's largest resident set, in MB; 0 where the system does not say.
    pub fn peak_memory(&self) -> u64 {
        let status =
            std::fs::read_to_string(format!("/proc/{}/status", self.process.id())).unwrap_or_default();
        status
            .lines()
            .find_map(|line| {
                line.strip_prefix("VmHWM:")?
                    .split_whitespace()
                    .next()?
                    .parse::<u64>()
                    .ok()
            })
            .map_or(0, |kilobytes| kilobytes >> 10)
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A bumpy closed surface of about `side`² vertices, as OBJ.
fn sphere(side: usize) -> Vec<u8> {
    use std::fmt::Write;
    let mut text = String::from("v 0 0 1.1\n");
    for ring in 1..side {
        let polar = std::f64::consts::PI * ring as f64 / side as f64;
        for slice in 0..side {
            let around = std::f64::consts::TAU * slice as f64 / side as f64;
            let r = polar.sin() * (1.0 + 0.3 * (3.0 * around).cos() * polar.sin());
            let _ = writeln!(
                text,
                "v {} {} {}",
                r * around.cos(),
                r * around.sin(),
                1.1 * polar.cos()
            );
        }
    }
    text += "v 0 0 -1.1\n";
    let last = (side - 1) * side + 2;
    let at = |ring: usize, slice: usize| 2 + (ring - 1) * side + slice % side;
    for slice in 0..side {
        let _ = writeln!(text, "f 1 {} {}", at(1, slice), at(1, slice + 1));
        let _ = writeln!(
            text,
            "f {last} {} {}",
            at(side - 1, slice + 1),
            at(side - 1, slice)
        );
        for ring in 1..side - 1 {
            let (a, b) = (at(ring, slice), at(ring + 1, slice));
            let (c, d) = (at(ring + 1, slice + 1), at(ring, slice + 1));
            let _ = writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}");
        }
    }
    text.into_bytes()
}
