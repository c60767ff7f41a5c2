//! `--server https://…`: a service behind TLS, trusted by a certificate of one's own.

use crate::service::Service;
use crate::{run, stderr};
use rcgen::{CertifiedKey, generate_simple_self_signed};
use rustls::pki_types::{PrivateKeyDer, PrivatePkcs8KeyDer};
use rustls::{ServerConfig, ServerConnection, StreamOwned};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::sync::Arc;

/// Answers every request over TLS as a service that is alive and has empty lists; gives its address and its certificate,
/// which is for `names`, as PEM.
fn secure_service(names: &[&str]) -> (String, String) {
    let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    let CertifiedKey { cert, signing_key } = generate_simple_self_signed(names).unwrap();
    let key = PrivateKeyDer::Pkcs8(PrivatePkcs8KeyDer::from(signing_key.serialize_der()));
    let config = ServerConfig::builder_with_provider(Arc::new(rustls::crypto::ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![cert.der().clone()], key)
        .unwrap();
    let config = Arc::new(config);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("https://{}", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let connection = ServerConnection::new(Arc::clone(&config)).unwrap();
            let mut stream = BufReader::new(StreamOwned::new(connection, stream.unwrap()));
            let mut line = String::new();
            // A client that does not trust the certificate leaves here.
            while stream.read_line(&mut line).is_ok_and(|n| n > 2) {
                line.clear();
            }
            let body = "{\"status\":\"ok\",\"items\":[],\"next_cursor\":null}";
            let _ = write!(
                stream.get_mut(),
                "HTTP/1.1 200 OK\r\ncontent-length: {}\r\nconnection: close\r\n\r\n{body}",
                body.len()
            );
            let _ = stream.get_mut().flush();
        }
    });
    (url, cert.pem())
}

#[test]
fn a_service_behind_tls_is_trusted_by_its_own_certificate_only() {
    let dir = tempfile::tempdir().unwrap();
    let (url, pem) = secure_service(&["localhost", "127.0.0.1"]);
    std::fs::write(dir.path().join("ca.pem"), pem).unwrap();
    let trusted = run(dir.path(), &["health", "--server", &url, "--ca-cert", "ca.pem"]);
    assert!(trusted.status.success(), "{}", stderr(&trusted));
    assert_eq!(trusted.stdout, b"alive\n");
    let unknown = run(dir.path(), &["health", "--server", &url]);
    assert_eq!(unknown.status.code(), Some(1));
    let told = stderr(&unknown);
    assert!(told.contains(&url) && told.contains("--ca-cert FILE"), "{told}");
    let plain = run(
        dir.path(),
        &["health", "--server", &url.replace("https:", "http:")],
    );
    assert_eq!(plain.status.code(), Some(1), "{}", stderr(&plain));
    std::fs::write(dir.path().join("none.pem"), "no certificate").unwrap();
    for file in ["none.pem", "missing.pem"] {
        let wrong = run(dir.path(), &["health", "--server", &url, "--ca-cert", file]);
        assert_eq!(wrong.status.code(), Some(2), "{}", stderr(&wrong));
        assert!(stderr(&wrong).contains(file), "{}", stderr(&wrong));
    }
}

#[test]
fn the_service_on_a_data_directory_is_reached_where_its_certificate_names_another_host() {
    let dir = tempfile::tempdir().unwrap();
    let service = Service::start(dir.path(), &["--data", "d"]);
    let (url, _) = secure_service(&["shapes.example"]);
    // What a service that speaks TLS writes.
    let access = serde_json::json!({ "url": url, "token": "slt_x" });
    std::fs::write(dir.path().join("d/local-access.json"), access.to_string()).unwrap();
    for command in ["keys", "snapshot"] {
        let listed = run(dir.path(), &[command, "list", "--data", "d"]);
        assert!(listed.status.success(), "{command}: {}", stderr(&listed));
        assert!(stderr(&listed).contains(&url), "{}", stderr(&listed));
    }
    // An address that is named is checked as ever.
    let named = run(dir.path(), &["keys", "list", "--server", &url]);
    assert_eq!(named.status.code(), Some(1));
    assert!(service.terminate().success());
}
