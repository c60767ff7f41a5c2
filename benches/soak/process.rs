//! The service as a process of its own, and what `/proc` says of it.

use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

pub struct Process {
    child: Child,
    address: String,
    _directory: tempfile::TempDir,
}

/// The process at one moment.
pub struct Sample {
    pub seconds: f64,
    pub resident_kib: u64,
    pub descriptors: usize,
    pub threads: u64,
}

impl Sample {
    pub const COLUMNS: &str = "seconds,resident_kib,descriptors,threads";

    pub fn row(&self) -> String {
        format!(
            "{:.0},{},{},{}",
            self.seconds, self.resident_kib, self.descriptors, self.threads
        )
    }
}

impl Process {
    /// Starts it with more arguments for `serve`.
    pub fn start(arguments: &[String]) -> Self {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let mut child = Command::new(env!("CARGO_BIN_EXE_shapelex"))
            .args([
                "serve",
                "--json",
                "--log",
                "error",
                "--listen",
                "127.0.0.1:0",
                "--data",
            ])
            .arg(directory.path().join("data"))
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the service starts");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("its output"))
            .read_line(&mut line)
            .expect("a line");
        let told: Value = serde_json::from_str(&line).expect("its address");
        let url = told["listening"].as_str().expect("its address");
        Self {
            child,
            address: url.trim_start_matches("http://").to_owned(),
            _directory: directory,
        }
    }

    /// Host and port.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// `None` where it has ended.
    pub fn sample(&self, began: Instant) -> Option<Sample> {
        let pid = self.child.id();
        let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
        let field = |name: &str| -> Option<u64> {
            let line = status.lines().find(|line| line.starts_with(name))?;
            line.split_whitespace().nth(1)?.parse().ok()
        };
        Some(Sample {
            seconds: began.elapsed().as_secs_f64(),
            resident_kib: field("VmRSS:")?,
            descriptors: std::fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count(),
            threads: field("Threads:")?,
        })
    }

    /// A client with a connection of its own, which takes every status for an answer.
    pub fn agent(&self) -> ureq::Agent {
        ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(Duration::from_secs(180)))
            .proxy(None)
            .build()
            .into()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
