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
async fn a_head_has_exactly_the_longest_it_may_have() {
    for limit in [1 << 10, 8 << 10, 16 << 10, 32 << 10] {
        let running = start(|c| c.max_header_bytes = limit).await;
        let (begin, end) = (
            "GET /healthz HTTP/1.1\r\nhost: x\r\nconnection: close\r\nx-long: ",
            "\r\n\r\n",
        );
        let head = |length: usize| {
            let filler = "a".repeat(length - begin.len() - end.len());
            format!("{begin}{filler}{end}")
        };
        for (length, status) in [
            (limit - 1, "200"),
            (limit, "200"),
            (limit + 1, "431"),
            (limit + 5000, "431"),
            (limit * 3, "431"),
        ] {
            let head = head(length);
            assert_eq!(head.len(), length);
            let answer = exchange(running.address, &head).await;
            assert!(
                answer.starts_with(&format!("HTTP/1.1 {status}")),
                "{length} of {limit}: {answer}"
            );
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn heads_have_a_number_of_headers_and_addresses_a_longest() {
    let running = start(|_| {}).await;
    for (headers, status) in [(100, "200"), (101, "431")] {
        let more: String = (2..headers).map(|i| format!("x-{i}: 1\r\n")).collect();
        let head = format!("GET /healthz HTTP/1.1\r\nhost: x\r\nconnection: close\r\n{more}\r\n");
        let answer = exchange(running.address, &head).await;
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status}")),
            "{headers}: {answer}"
        );
    }
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

/// A connection from one of the loopback addresses.
async fn from(source: &str, address: SocketAddr) -> TcpStream {
    let socket = tokio::net::TcpSocket::new_v4().unwrap();
    socket.bind(format!("{source}:0").parse().unwrap()).unwrap();
    socket.connect(address).await.unwrap()
}

/// Sends a request on a connection and reads to its end, for at most some seconds.
async fn asked(mut stream: TcpStream, request: &str) -> String {
    let mut answer = Vec::new();
    let exchange = async {
        let _ = stream.write_all(request.as_bytes()).await;
        let _ = stream.read_to_end(&mut answer).await;
    };
    let within = tokio::time::timeout(Duration::from_secs(3), exchange).await;
    assert!(within.is_ok(), "no answer within 3 s");
    String::from_utf8_lossy(&answer).into_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn idle_connections_of_one_address_do_not_keep_others_out() {
    let running = start(|c| {
        c.max_connections = 1024;
        c.header_timeout = Duration::from_secs(60);
    })
    .await;
    let mut held = Vec::new();
    for i in 0..1100 {
        let mut stream = from("127.0.0.1", running.address).await;
        // Silent, in the middle of a head, or idle after an answer.
        let begun = [
            "",
            "GET /healthz HTTP/1.1\r\nx-",
            "GET /healthz HTTP/1.1\r\nhost: x\r\n\r\n",
        ][i % 3];
        stream.write_all(begun.as_bytes()).await.unwrap();
        held.push(stream);
    }
    let began = Instant::now();
    for source in ["127.0.0.2", "127.0.0.1"] {
        let answer = asked(from(source, running.address).await, HEALTH).await;
        assert!(answer.starts_with("HTTP/1.1 200"), "{source}: {answer}");
    }
    assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
    drop(held);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_longest_idle_connection_makes_way_and_a_busy_one_does_not() {
    let running = start(|c| {
        c.max_connections = 2;
        c.max_connections_per_address = Some(2);
        c.header_timeout = Duration::from_secs(60);
    })
    .await;
    let address = running.address;
    // Its body is on its way.
    let mut busy = TcpStream::connect(address).await.unwrap();
    let half = "POST /v1/classes HTTP/1.1\r\nhost: 127.0.0.1\r\nconnection: close\r\ncontent-type: application/json\r\ncontent-length: 14\r\n\r\n";
    busy.write_all(half.as_bytes()).await.unwrap();
    let mut idle = TcpStream::connect(address).await.unwrap();
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert!(
        asked(TcpStream::connect(address).await.unwrap(), HEALTH)
            .await
            .starts_with("HTTP/1.1 200")
    );
    let mut byte = [0; 1];
    assert_eq!(
        idle.read(&mut byte).await.unwrap_or(0),
        0,
        "the idle one has gone"
    );
    let answer = asked(busy, "{\"name\":\"cat\"}").await;
    assert!(answer.starts_with("HTTP/1.1 201"), "{answer}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_address_with_all_its_connections_busy_is_told_and_others_are_served() {
    let running = start(|c| {
        c.max_connections = 8;
        c.max_connections_per_address = Some(2);
    })
    .await;
    let half = "POST /v1/classes HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-type: application/json\r\ncontent-length: 100\r\n\r\n{";
    let mut busy = Vec::new();
    for _ in 0..2 {
        let mut stream = TcpStream::connect(running.address).await.unwrap();
        stream.write_all(half.as_bytes()).await.unwrap();
        busy.push(stream);
    }
    tokio::time::sleep(Duration::from_millis(200)).await;
    let answer = asked(from("127.0.0.1", running.address).await, HEALTH).await;
    assert!(
        answer.starts_with("HTTP/1.1 503") && answer.contains("\"overloaded\""),
        "{answer}"
    );
    assert!(answer.contains("retry-after: "), "{answer}");
    let answer = asked(from("127.0.0.2", running.address).await, HEALTH).await;
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
}

#[tokio::test(flavor = "multi_thread")]
async fn where_all_are_busy_a_connection_waits_for_one_to_end() {
    let running = start(|c| c.max_connections = 1).await;
    let mut holder = TcpStream::connect(running.address).await.unwrap();
    let half = "POST /v1/classes HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-type: application/json\r\ncontent-length: 100\r\n\r\n{";
    holder.write_all(half.as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_millis(200)).await;
    let address = running.address;
    let other = from("127.0.0.2", address).await;
    let waiting = tokio::spawn(asked(other, HEALTH));
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert!(!waiting.is_finished(), "there is one place and it is taken");
    drop(holder);
    assert!(waiting.await.unwrap().starts_with("HTTP/1.1 200"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_names_the_service_once_and_rightly() {
    let running = start(|_| {}).await;
    let port = running.address.port();
    let ask = |line: &str, hosts: &str| format!("GET {line}\r\n{hosts}connection: close\r\n\r\n");
    for (line, hosts, status) in [
        (
            "/v1/classes HTTP/1.1",
            format!("host: 127.0.0.1:{port}\r\n"),
            "200",
        ),
        ("/v1/classes HTTP/1.1", "host: localhost\r\n".to_owned(), "200"),
        ("/v1/classes HTTP/1.1", "host: evil.test\r\n".to_owned(), "421"),
        ("/v1/classes HTTP/1.1", String::new(), "400"),
        ("/v1/classes HTTP/1.0", String::new(), "200"),
        ("/v1/classes HTTP/1.0", "host: evil.test\r\n".to_owned(), "421"),
        (
            "/v1/classes HTTP/1.1",
            "host: localhost\r\nhost: evil.test\r\n".to_owned(),
            "400",
        ),
        (
            "http://evil.test/v1/classes HTTP/1.1",
            "host: localhost\r\n".to_owned(),
            "421",
        ),
        (
            "http://localhost/v1/classes HTTP/1.1",
            "host: evil.test\r\n".to_owned(),
            "421",
        ),
        (
            "http://localhost/v1/classes HTTP/1.1",
            "host: localhost\r\n".to_owned(),
            "200",
        ),
        ("/nowhere HTTP/1.1", "host: evil.test\r\n".to_owned(), "421"),
        ("/readyz HTTP/1.1", "host: 10.1.2.3:80\r\n".to_owned(), "200"),
        ("/healthz HTTP/1.1", "host: pod-7.cluster\r\n".to_owned(), "200"),
    ] {
        let answer = exchange(running.address, &ask(line, &hosts)).await;
        assert!(
            answer.starts_with(&format!("HTTP/1.1 {status}"))
                || answer.starts_with(&format!("HTTP/1.0 {status}")),
            "{line} {hosts}: {answer}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn it_stops_by_its_deadline_whatever_clients_do() {
    let mut running = start(|c| {
        c.header_timeout = Duration::from_secs(60);
        c.shutdown_timeout = Duration::from_secs(1);
    })
    .await;
    let mut idle = TcpStream::connect(running.address).await.unwrap();
    let half = "POST /v1/classes HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-type: application/json\r\ncontent-length: 100\r\n\r\n{";
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
