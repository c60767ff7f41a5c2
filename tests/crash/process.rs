//! The service as a process of its own.

use serde_json::Value;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

/// A running service; killed when dropped.
pub struct Service {
    child: Child,
    pub url: String,
}

/// The command that starts the service on `data` below a directory, its log beside it.
pub fn command(directory: &Path, more: &[&str]) -> Command {
    let log = OpenOptions::new()
        .create(true)
        .append(true)
        .open(directory.join("log"))
        .unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_shapelex"));
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("SHAPELEX_")) {
        command.env_remove(name);
    }
    command
        .args([
            "serve",
            "--listen",
            "127.0.0.1:0",
            "--json",
            "--log",
            "warn",
            "--data",
        ])
        .arg(directory.join("data"))
        .args(more)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(log);
    command
}

/// Starts the process without waiting for it to listen.
pub fn spawn(directory: &Path, more: &[&str]) -> Child {
    command(directory, more).spawn().unwrap()
}

impl Service {
    /// Starts it and waits until it listens.
    ///
    /// # Panics
    /// With what it logged, where it does not start.
    pub fn start(directory: &Path, more: &[&str]) -> Self {
        Self::try_start(spawn(directory, more))
            .unwrap_or_else(|status| panic!("it did not start ({status}):\n{}", tail(directory)))
    }

    /// Waits until a process listens, or gives the status it ended with.
    pub fn try_start(mut child: Child) -> Result<Self, ExitStatus> {
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        match serde_json::from_str::<Value>(&line) {
            Ok(told) => Ok(Self {
                url: told["listening"].as_str().unwrap().to_owned(),
                child,
            }),
            Err(_) => Err(child.wait().unwrap()),
        }
    }

    /// SIGTERM, and waits until the process has ended in good order.
    pub fn stop(mut self) {
        let pid = self.child.id().to_string();
        let told = Command::new("kill").args(["-TERM", &pid]).status().unwrap();
        assert!(told.success());
        self.child.wait().unwrap();
    }

    /// The process's number.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// SIGKILL, and waits until the process is gone.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // Gone already where it was killed on purpose.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Starts the process and kills it that long after, whatever it was doing.
pub fn start_and_kill(directory: &Path, more: &[&str], after: Duration) {
    let mut child = spawn(directory, more);
    std::thread::sleep(after);
    child.kill().unwrap();
    child.wait().unwrap();
}

/// The last lines of the log.
pub fn tail(directory: &Path) -> String {
    let Ok(file) = File::open(directory.join("log")) else {
        return String::new();
    };
    let lines: Vec<String> = BufReader::new(file).lines().map_while(Result::ok).collect();
    lines[lines.len().saturating_sub(30)..].join("\n")
}
