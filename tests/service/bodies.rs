//! Bodies over real sockets: what they hold, how long they may take, and what their senders read in the end.

use crate::connections::{Running, start};
use crate::meshes::off;
use serde_json::Value;
use std::net::SocketAddr;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

/// Opens a request with a body of so many bytes, none of which is sent.
async fn open(address: SocketAddr, path: &str, media_type: &str, bytes: usize) -> TcpStream {
    open_as("nobody", address, path, media_type, bytes).await
}

/// The same with a secret: the local token is for what only the data directory's owner may do.
async fn open_as(secret: &str, address: SocketAddr, path: &str, media_type: &str, bytes: usize) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let head = format!(
        "POST {path} HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {secret}\r\n\
         content-type: {media_type}\r\ncontent-length: {bytes}\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    stream
}

/// The head of an answer and its body.
struct Answer {
    head: String,
    body: Value,
}

impl Answer {
    #[track_caller]
    fn fails(&self, status: u16, code: &str) {
        let expected = format!("HTTP/1.1 {status} ");
        assert!(self.head.starts_with(&expected), "{}\n{}", self.head, self.body);
        assert_eq!(self.body["code"], code, "{}", self.body);
    }
}

/// Reads one answer.
async fn read(stream: &mut TcpStream) -> Answer {
    let mut bytes = Vec::new();
    loop {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        if let Some((head, body)) = text.split_once("\r\n\r\n") {
            let head = head.to_ascii_lowercase().replace("http/1.1", "HTTP/1.1");
            let length = head
                .lines()
                .find_map(|line| line.strip_prefix("content-length: "))
                .map_or(0, |length| length.parse::<usize>().unwrap());
            if body.len() >= length {
                let body = serde_json::from_str(&body[..length]).unwrap_or(Value::Null);
                return Answer { head, body };
            }
        }
        let read = timeout(Duration::from_secs(30), stream.read_buf(&mut bytes)).await;
        let read = read.expect("an answer in time");
        assert!(
            read.is_ok_and(|n| n > 0),
            "the connection broke after: {}",
            String::from_utf8_lossy(&bytes)
        );
    }
}

async fn get(address: SocketAddr, path: &str) -> Answer {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let head = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n");
    stream.write_all(head.as_bytes()).await.unwrap();
    read(&mut stream).await
}

/// Sends a whole body before it reads the answer, as simple clients do.
async fn post(address: SocketAddr, path: &str, media_type: &str, body: &[u8]) -> Answer {
    let mut stream = open(address, path, media_type, body.len()).await;
    stream.write_all(body).await.unwrap();
    read(&mut stream).await
}

const FORM: &str = "multipart/form-data; boundary=xyz";
const CLASS: &str = "/v1/classes/bean/shapes?create=true";

/// How long `/healthz` takes, while `work` goes on.
async fn health_during<T>(address: SocketAddr, work: impl Future<Output = T>) -> (T, Vec<Duration>) {
    let mut took = Vec::new();
    let probe = async {
        loop {
            let began = Instant::now();
            assert!(get(address, "/healthz").await.head.starts_with("HTTP/1.1 200"));
            took.push(began.elapsed());
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    let done = tokio::select! {
        done = work => done,
        () = probe => unreachable!("it never ends"),
    };
    took.sort_unstable();
    (done, took)
}

/// Sends pieces of a body until the answer is there; says how long that took.
async fn pour(address: SocketAddr, start: &[u8], piece: &[u8], total: usize) -> (Answer, Duration) {
    let stream = open(address, CLASS, FORM, total).await;
    let (mut reader, mut writer) = stream.into_split();
    let began = Instant::now();
    let (start, piece) = (start.to_vec(), piece.to_vec());
    let writing = tokio::spawn(async move {
        let mut sent = start.len();
        writer.write_all(&start).await.ok();
        while sent + piece.len() <= total && writer.write_all(&piece).await.is_ok() {
            sent += piece.len();
        }
        writer
    });
    let mut bytes = Vec::new();
    let answered = async {
        while !bytes.windows(4).any(|w| w == b"\r\n\r\n") {
            assert!(
                reader.read_buf(&mut bytes).await.is_ok_and(|n| n > 0),
                "no answer"
            );
        }
        began.elapsed()
    };
    let took = timeout(Duration::from_secs(60), answered)
        .await
        .expect("an answer in time");
    let writer = writing.await.unwrap();
    let mut stream = reader.reunite(writer).unwrap();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").unwrap();
    let mut body = body.as_bytes().to_vec();
    while serde_json::from_slice::<Value>(&body).is_err() {
        let read = timeout(Duration::from_secs(5), stream.read_buf(&mut body)).await;
        assert!(read.expect("in time").is_ok_and(|n| n > 0), "cut short: {text}");
    }
    let answer = Answer {
        head: head.to_owned(),
        body: serde_json::from_slice(&body).unwrap(),
    };
    (answer, took)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_stands_before_a_part_is_bounded_and_costs_others_nothing() {
    let running = start(|_| {}).await;
    let address = running.address;
    let total = 100 << 20;
    let fill = vec![b'a'; 64 << 10];
    let spaces = vec![b' '; 64 << 10];
    let lines = b"x-line: a\r\n".repeat(6000);
    let head = "--xyz\r\ncontent-disposition: form-data; name=\"file\"; filename=\"a.off\"\r\n";
    let long = format!("{head}x-long: ");
    let cases: [(&str, &[u8], &[u8]); 5] = [
        ("a header", long.as_bytes(), &fill),
        ("many headers", head.as_bytes(), &lines),
        ("a preamble", b"", &fill),
        ("padding of a boundary", b"--xyz", &spaces),
        ("a boundary that is none", b"--xy", &fill),
    ];
    for (what, start, piece) in cases {
        let poured = pour(address, start, piece, total);
        let ((answer, took), health) = health_during(address, poured).await;
        answer.fails(400, "invalid_multipart");
        let median = health.get(health.len() / 2).copied().unwrap_or_default();
        println!("{what}: {took:?}, {} probes, median {median:?}", health.len());
        assert!(took < Duration::from_secs(1), "{what}: {took:?}");
        assert!(median < Duration::from_millis(50), "{what}: {median:?}");
    }
    assert_eq!(running.state.memory.used(), 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_form_is_parsed_in_time_linear_in_its_length_however_it_is_cut() {
    let running = start(|c| c.max_body_bytes = 64 << 20).await;
    let address = running.address;
    // Line ends everywhere: each may be where the part ends.
    let head = "--xyz\r\ncontent-disposition: form-data; name=\"file\"; filename=\"a.bin\"\r\n\r\n";
    let total = 48 << 20;
    let poured = async {
        let mut stream = open(address, CLASS, FORM, total).await;
        stream.write_all(head.as_bytes()).await.unwrap();
        let piece = b"\r\n--xy".repeat(1 << 12);
        let mut sent = head.len();
        while sent + piece.len() + 10 < total {
            stream.write_all(&piece).await.unwrap();
            sent += piece.len();
        }
        let end = format!("{}\r\n--xyz--\r\n", "a".repeat(total - sent - 11));
        stream.write_all(end.as_bytes()).await.unwrap();
        read(&mut stream).await
    };
    let began = Instant::now();
    let (answer, health) = health_during(address, poured).await;
    // A buffer without a mesh.
    answer.fails(400, "no_files");
    let median = health[health.len() / 2];
    println!(
        "48 MiB of line ends: {:?}, median probe {median:?}",
        began.elapsed()
    );
    assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
    assert!(median < Duration::from_millis(50), "{median:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn who_sends_it_all_before_reading_still_reads_the_refusal() {
    let running = start(|c| {
        c.max_body_bytes = 1 << 20;
        c.memory_bytes = 1 << 20;
    })
    .await;
    let large = vec![b'a'; 16 << 20];
    post(running.address, CLASS, "model/off", &large)
        .await
        .fails(413, "body_too_large");
    // Within the limit of bodies, beyond the memory there is for them.
    post(running.address, CLASS, "model/off", &large[..700 << 10])
        .await
        .fails(413, "body_too_large");
    post(running.address, "/v1/query", "model/off", &large[..700 << 10])
        .await
        .fails(409, "index_empty");
    post(running.address, "/v1/classes", "application/json", &large)
        .await
        .fails(413, "body_too_large");
    assert_eq!(running.state.memory.used(), 0);
}

/// Sends so many bytes of a body of as many more and keeps it open.
async fn hold(running: &Running, bytes: usize) -> TcpStream {
    let mut stream = open(running.address, CLASS, "model/off", 2 * bytes).await;
    stream.write_all(&vec![b'a'; bytes]).await.unwrap();
    stream
}

async fn eventually(what: impl Fn() -> bool) {
    let began = Instant::now();
    while !what() {
        assert!(began.elapsed() < Duration::from_secs(10), "not yet");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bodies_count_as_they_arrive_and_leave_room_for_small_ones_and_for_computing() {
    const MIB: usize = 1 << 20;
    let running = start(|c| {
        c.memory_bytes = 64 << 20;
        c.max_body_bytes = 30 << 20;
    })
    .await;
    let memory = &running.state.memory;
    // What is only declared takes nothing.
    let mut idle = Vec::new();
    for _ in 0..40 {
        idle.push(open(running.address, CLASS, "model/off", 30 * MIB).await);
    }
    let held = [hold(&running, 13 * MIB).await, hold(&running, 13 * MIB).await];
    eventually(|| memory.bodies() >= 26 * MIB as u64).await;
    assert!(memory.bodies() <= 29 * MIB as u64, "{}", memory.bodies());

    let large = vec![b'a'; 6 * MIB];
    let refused = post(running.address, CLASS, "model/off", &large).await;
    refused.fails(503, "overloaded");
    assert!(refused.head.contains("\r\nretry-after: 2"), "{}", refused.head);
    let small = post(running.address, CLASS, "model/off", &off("bean", 0)).await;
    assert!(
        small.head.starts_with("HTTP/1.1 201"),
        "{}\n{}",
        small.head,
        small.body
    );
    assert!(
        get(running.address, "/v1/classes")
            .await
            .head
            .starts_with("HTTP/1.1 200")
    );

    drop((held, idle));
    eventually(|| memory.used() == 0).await;
    let late = post(running.address, CLASS, "model/off", &large).await;
    assert!(
        late.head.starts_with("HTTP/1.1 4"),
        "it has its turn now: {}",
        late.head
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn every_body_has_a_time_limit_however_it_dribbles() {
    let running = start(|c| c.upload_timeout = Duration::from_secs(1)).await;
    for (path, media_type) in [
        (CLASS, "model/off"),
        (CLASS, FORM),
        ("/v1/snapshots/restore", "application/zstd"),
    ] {
        let began = Instant::now();
        let secret = running.state.local_token.secret();
        let stream = open_as(secret, running.address, path, media_type, 1000).await;
        let (mut reader, mut writer) = stream.into_split();
        let dribble = tokio::spawn(async move {
            for _ in 0..100 {
                if writer.write_all(b"-").await.is_err() {
                    break;
                }
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        });
        let mut bytes = Vec::new();
        let first = timeout(Duration::from_secs(8), reader.read_buf(&mut bytes)).await;
        first.expect("an answer in time").unwrap();
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.starts_with("HTTP/1.1 408"), "{path} {media_type}: {text}");
        assert!(
            began.elapsed() < Duration::from_secs(3),
            "{path}: {:?}",
            began.elapsed()
        );
        dribble.abort();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_known_without_a_body_is_said_without_it() {
    let running = start(|_| {}).await;
    for (path, status, code) in [
        ("/v1/query", 409, "index_empty"),
        ("/v1/query/batch", 409, "index_empty"),
        ("/v1/classes/nobody/shapes", 404, "class_not_found"),
        (
            "/v1/classes/bean/shapes?create=true&poses=0",
            400,
            "invalid_query",
        ),
        ("/v1/nowhere", 404, "route_not_found"),
    ] {
        // The body never comes.
        let mut stream = open(running.address, path, "application/zip", 1 << 20).await;
        read(&mut stream).await.fails(status, code);
    }
    let free = running.state.unpacking.running();
    assert_eq!(free, 0, "nothing was unpacked");
}
