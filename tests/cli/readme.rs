//! Every line of the README's tour is run.

use crate::repository;
use std::path::Path;
use std::process::{Command, Stdio};

/// The address the tour's service listens on, as the README prints it.
const ADDRESS: &str = "127.0.0.1:7345";

/// Lines of all `sh` blocks between the tour's heading and the next one.
fn tour() -> Vec<String> {
    let readme = std::fs::read_to_string(repository("README.md")).unwrap();
    let begin = readme
        .find("## A tour in five minutes")
        .expect("the README has a tour");
    let rest = &readme[begin + 3..];
    let section = &rest[..rest.find("\n## ").unwrap_or(rest.len())];
    let mut lines = Vec::new();
    for block in section.split("```sh\n").skip(1) {
        lines.extend(block.split("```").next().unwrap().lines().map(str::to_owned));
    }
    assert!(lines.len() > 8, "{lines:?}");
    lines
}

fn has(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|s| s.success())
}

#[test]
fn every_line_of_the_tour_runs() {
    for program in ["bash", "curl"] {
        if !has(program) {
            eprintln!("skipped: every_line_of_the_tour_runs: no {program}");
            return;
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let free = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    // Strict mode turns every line into an assertion; --fail-with-body makes curl one of them.
    let mut script = String::from(
        "set -euxo pipefail\n\
         trap 'kill $(jobs -p) 2>/dev/null || true' EXIT\n\
         curl() { command curl --fail-with-body --silent --show-error \"$@\"; }\n",
    );
    for line in tour() {
        script += &line.replace(ADDRESS, &free.to_string());
        script.push('\n');
    }
    let binaries = Path::new(env!("CARGO_BIN_EXE_shapelex"))
        .parent()
        .unwrap()
        .to_owned();
    let path = std::env::var("PATH").unwrap_or_default();
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(dir.path())
        .env("PATH", format!("{}:{path}", binaries.display()))
        .env("SHAPELEX_LISTEN", free.to_string())
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}\n{stdout}\n{stderr}", output.status);
    assert!(
        stdout.contains("\"confidence\""),
        "a query was answered:\n{stdout}\n{stderr}"
    );
}
