//! Over real sockets: clients that dribble, hoard and exaggerate, and a service that stops.

use shapelex::http::{AppState, ServiceConfig, serve};
use std::net::SocketAddr;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// A service that listens. Its directory goes with it.
pub struct Running {
    pub address: SocketAddr,
    pub state: AppState,
    stop: Option<oneshot::Sender<()>>,
    served: JoinHandle<()>,
    _directory: tempfile::TempDir,
}

/// Starts one, changed as said, on a free port.
pub async fn start(change: impl FnOnce(&mut ServiceConfig)) -> Running {
    let directory = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let mut config = ServiceConfig {
        data_dir: directory.path().to_owned(),
        listen: address,
        query_threads: 1,
        indexing_threads: 1,
        header_timeout: Duration::from_secs(1),
        ..ServiceConfig::default()
    };
    change(&mut config);
    let state = AppState::open(config).unwrap();
    let (stop, stopped) = oneshot::channel::<()>();
    let shared = state.clone();
    let served = tokio::spawn(async move {
        let shutdown = async {
            let _ = stopped.await;
        };
        serve(state, listener, shutdown).await.unwrap();
    });
    Running {
        address,
        state: shared,
        stop: Some(stop),
        served,
        _directory: directory,
    }
}

/// Sends a request and reads to the connection's end.
async fn exchange(address: SocketAddr, request: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    // A reset after the answer is an end too.
    let _ = stream.read_to_end(&mut answer).await;
    String::from_utf8_lossy(&answer).into_owned()
}

const HEALTH: &str = "GET /healthz HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n";

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_dribbles_is_dropped_while_others_are_served() {
    let running = start(|_| {}).await;
    let address = running.address;
    let dribble = tokio::spawn(async move {
        let began = Instant::now();
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream
            .write_all(b"GET /healthz HTTP/1.1\r\nx-slow: ")
            .await
            .unwrap();
        let mut byte = [0; 1];
        while began.elapsed() < Duration::from_secs(20) {
            let closed = match tokio::time::timeout(Duration::from_millis(100), stream.read(&mut byte)).await
            {
                Ok(Ok(0) | Err(_)) => true,
                // An answer such as 408 before the end.
                Ok(Ok(_)) => continue,
                Err(_) => stream.write_all(b"a").await.is_err(),
            };
            if closed {
                break;
            }
        }
        began.elapsed()
    });
    for _ in 0..5 {
        assert!(exchange(address, HEALTH).await.starts_with("HTTP/1.1 200"));
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let held = dribble.await.unwrap();
    assert!(
        held < Duration::from_secs(5),
        "held for {held:?} with a time limit of 1 s"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn silent_and_idle_connections_are_dropped() {
    let running = start(|_| {}).await;
    for first in ["", HEALTH.trim_end_matches("connection: close\r\n\r\n")] {
        let began = Instant::now();
        let mut stream = TcpStream::connect(running.address).await.unwrap();
        if !first.is_empty() {
            stream.write_all(format!("{first}\r\n").as_bytes()).await.unwrap();
        }
        let mut answer = Vec::new();
        let read = tokio::time::timeout(Duration::from_secs(10), stream.read_to_end(&mut answer)).await;
        assert!(read.is_ok(), "still open after {:?}", began.elapsed());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn heads_and_addresses_have_a_longest() {
    let running = start(|c| c.max_header_bytes = 16 << 10).await;
    let long = "a".repeat(40 << 10);
    let head = format!("GET /healthz HTTP/1.1\r\nhost: x\r\nx-long: {long}\r\n\r\n");
    let answer = exchange(running.address, &head).await;
    assert!(
        answer.is_empty() || answer.starts_with("HTTP/1.1 431"),
        "{answer}"
    );
    let path = "a".repeat(9 << 10);
    let head = format!("GET /healthz?{path} HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n");
    let answer = exchange(running.address, &head).await;
    assert!(
        answer.starts_with("HTTP/1.1 414") && answer.contains("uri_too_long"),
        "{answer}"
    );
    assert!(
        exchange(running.address, HEALTH)
            .await
            .starts_with("HTTP/1.1 200")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_beyond_the_limit_wait_for_one_to_end() {
    let running = start(|c| {
        c.max_connections = 1;
        c.header_timeout = Duration::from_secs(2);
    })
    .await;
    let holder = TcpStream::connect(running.address).await.unwrap();
    tokio::time::sleep(Duration::from_millis(100)).await;
    let address = running.address;
    let waiting = tokio::spawn(async move { exchange(address, HEALTH).await });
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert!(!waiting.is_finished(), "there is one place and it is taken");
    drop(holder);
    assert!(waiting.await.unwrap().starts_with("HTTP/1.1 200"));
}

#[tokio::test(flavor = "multi_thread")]
async fn it_stops_by_its_deadline_whatever_clients_do() {
    let mut running = start(|c| {
        c.header_timeout = Duration::from_secs(60);
        c.shutdown_timeout = Duration::from_secs(1);
    })
    .await;
    let mut idle = TcpStream::connect(running.address).await.unwrap();
    let half = "POST /v1/classes HTTP/1.1\r\nhost: x\r\ncontent-type: application/json\r\ncontent-length: 100\r\n\r\n{";
    idle.write_all(half.as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_millis(200)).await;
    let began = Instant::now();
    running.stop.take().unwrap().send(()).unwrap();
    running.served.await.unwrap();
    assert!(began.elapsed() < Duration::from_secs(8), "{:?}", began.elapsed());
    assert!(
        TcpStream::connect(running.address).await.is_err(),
        "it still listens"
    );
}

#[cfg(not(feature = "tls"))]
#[tokio::test(flavor = "multi_thread")]
async fn tls_needs_a_build_that_has_it() {
    let directory = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let state = AppState::open(ServiceConfig {
        data_dir: directory.path().to_owned(),
        tls_cert: Some("cert.pem".into()),
        tls_key: Some("key.pem".into()),
        ..ServiceConfig::default()
    })
    .unwrap();
    let refused = serve(state, listener, std::future::pending()).await.unwrap_err();
    assert!(refused.to_string().contains("--features tls"), "{refused}");
}
