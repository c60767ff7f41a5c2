//! The owner of a data directory at a service that runs on it, and what others see of it.

use crate::service::Service;
use crate::{answer, last_json, run, shapelex, stderr};
use std::path::Path;
use std::process::{Command, Stdio};

#[test]
fn the_owner_makes_the_first_key_while_the_service_runs() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    let service = Service::start(path, &["--data", "d"]);
    let stranger = run(
        path,
        &[
            "keys",
            "create",
            "evil",
            "--scope",
            "admin",
            "--server",
            &service.url,
        ],
    );
    assert_eq!(
        stranger.status.code(),
        Some(1),
        "without the directory there is no token"
    );
    assert!(stderr(&stranger).contains("--data"), "{}", stderr(&stranger));
    // On the directory, which the service has locked.
    let listed = run(path, &["keys", "list", "--data", "d"]);
    assert!(listed.status.success(), "{}", stderr(&listed));
    assert!(stderr(&listed).contains(&service.url), "{}", stderr(&listed));
    // With the address too, and by another name of it.
    let port = service.url.rsplit_once(':').unwrap().1;
    let server = format!("http://localhost:{port}");
    let none = answer(path, &["keys", "list", "--data", "d", "--server", &server]);
    assert!(none.contains("no API keys"), "{none}");
    let admin = answer(
        path,
        &["keys", "create", "root", "--scope", "admin", "--data", "d"],
    );
    assert!(admin.starts_with("slx_"), "{admin}");
    // From now on it takes a key, also for the owner.
    let late = run(path, &["keys", "create", "ci", "--scope", "read", "--data", "d"]);
    assert_eq!(late.status.code(), Some(1));
    assert!(stderr(&late).contains("admin"), "{}", stderr(&late));
    let second = shapelex(path)
        .args(["keys", "create", "ci", "--scope", "read", "--data", "d"])
        .env("SHAPELEX_API_KEY", admin.trim())
        .output()
        .unwrap();
    assert!(second.status.success(), "{}", stderr(&second));
    assert!(path.join("d/local-access.json").exists());
    assert!(service.terminate().success());
    assert!(
        !path.join("d/local-access.json").exists(),
        "it goes with the service"
    );
}

#[test]
fn a_restore_into_a_running_service_takes_its_directory_or_a_key() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    assert!(Service::start(path, &["--data", "a"]).terminate().success());
    answer(
        path,
        &["snapshot", "create", "--data", "a", "--out", "all.tar.zst"],
    );
    let service = Service::start(path, &["--data", "b"]);
    let refused = run(
        path,
        &["snapshot", "restore", "all.tar.zst", "--server", &service.url],
    );
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        stderr(&refused).contains("local-access.json"),
        "{}",
        stderr(&refused)
    );
    let restored = answer(path, &["snapshot", "restore", "all.tar.zst", "--data", "b"]);
    assert!(restored.contains("restored"), "{restored}");
}

#[test]
fn the_token_is_new_at_each_start_and_in_no_log() {
    let dir = tempfile::tempdir().unwrap();
    let log = dir.path().join("log");
    let mut tokens = Vec::new();
    for _ in 0..2 {
        let mut child = shapelex(dir.path())
            .args([
                "serve",
                "--listen",
                "127.0.0.1:0",
                "--data",
                "d",
                "--log",
                "trace",
            ])
            .stdout(Stdio::piped())
            .stderr(
                std::fs::OpenOptions::new()
                    .create(true)
                    .append(true)
                    .open(&log)
                    .unwrap(),
            )
            .spawn()
            .unwrap();
        let mut line = String::new();
        std::io::BufRead::read_line(
            &mut std::io::BufReader::new(child.stdout.as_mut().unwrap()),
            &mut line,
        )
        .unwrap();
        let file = dir.path().join("d/local-access.json");
        answer(dir.path(), &["keys", "list", "--data", "d"]);
        let access = last_json(&std::fs::read_to_string(&file).unwrap());
        tokens.push(access["token"].as_str().unwrap().to_owned());
        // As a crash leaves it: the file stays, and is of no use.
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(file.exists());
    }
    assert_ne!(tokens[0], tokens[1]);
    let logged = std::fs::read_to_string(&log).unwrap();
    assert!(logged.contains("list_keys"), "{logged}");
    assert!(!tokens.iter().any(|token| logged.contains(&token[4..])));
}

#[cfg(target_os = "linux")]
mod linux {
    use super::*;
    use rustix::process::{Pid, Resource, Rlimit, prlimit};
    use serde_json::{Value, json};
    use std::io::{BufRead, BufReader, Read, Write};
    use std::net::TcpStream;
    use std::os::unix::fs::PermissionsExt;
    use std::process::Child;
    use std::time::{Duration, Instant};

    /// A service started by a shell, which sets limits first.
    struct Limited {
        child: Child,
        address: String,
    }

    impl Limited {
        fn start(dir: &Path, limits: &str, args: &str) -> Self {
            let binary = env!("CARGO_BIN_EXE_shapelex");
            let mut child = Command::new("sh")
                .args([
                    "-c",
                    &format!("{limits}; exec {binary} serve --json --listen 127.0.0.1:0 --data d {args}"),
                ])
                .current_dir(dir)
                .env_remove("SHAPELEX_DATA")
                .stdout(Stdio::piped())
                .stderr(std::fs::File::create(dir.join("log")).unwrap())
                .spawn()
                .unwrap();
            let mut line = String::new();
            BufReader::new(child.stdout.as_mut().unwrap())
                .read_line(&mut line)
                .unwrap();
            let url = last_json(&line)["listening"].as_str().unwrap().to_owned();
            let address = url.strip_prefix("http://").unwrap().to_owned();
            Self { child, address }
        }

        fn limit(&self) -> (u64, u64) {
            let limits = std::fs::read_to_string(format!("/proc/{}/limits", self.child.id())).unwrap();
            let line = limits.lines().find(|l| l.starts_with("Max open files")).unwrap();
            let mut numbers = line.split_whitespace().filter_map(|w| w.parse().ok());
            (numbers.next().unwrap(), numbers.next().unwrap())
        }

        fn set_soft(&self, soft: u64) {
            let pid = Pid::from_raw(i32::try_from(self.child.id()).unwrap());
            let limit = Rlimit {
                current: Some(soft),
                maximum: Some(self.limit().1),
            };
            prlimit(pid, Resource::Nofile, limit).unwrap();
        }
    }

    impl Drop for Limited {
        fn drop(&mut self) {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }

    /// A connection that is kept for several requests.
    struct Kept(BufReader<TcpStream>);

    impl Kept {
        fn new(address: &str) -> Self {
            Self(BufReader::new(TcpStream::connect(address).unwrap()))
        }

        fn ask(&mut self, method: &str, path: &str, media_type: &str, body: &[u8]) -> (u16, String, Value) {
            let head = format!(
                "{method} {path} HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-type: {media_type}\r\ncontent-length: {}\r\n\r\n",
                body.len()
            );
            self.0.get_mut().write_all(head.as_bytes()).unwrap();
            self.0.get_mut().write_all(body).unwrap();
            let (mut head, mut length) = (String::new(), 0);
            loop {
                let mut line = String::new();
                assert_ne!(self.0.read_line(&mut line).unwrap(), 0, "{head}");
                if line == "\r\n" {
                    break;
                }
                if let Some(value) = line.strip_prefix("content-length: ") {
                    length = value.trim().parse().unwrap();
                }
                head += &line;
            }
            let mut body = vec![0; length];
            self.0.read_exact(&mut body).unwrap();
            let status = head[9..12].parse().unwrap();
            (status, head, serde_json::from_slice(&body).unwrap_or(Value::Null))
        }
    }

    fn meshes(dir: &Path) -> Vec<Vec<u8>> {
        answer(
            dir,
            &[
                "zoo",
                "--out",
                "zoo",
                "--classes",
                "1",
                "--poses",
                "4",
                "--min-vertices",
                "300",
                "--max-vertices",
                "400",
            ],
        );
        let class = std::fs::read_dir(dir.join("zoo"))
            .unwrap()
            .flatten()
            .find(|e| e.path().is_dir())
            .unwrap();
        std::fs::read_dir(class.path())
            .unwrap()
            .map(|e| std::fs::read(e.unwrap().path()).unwrap())
            .collect()
    }

    fn small() -> String {
        json!({"scope": "all", "parameters": {"eigenpairs": 50, "energies": 40, "atoms": 8, "iterations": 3, "batch": 64, "samples_per_shape": 100}}).to_string()
    }

    #[test]
    fn the_limit_of_open_files_is_raised_and_connections_fit_it() {
        let dir = tempfile::tempdir().unwrap();
        let service = Limited::start(dir.path(), "ulimit -Sn 200; ulimit -Hn 4096", "");
        assert_eq!(service.limit(), (4096, 4096));
        drop(service);
        let service = Limited::start(dir.path(), "ulimit -n 256", "");
        let log = std::fs::read_to_string(dir.path().join("log")).unwrap();
        assert!(
            log.contains("max_connections=64") && log.contains("ulimit -n"),
            "{log}"
        );
        // As many idle connections as the process could never hold.
        let idle: Vec<TcpStream> = (0..600)
            .map(|_| TcpStream::connect(&service.address).unwrap())
            .collect();
        let mesh = meshes(dir.path()).remove(0);
        let mut kept = Kept::new(&service.address);
        let (status, head, _) = kept.ask("POST", "/v1/classes/a/shapes?create=true", "model/obj", &mesh);
        assert_eq!(status, 201, "{head}");
        drop(idle);
    }

    #[test]
    fn out_of_open_files_is_503_and_a_job_waits() {
        let dir = tempfile::tempdir().unwrap();
        let meshes = meshes(dir.path());
        let service = Limited::start(dir.path(), ":", "");
        let mut kept = Kept::new(&service.address);
        let upload = |kept: &mut Kept, mesh: &[u8]| {
            kept.ask("POST", "/v1/classes/a/shapes?create=true", "model/obj", mesh)
        };
        for mesh in &meshes[..2] {
            assert_eq!(upload(&mut kept, mesh).0, 201);
        }
        // What is open stays open; nothing more can be.
        service.set_soft(3);
        let (status, head, body) = upload(&mut kept, &meshes[2]);
        assert_eq!(
            (status, body["code"].as_str()),
            (503, Some("overloaded")),
            "{head} {body}"
        );
        assert!(head.contains("retry-after: "), "{head}");
        let (status, _, job) = kept.ask("POST", "/v1/reindex", "application/json", small().as_bytes());
        assert_eq!(status, 202, "{job}");
        let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
        std::thread::sleep(Duration::from_secs(1));
        let (_, _, job) = kept.ask("GET", &path, "", b"");
        assert!(
            ["enqueued", "processing"].contains(&job["state"].as_str().unwrap()),
            "{job}"
        );
        service.set_soft(service.limit().1);
        let began = Instant::now();
        loop {
            let (_, _, job) = kept.ask("GET", &path, "", b"");
            match job["state"].as_str().unwrap() {
                "succeeded" => break,
                "enqueued" | "processing" => {}
                _ => panic!("{job}"),
            }
            assert!(began.elapsed() < Duration::from_secs(60), "{job}");
            std::thread::sleep(Duration::from_millis(100));
        }
        assert_eq!(
            upload(&mut kept, &meshes[2]).0,
            201,
            "the store still takes writes"
        );
        assert_eq!(kept.ask("GET", "/readyz", "", b"").0, 200);
    }

    /// Everything in a directory that others may read, write or enter.
    fn open_to_others(path: &Path) -> Vec<String> {
        let mode = std::fs::metadata(path).unwrap().permissions().mode();
        let mut open = Vec::new();
        if mode & 0o077 != 0 {
            open.push(format!("{} {mode:o}", path.display()));
        }
        if path.is_dir() {
            for entry in std::fs::read_dir(path).unwrap() {
                open.extend(open_to_others(&entry.unwrap().path()));
            }
        }
        open
    }

    #[test]
    fn the_data_directory_is_its_owners_alone_whatever_the_umask() {
        let dir = tempfile::tempdir().unwrap();
        let meshes = meshes(dir.path());
        let data = dir.path().join("d");
        let fill = |service: &Limited| {
            let mut kept = Kept::new(&service.address);
            assert_eq!(
                kept.ask(
                    "POST",
                    "/v1/classes/a/shapes?create=true",
                    "model/obj",
                    &meshes[0]
                )
                .0 / 100,
                2
            );
            let (_, _, job) = kept.ask("POST", "/v1/reindex", "application/json", small().as_bytes());
            assert_eq!(kept.ask("POST", "/v1/snapshots", "", b"").0, 201, "{job}");
            let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
            let began = Instant::now();
            while kept.ask("GET", &path, "", b"").2["state"] != "succeeded" {
                assert!(began.elapsed() < Duration::from_secs(60));
                std::thread::sleep(Duration::from_millis(100));
            }
        };
        let service = Limited::start(dir.path(), "umask 000", "");
        fill(&service);
        for name in [
            "sled",
            "catalogue.log",
            "audit.log",
            "originals",
            "snapshots",
            "local-access.json",
        ] {
            assert!(data.join(name).exists(), "{name}");
        }
        assert_eq!(open_to_others(&data), Vec::<String>::new());
        drop(service);
        // As an earlier version left it.
        let all = Command::new("chmod")
            .args(["-R", "a+rX", "d"])
            .current_dir(dir.path())
            .status()
            .unwrap();
        assert!(all.success() && !open_to_others(&data).is_empty());
        let service = Limited::start(dir.path(), "umask 000", "");
        let log = std::fs::read_to_string(dir.path().join("log")).unwrap();
        assert!(log.contains("its owner's alone now"), "{log}");
        fill(&service);
        assert_eq!(open_to_others(&data), Vec::<String>::new());
        drop(service);
        // A command that works in the directory by itself.
        let snapshot = Command::new("sh")
            .args([
                "-c",
                &format!(
                    "umask 000; {} keys create admin --scope admin --data e",
                    env!("CARGO_BIN_EXE_shapelex")
                ),
            ])
            .current_dir(dir.path())
            .env_remove("SHAPELEX_DATA")
            .output()
            .unwrap();
        assert!(snapshot.status.success(), "{}", stderr(&snapshot));
        let open = open_to_others(&dir.path().join("e"));
        assert!(!open.iter().any(|file| !file.contains("/sled/")), "{open:?}");
        assert_eq!(
            std::fs::metadata(dir.path().join("e"))
                .unwrap()
                .permissions()
                .mode()
                & 0o777,
            0o700
        );
    }
}
