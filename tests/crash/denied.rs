//! A data directory that may not be written or read: a read-only mount, missing rights. What can be shown is shown, what
//! cannot be done is refused with a precise problem, and nothing is written.

use crate::client::Client;
use crate::disk::Disk;
use crate::mesh;
use crate::process::{Service, command, tail};
use std::fs::Permissions;
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Child;

/// The user the service runs as where the tests run as root, for whom rights do not count.
const NOBODY: u32 = 65534;

fn is_root(directory: &Path) -> bool {
    let probe = directory.join("probe");
    std::fs::write(&probe, b"").unwrap();
    std::fs::set_permissions(&probe, Permissions::from_mode(0o000)).unwrap();
    let root = std::fs::read(&probe).is_ok();
    std::fs::remove_file(&probe).unwrap();
    root
}

/// Starts the service as a user for whom rights count.
fn spawn(directory: &Path, more: &[&str]) -> Child {
    let root = is_root(directory);
    let mut command = command(directory, more);
    if root {
        command.uid(NOBODY).gid(NOBODY);
    }
    command.spawn().unwrap()
}

fn own(path: &Path) {
    if is_root(path.parent().unwrap()) {
        chown(path, Some(NOBODY), Some(NOBODY)).unwrap();
    }
}

fn set(path: &Path, mode: u32) {
    std::fs::set_permissions(path, Permissions::from_mode(mode)).unwrap();
}

/// A directory the service can reach, with an empty data directory of its own.
fn place() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    set(directory.path(), 0o755);
    let data = directory.path().join("data");
    std::fs::create_dir(&data).unwrap();
    own(&data);
    directory
}

/// `false`, with a line that says so, where another user may not run what was built.
fn can_run(name: &str, directory: &Path) -> bool {
    let root = is_root(directory);
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_shapelex"));
    command.arg("--version").stdout(std::process::Stdio::null());
    if root {
        command.uid(NOBODY).gid(NOBODY);
    }
    let can = command.status().is_ok_and(|status| status.success());
    if !can {
        println!("{name}: skipped, another user may not run the program here");
    }
    can
}

fn fill(directory: &Path) {
    let service = Service::try_start(spawn(directory, &[])).unwrap();
    let client = Client::new(&service.url);
    for seed in 0..3 {
        let path = format!("/v1/classes/class{seed}/shapes?create=true&name={seed}.off");
        let answer = client
            .send("POST", &path, "model/off", mesh(seed).into_bytes())
            .unwrap();
        assert_eq!(answer.status, 201, "{}", answer.text());
    }
    service.kill();
}

/// The catalogue is shown, everything else is refused as recovery mode refuses it.
fn check_shown(service: &Service, reason: &str) {
    let client = Client::new(&service.url);
    let classes = client.list("/v1/classes");
    assert_eq!(classes.len(), 3);
    for class in classes {
        for shape in client.list(&format!("/v1/classes/{}/shapes", class["id"].as_str().unwrap())) {
            let seed: u32 = shape["name"]
                .as_str()
                .unwrap()
                .strip_suffix(".off")
                .unwrap()
                .parse()
                .unwrap();
            assert!(client.get(shape["original"].as_str().unwrap()).body == mesh(seed).into_bytes());
        }
    }
    let ready = client.send("GET", "/readyz", "", Vec::new()).unwrap();
    assert_eq!(ready.status, 503);
    let why = ready.value()["checks"]["store"].as_str().unwrap().to_owned();
    assert!(why.contains("recovery mode") && why.contains(reason), "{why}");
    let upload = client.send(
        "POST",
        "/v1/classes/class0/shapes",
        "model/off",
        mesh(9).into_bytes(),
    );
    for (what, answer) in [
        ("upload", upload),
        (
            "class",
            client.json("POST", "/v1/classes", &serde_json::json!({"name": "new"})),
        ),
        (
            "delete",
            client.send("DELETE", "/v1/classes/class0", "", Vec::new()),
        ),
        (
            "query",
            client.send("POST", "/v1/query", "model/off", mesh(1).into_bytes()),
        ),
        (
            "reindex",
            client.json("POST", "/v1/reindex", &serde_json::json!({})),
        ),
        // Not in the log, and never said to be missing.
        ("jobs", client.send("GET", "/v1/jobs", "", Vec::new())),
    ] {
        let answer = answer.unwrap();
        assert_eq!(answer.code(), "recovery_mode", "{what}: {}", answer.text());
    }
}

#[test]
fn a_read_only_mount_is_shown_in_recovery_mode() {
    let directory = place();
    let writable = directory.path().join("writable");
    std::fs::create_dir(&writable).unwrap();
    let original = writable.join("data");
    std::fs::rename(directory.path().join("data"), &original).unwrap();
    std::fs::create_dir(directory.path().join("data")).unwrap();
    {
        let service = Service::start(&writable, &[]);
        let client = Client::new(&service.url);
        for seed in 0..3 {
            let path = format!("/v1/classes/class{seed}/shapes?create=true&name={seed}.off");
            let answer = client
                .send("POST", &path, "model/off", mesh(seed).into_bytes())
                .unwrap();
            assert_eq!(answer.status, 201, "{}", answer.text());
        }
        service.stop();
    }
    let Some(_disk) = Disk::read_only(&original, &directory.path().join("data")) else {
        println!("a_read_only_mount_is_shown_in_recovery_mode: skipped, nothing can be mounted here");
        return;
    };
    // Asked for, and by itself.
    for more in [&["--recovery-mode"][..], &[]] {
        let service = Service::start(directory.path(), more);
        check_shown(&service, "Read-only file system");
        service.stop();
    }
    // The same directory, writable again, has lost nothing.
    let service = Service::start(&writable, &[]);
    assert_eq!(Client::new(&service.url).list("/v1/classes").len(), 3);
    service.kill();
}

#[test]
fn a_directory_that_may_be_read_and_not_written_is_shown_in_recovery_mode() {
    let directory = place();
    let name = "a_directory_that_may_be_read_and_not_written_is_shown_in_recovery_mode";
    if !can_run(name, directory.path()) {
        return;
    }
    fill(directory.path());
    let data = directory.path().join("data");
    set(&data.join("lock"), 0o444);
    set(&data, 0o555);
    for more in [&["--recovery-mode"][..], &[]] {
        let service = Service::try_start(spawn(directory.path(), more)).unwrap();
        check_shown(&service, "Permission denied");
        service.kill();
    }
    set(&data, 0o755);
    set(&data.join("lock"), 0o644);
    // Only the records may not be written.
    set(&data.join("sled"), 0o500);
    set(&data.join("sled/db"), 0o400);
    let service = Service::try_start(spawn(directory.path(), &[])).unwrap();
    check_shown(&service, "sled");
    service.kill();
    set(&data.join("sled"), 0o700);
    set(&data.join("sled/db"), 0o600);
    let service = Service::try_start(spawn(directory.path(), &[])).unwrap();
    assert_eq!(Client::new(&service.url).list("/v1/classes").len(), 3);
    service.kill();
}

#[test]
fn a_directory_that_may_not_be_read_is_refused_in_one_line() {
    let directory = place();
    if !can_run(
        "a_directory_that_may_not_be_read_is_refused_in_one_line",
        directory.path(),
    ) {
        return;
    }
    let data = directory.path().join("data");
    for mode in [0o000, 0o555] {
        set(&data, mode);
        let Err(status) = Service::try_start(spawn(directory.path(), &[])) else {
            panic!("it started in a directory of mode {mode:o}");
        };
        let said = tail(directory.path());
        let said = said.lines().last().unwrap();
        assert_eq!(status.code(), Some(1));
        assert!(
            said.starts_with("shapelex: ")
                && said.contains(data.to_str().unwrap())
                && said.contains("Permission denied")
                && said.contains("give the user"),
            "{said}"
        );
    }
    set(&data, 0o755);
    let service = Service::try_start(spawn(directory.path(), &[])).unwrap();
    service.kill();
}

#[test]
fn files_that_may_not_be_used_are_a_problem_of_their_own() {
    let directory = place();
    if !can_run(
        "files_that_may_not_be_used_are_a_problem_of_their_own",
        directory.path(),
    ) {
        return;
    }
    fill(directory.path());
    let originals = directory.path().join("data/originals");
    let service = Service::try_start(spawn(directory.path(), &[])).unwrap();
    let client = Client::new(&service.url);
    let shapes = client.list("/v1/classes/class0/shapes");
    let original = shapes[0]["original"].as_str().unwrap().to_owned();
    set(&originals, 0o000);
    let download = client.send("GET", &original, "", Vec::new()).unwrap();
    let upload = client
        .send(
            "POST",
            "/v1/classes/class0/shapes",
            "model/off",
            mesh(7).into_bytes(),
        )
        .unwrap();
    for answer in [&download, &upload] {
        assert_eq!(
            (answer.status, answer.code().as_str()),
            (503, "storage_denied"),
            "{}",
            answer.text()
        );
        let detail = answer.value()["detail"].as_str().unwrap().to_owned();
        assert!(
            detail.contains("originals") && detail.contains("give the user"),
            "{detail}"
        );
    }
    set(&originals, 0o755);
    // Nothing was in doubt, so nothing has to be restarted.
    assert_eq!(client.get(&original).body, mesh(0).into_bytes());
    let upload = client
        .send(
            "POST",
            "/v1/classes/class0/shapes",
            "model/off",
            mesh(7).into_bytes(),
        )
        .unwrap();
    assert_eq!(upload.status, 201, "{}", upload.text());
    service.kill();
}

#[test]
fn an_audit_log_that_may_not_be_written_is_named() {
    let directory = place();
    if !can_run("an_audit_log_that_may_not_be_written_is_named", directory.path()) {
        return;
    }
    fill(directory.path());
    let log = directory.path().join("data/audit.log");
    set(&log, 0o400);
    let Err(status) = Service::try_start(spawn(directory.path(), &[])) else {
        panic!("it started without an audit log");
    };
    let said = tail(directory.path());
    let said = said.lines().last().unwrap();
    assert_eq!(status.code(), Some(1));
    assert!(
        said.contains(log.to_str().unwrap()) && said.contains("give the user"),
        "{said}"
    );
}
