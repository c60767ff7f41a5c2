//! What hostile and careless clients do.

use crate::{files, meshes};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

const FORM: &str = "multipart/form-data; boundary=xyz";
const MIB: usize = 1 << 20;

/// The service that is attacked.
pub struct Target {
    pub address: String,
    pub connections: usize,
    pub memory_mib: u64,
}

/// Attacks, and says how it was answered. The round counts how often it was done before.
type Attack = fn(&Target, usize) -> String;

pub const ATTACKS: [(&str, Attack); 11] = [
    ("bodies held open", held_open),
    ("archives that unpack to much", bombs),
    ("small bodies that dribble", dribble),
    ("files of many spellings", spellings),
    ("heads of parts", heads),
    ("long texts", long_texts),
    ("unread batch lines", unread_lines),
    ("unread answers", unread),
    ("the largest parameters", largest_parameters),
    ("everything at once", mixed),
    ("an honest client", honest),
];

impl Target {
    fn open(&self, path: &str, media_type: &str, bytes: usize) -> std::io::Result<TcpStream> {
        let mut stream = TcpStream::connect(&self.address)?;
        stream.set_read_timeout(Some(Duration::from_secs(90)))?;
        stream.set_write_timeout(Some(Duration::from_secs(10)))?;
        let head = format!(
            "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {media_type}\r\ncontent-length: {bytes}\r\n\
             connection: close\r\n\r\n"
        );
        stream.write_all(head.as_bytes())?;
        Ok(stream)
    }

    /// Sends a request and reads the answer: its status and body; 0 where the connection broke.
    fn post(&self, path: &str, media_type: &str, body: &[u8]) -> (u16, Value) {
        let exchange = || -> std::io::Result<Vec<u8>> {
            let mut stream = self.open(path, media_type, body.len())?;
            // A refusal may come before all is sent.
            let _ = stream.write_all(body);
            read_to_end(&mut stream)
        };
        parse(&exchange().unwrap_or_default())
    }

    fn get(&self, path: &str) -> Value {
        let exchange = || -> std::io::Result<Vec<u8>> {
            let mut stream = TcpStream::connect(&self.address)?;
            stream.set_read_timeout(Some(Duration::from_secs(30)))?;
            write!(
                stream,
                "GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n"
            )?;
            read_to_end(&mut stream)
        };
        parse(&exchange().unwrap_or_default()).1
    }

    /// Two classes of two shapes, learnt.
    pub fn teach(&self) {
        for class in ["bean", "ring"] {
            for pose in 0..2 {
                let path = format!("/v1/classes/{class}/shapes?create=true&name={pose}.off");
                let mesh = if class == "bean" {
                    meshes::off("bean", pose)
                } else {
                    meshes::off(meshes::CLASSES[1], pose)
                };
                self.insist(|| {
                    let (status, answer) = self.post(&path, "model/off", &mesh);
                    (status == 201 || status == 200).then_some(()).ok_or(answer)
                });
            }
        }
        let small = json!({"parameters": {
            "eigenpairs": 50, "part_eigenpairs": 50, "energies": 40, "atoms": 12, "iterations": 5, "batch": 64,
            "samples_per_shape": 100
        }});
        self.insist(|| {
            let job = self.reindex(&small);
            (job["state"] == "succeeded").then_some(()).ok_or(job)
        });
    }

    /// Tries until it is done, as a client does that is told to come back, for at most a minute.
    fn insist(&self, attempt: impl Fn() -> Result<(), Value>) {
        let began = Instant::now();
        while let Err(answer) = attempt() {
            assert!(began.elapsed() < Duration::from_secs(60), "{answer}");
            std::thread::sleep(Duration::from_millis(300));
        }
    }

    /// Reindexes and waits for the end.
    fn reindex(&self, body: &Value) -> Value {
        let (status, job) = self.post("/v1/reindex", "application/json", body.to_string().as_bytes());
        if status != 202 {
            return job;
        }
        let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap_or_default());
        let began = Instant::now();
        loop {
            let job = self.get(&path);
            if job["state"] != "enqueued" && job["state"] != "processing" {
                return job;
            }
            if began.elapsed() > Duration::from_secs(30) {
                self.post(&format!("{path}/cancel"), "application/json", b"");
            }
            assert!(began.elapsed() < Duration::from_secs(120), "stuck: {job}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// After all of it, a query is answered.
    pub fn answers_again(&self) {
        self.insist(|| {
            let (status, answer) = self.post("/v1/query", "model/off", &meshes::off("bean", 5));
            (status == 200).then_some(()).ok_or(answer)
        });
    }
}

fn read_to_end(stream: &mut TcpStream) -> std::io::Result<Vec<u8>> {
    let mut answer = Vec::new();
    match stream.read_to_end(&mut answer) {
        // A reset after the answer is an end too.
        Err(error) if answer.is_empty() => Err(error),
        _ => Ok(answer),
    }
}

fn parse(answer: &[u8]) -> (u16, Value) {
    let text = String::from_utf8_lossy(answer);
    let status = text.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0);
    let body = text.split_once("\r\n\r\n").map_or("", |(_, body)| body);
    (status, serde_json::from_str(body).unwrap_or_default())
}

/// How often each answer came.
fn tally(answers: impl IntoIterator<Item = (u16, Value)>) -> String {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for (status, body) in answers {
        let code = body["code"].as_str().unwrap_or("");
        *counts.entry(format!("{status} {code}")).or_default() += 1;
    }
    counts.iter().fold(String::new(), |mut text, (answer, count)| {
        let _ = write!(text, "{count} × {answer}; ");
        text
    })
}

/// Does something on as many threads, and tallies the answers.
fn at_once(clients: usize, attack: impl Fn(usize) -> (u16, Value) + Sync) -> String {
    let answers = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..clients)
            .map(|i| {
                scope.spawn({
                    let attack = &attack;
                    move || attack(i)
                })
            })
            .collect();
        threads.into_iter().map(|t| t.join().unwrap()).collect::<Vec<_>>()
    });
    tally(answers)
}

/// Many bodies of which a part arrives; then all leave.
fn held_open(target: &Target, _: usize) -> String {
    let piece = vec![b'a'; MIB];
    let mut held: Vec<TcpStream> = Vec::new();
    for _ in 0..target.connections {
        held.extend(target.open("/v1/query", "model/obj", 60 * MIB).ok());
    }
    let mut broken = 0;
    for _ in 0..12 {
        let before = held.len();
        held.retain_mut(|stream| {
            // Sending goes on while there is room; a refusal ends it.
            stream.set_write_timeout(Some(Duration::from_millis(20))).is_ok() && sends(stream, &piece)
        });
        broken += before - held.len();
    }
    std::thread::sleep(Duration::from_millis(500));
    format!("{} still open, {broken} refused", held.len())
}

fn sends(stream: &mut TcpStream, piece: &[u8]) -> bool {
    match stream.write(piece) {
        Ok(sent) => sent > 0,
        Err(error) => error.kind() == std::io::ErrorKind::WouldBlock,
    }
}

fn bombs(target: &Target, round: usize) -> String {
    let bytes = (target.memory_mib as usize * MIB / 3).min(250 * MIB);
    let zip = files::zip_bomb(bytes);
    let gzip = files::gzip_bomb(bytes);
    let form = files::form("bomb.zip", &zip);
    at_once(24, |i| match (i + round) % 3 {
        0 => target.post("/v1/query", "application/zip", &zip),
        1 => target.post("/v1/query/batch", "application/gzip", &gzip),
        _ => target.post("/v1/classes/bean/shapes", FORM, &form),
    })
}

/// Every connection holds a little.
fn dribble(target: &Target, _: usize) -> String {
    let mut held: Vec<TcpStream> = Vec::new();
    for i in 0..target.connections {
        held.extend(match i % 3 {
            0 => target.open("/v1/classes", "application/json", 200 << 10),
            1 => target.open("/v1/query", FORM, MIB),
            _ => target.open("/v1/query", "model/obj", MIB),
        });
    }
    for _ in 0..10 {
        held.retain_mut(|stream| stream.write_all(&[b'-'; 16 << 10]).is_ok());
    }
    std::thread::sleep(Duration::from_millis(300));
    format!("{} still open", held.len())
}

fn spellings(target: &Target, _: usize) -> String {
    // A part of what fits, so that reading begins.
    let bytes = (target.memory_mib as usize * MIB / 12).min(40 * MIB);
    let all = [
        ("model/obj", files::long_line(bytes)),
        ("model/obj", files::short_lines(bytes)),
        ("application/octet-stream", files::off_of_digits(bytes)),
        ("model/gltf+json", files::gltf_of_base64(bytes, 1)),
        ("model/gltf+json", files::gltf_of_base64(bytes / 8, 20)),
        ("model/gltf+json", files::gltf_of_zeros(1_500_000, 0)),
        ("model/gltf+json", files::gltf_of_zeros(500_000, 60)),
        ("model/gltf+json", files::gltf_of_objects(bytes)),
    ];
    at_once(2 * all.len(), |i| {
        let (media_type, body) = &all[i % all.len()];
        target.post("/v1/query", media_type, body)
    })
}

fn heads(target: &Target, _: usize) -> String {
    at_once(24, |i| {
        let start = match i % 3 {
            0 => "--xyz\r\nx-long: ",
            1 => "",
            _ => "--xyz",
        };
        let mut body = start.as_bytes().to_vec();
        body.resize(30 * MIB, if i % 3 == 2 { b' ' } else { b'a' });
        target.post("/v1/query", FORM, &body)
    })
}

/// Texts of files that a careless reader repeats: in a problem, in the label of each pose, in the record of each.
fn long_texts(target: &Target, _: usize) -> String {
    let bytes = (target.memory_mib as usize * MIB / 6).min(60 * MIB);
    let queries = [
        files::gltf_of_wrong_types(bytes),
        files::gltf_of_a_wrong_scene(bytes),
        files::gltf_of_an_extension(bytes),
    ];
    let uploads = [
        files::form("poses.gltf", &files::gltf_of_poses(bytes / 8, 0)),
        files::form_of(&[("a.gltf", &files::gltf_of_poses(10, 2000)), ("x.bin", b"x")]),
    ];
    at_once(2 * (queries.len() + uploads.len()), |i| match i % 5 {
        0..3 => target.post("/v1/query", "model/gltf+json", &queries[i % 5]),
        other => target.post("/v1/classes/bean/shapes?poses=64", FORM, &uploads[other - 3]),
    })
}

/// Batches whose answers are long, of clients that read none of them.
fn unread_lines(target: &Target, _: usize) -> String {
    let mesh = meshes::off("bean", 1);
    let names: Vec<String> = (0..40).map(|i| format!("{i}.off")).collect();
    let zip = files::zip(names.iter().map(|name| (name.as_str(), mesh.as_ref())));
    let mut held = Vec::new();
    for _ in 0..target.connections.min(200) {
        let opened = target.open("/v1/query/batch?details=samples", "application/zip", zip.len());
        held.extend(opened.ok().filter(|mut stream| stream.write_all(&zip).is_ok()));
    }
    std::thread::sleep(Duration::from_secs(3));
    format!("{} connections", held.len())
}

/// Asks for large answers and reads none of them.
fn unread(target: &Target, _: usize) -> String {
    let mut held = Vec::new();
    for _ in 0..target.connections {
        let Ok(mut stream) = TcpStream::connect(&target.address) else {
            continue;
        };
        // Several on one connection: the first fills the buffers on the way.
        for path in ["/openapi.json", "/openapi.yaml", "/docs", "/metrics"] {
            let _ = write!(stream, "GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n");
        }
        held.push(stream);
    }
    std::thread::sleep(Duration::from_millis(500));
    format!("{} connections", held.len())
}

fn largest_parameters(target: &Target, _: usize) -> String {
    let mut told = String::new();
    for parameters in [
        json!({"eigenpairs": 1000, "part_eigenpairs": 1000, "energies": 2000, "atoms": 5000, "iterations": 10000,
               "batch": 100_000, "samples_per_shape": 0, "working_size": 0, "refine_below": 200_000,
               "hypotheses": ["plain", "whitened", "doubled"]}),
        json!({"energies": 2000, "atoms": 5000, "iterations": 10000, "batch": 100_000, "samples_per_shape": 0,
               "refine_below": 0, "per_shape": true}),
        json!({"eigenpairs": 400, "part_eigenpairs": 400, "refine_below": 8000, "working_size": 20_000}),
    ] {
        let job = target.reindex(&json!({"scope": "all", "parameters": parameters}));
        let failure = job["failure"]["code"].as_str().unwrap_or("");
        let _ = write!(told, "{} {failure}; ", job["state"].as_str().unwrap_or("refused"));
    }
    target.teach();
    told
}

/// All of it, each on threads of its own.
fn mixed(target: &Target, round: usize) -> String {
    let share = Target {
        address: target.address.clone(),
        connections: target.connections / 4,
        memory_mib: target.memory_mib,
    };
    let share = &share;
    std::thread::scope(|scope| {
        for attack in [
            held_open,
            dribble,
            unread,
            bombs,
            spellings,
            heads,
            largest_parameters,
        ] {
            scope.spawn(move || attack(share, round));
        }
    });
    "done".to_owned()
}

/// Who waits as long as a refusal says is served.
fn honest(target: &Target, _: usize) -> String {
    target.answers_again();
    "answered".to_owned()
}
