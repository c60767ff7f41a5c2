//! What the clients do: each kind is a thread that does one thing after the other, with a pause between.

use crate::process::Process;
use serde_json::{Value, json};
use shapelex_eval::sample::{ZooOptions, creatures, species, write_glb, write_obj};
use std::io::{Cursor, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::Scope;
use std::time::{Duration, Instant};

const CLASSES: usize = 6;
/// Poses that are learnt from; the others are asked with.
const LEARNT: usize = 3;
const POSES: usize = 6;
/// Classes that come and go beside them.
const PASSING: usize = 8;

/// Meshes, made once.
pub struct Material {
    /// Class, pose, OBJ.
    meshes: Vec<(String, usize, Vec<u8>)>,
    glb: Vec<u8>,
    scan: Vec<u8>,
    zip: Vec<u8>,
    bomb: Vec<u8>,
}

impl Material {
    pub fn new() -> Self {
        let options = ZooOptions::default();
        let kinds = species(1, CLASSES);
        let all: Vec<_> = creatures(&kinds, POSES, 1, &options)
            .map(|creature| creature.expect("a creature"))
            .collect();
        let meshes: Vec<_> = all
            .iter()
            .map(|c| (c.class.clone(), c.pose, write_obj(&c.mesh)))
            .collect();
        let files: Vec<(String, &[u8])> = meshes
            .iter()
            .filter(|(_, pose, _)| *pose >= LEARNT)
            .take(4)
            .enumerate()
            .map(|(i, (.., bytes))| (format!("{i}.obj"), bytes.as_slice()))
            .collect();
        let zeros = vec![b' '; 200 << 20];
        Self {
            glb: write_glb(&all[0].mesh),
            scan: scan(200),
            zip: zip_of(&files),
            bomb: zip_of(&[("bomb.obj".to_owned(), &zeros)]),
            meshes,
        }
    }

    fn unseen(&self, turn: usize) -> &[u8] {
        let unseen: Vec<_> = self
            .meshes
            .iter()
            .filter(|(_, pose, _)| *pose >= LEARNT)
            .collect();
        &unseen[turn % unseen.len()].2
    }
}

fn zip_of(files: &[(String, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        writer
            .start_file(name.as_str(), zip::write::SimpleFileOptions::default())
            .expect("started");
        writer.write_all(bytes).expect("written");
    }
    writer.finish().expect("finished").into_inner()
}

/// A grid of `side`² vertices with bumps, as OBJ.
fn scan(side: usize) -> Vec<u8> {
    let mut text = String::new();
    for i in 0..side * side {
        let (x, y) = ((i % side) as f64, (i / side) as f64);
        let z = 8.0 * (0.07 * x).sin() * (0.05 * y).cos();
        text += &format!("v {x} {y} {z}\n");
    }
    for i in 0..side - 1 {
        for j in 0..side - 1 {
            let a = i * side + j + 1;
            text += &format!("f {a} {} {}\n", a + 1, a + side + 1);
            text += &format!("f {a} {} {}\n", a + side + 1, a + side);
        }
    }
    text.into_bytes()
}

/// How often each kind was done, and how it was answered.
#[derive(Default)]
pub struct Counts {
    queries: AtomicUsize,
    uploads: AtomicUsize,
    reindexes: AtomicUsize,
    snapshots: AtomicUsize,
    misbehaved: AtomicUsize,
    refused: AtomicUsize,
    failed: AtomicUsize,
}

impl Counts {
    pub const COLUMNS: &str = "queries,uploads,reindexes,snapshots,misbehaved,refused,failed";

    pub fn row(&self) -> String {
        let all = [
            &self.queries,
            &self.uploads,
            &self.reindexes,
            &self.snapshots,
            &self.misbehaved,
            &self.refused,
            &self.failed,
        ];
        all.map(|count| count.load(Ordering::Relaxed).to_string())
            .join(",")
    }
}

struct Client<'a> {
    process: &'a Process,
    agent: ureq::Agent,
    counts: &'a Counts,
}

impl<'a> Client<'a> {
    fn new(process: &'a Process, counts: &'a Counts) -> Self {
        Self {
            process,
            agent: process.agent(),
            counts,
        }
    }

    fn send(&self, method: &str, path: &str, media_type: &str, body: &[u8]) -> (u16, Value) {
        let request = ureq::http::Request::builder()
            .method(method)
            .uri(format!("http://{}{path}", self.process.address()))
            .header("content-type", media_type)
            .body(body)
            .expect("a request");
        let answer = self.agent.run(request).ok().and_then(|mut answer| {
            let status = answer.status().as_u16();
            let body = answer
                .body_mut()
                .with_config()
                .limit(1 << 30)
                .read_to_vec()
                .ok()?;
            Some((status, serde_json::from_slice(&body).unwrap_or_default()))
        });
        let (status, body) = answer.unwrap_or_default();
        match status {
            0 | 500 => self.counts.failed.fetch_add(1, Ordering::Relaxed),
            503 | 413 => self.counts.refused.fetch_add(1, Ordering::Relaxed),
            _ => 0,
        };
        (status, body)
    }

    /// Sends a body that is declared longer, and leaves.
    fn leave(&self, path: &str, media_type: &str, body: &[u8]) {
        let Ok(mut stream) = TcpStream::connect(self.process.address()) else {
            return;
        };
        let head = format!(
            "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {media_type}\r\ncontent-length: {}\r\n\r\n",
            64 << 20
        );
        let _ = stream.write_all(head.as_bytes());
        let _ = stream.write_all(body);
        let _ = stream.set_read_timeout(Some(Duration::from_millis(200)));
        let _ = stream.read(&mut [0; 512]);
    }
}

/// Teaches the classes and waits until they are learnt.
pub fn teach(process: &Process, material: &Material) {
    let counts = Counts::default();
    let client = Client::new(process, &counts);
    for (class, pose, bytes) in material.meshes.iter().filter(|(_, pose, _)| *pose < LEARNT) {
        let path = format!("/v1/classes/{class}/shapes?create=true&name={pose}.obj");
        let (status, body) = client.send("POST", &path, "model/obj", bytes);
        assert_eq!(status, 201, "{body}");
    }
    reindex(&client, "all");
}

fn reindex(client: &Client<'_>, scope: &str) {
    let body = json!({ "scope": scope }).to_string();
    let (status, job) = client.send("POST", "/v1/reindex", "application/json", body.as_bytes());
    let began = Instant::now();
    while status == 202 && began.elapsed() < Duration::from_secs(600) {
        std::thread::sleep(Duration::from_millis(200));
        let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap_or_default());
        let (_, job) = client.send("GET", &path, "", b"");
        if job["state"] != "enqueued" && job["state"] != "processing" {
            return;
        }
    }
}

/// Starts all kinds of clients; they end soon after `ended` is set.
pub fn start<'s>(
    scope: &'s Scope<'s, '_>,
    process: &'s Process,
    material: &'s Material,
    counts: &'s Counts,
    ended: &'s AtomicBool,
    slower: f64,
) {
    // A kind of client and the seconds between two of its turns.
    type Kind = (f64, fn(&Client<'_>, &Material, usize));
    let kinds: [Kind; 6] = [
        (0.5, query),
        (0.7, query),
        (5.0, upload),
        (60.0, learn),
        (300.0, snapshot),
        (7.0, misbehave),
    ];
    for (pause, turn) in kinds {
        scope.spawn(move || {
            let client = Client::new(process, counts);
            for count in 0.. {
                turn(&client, material, count);
                let until = Instant::now() + Duration::from_secs_f64(pause * slower);
                while Instant::now() < until {
                    if ended.load(Ordering::Relaxed) {
                        return;
                    }
                    std::thread::sleep(Duration::from_millis(100));
                }
            }
        });
    }
}

fn query(client: &Client<'_>, material: &Material, turn: usize) {
    match turn % 20 {
        7 => client.send("POST", "/v1/query/batch", "application/zip", &material.zip),
        11 => client.send("POST", "/v1/query", "model/obj", &material.scan),
        13 => client.send("POST", "/v1/query", "model/gltf-binary", &material.glb),
        17 => client.send("GET", "/v1/classes?limit=100", "", b""),
        19 => client.send("GET", "/metrics", "", b""),
        _ => client.send("POST", "/v1/query?top=3", "model/obj", material.unseen(turn)),
    };
    client.counts.queries.fetch_add(1, Ordering::Relaxed);
}

/// Makes a class of four shapes and deletes one that was made before.
fn upload(client: &Client<'_>, material: &Material, turn: usize) {
    let path = format!("/v1/classes/passing-{turn}/shapes?create=true");
    client.send("POST", &path, "application/zip", &material.zip);
    if let Some(old) = turn.checked_sub(PASSING) {
        client.send("DELETE", &format!("/v1/classes/passing-{old}"), "", b"");
    }
    client.counts.uploads.fetch_add(1, Ordering::Relaxed);
}

fn learn(client: &Client<'_>, _: &Material, turn: usize) {
    reindex(client, if turn % 10 == 9 { "all" } else { "stale" });
    client.counts.reindexes.fetch_add(1, Ordering::Relaxed);
}

/// Makes a snapshot and removes it.
fn snapshot(client: &Client<'_>, _: &Material, _: usize) {
    let (_, made) = client.send("POST", "/v1/snapshots", "", b"");
    let id = made["id"].as_str().unwrap_or_default();
    client.send("DELETE", &format!("/v1/snapshots/{id}"), "", b"");
    client.counts.snapshots.fetch_add(1, Ordering::Relaxed);
}

fn misbehave(client: &Client<'_>, material: &Material, turn: usize) {
    let form = "multipart/form-data; boundary=xyz";
    match turn % 5 {
        0 => client.leave("/v1/query", "model/obj", &material.scan),
        1 => client.leave("/v1/query", form, &vec![b'a'; 1 << 20]),
        2 => {
            client.send("POST", "/v1/query", "application/zip", &material.bomb);
        }
        3 => {
            client.send("POST", "/v1/query", "model/obj", b"v 0 0 0\nf 1 2 3\n");
        }
        _ => client.leave("/v1/classes", "application/json", b"{"),
    }
    client.counts.misbehaved.fetch_add(1, Ordering::Relaxed);
}
