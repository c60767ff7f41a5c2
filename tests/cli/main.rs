//! The built binary, as a shell sees it.

mod benchmark;
mod catalogue;
mod commands;
mod configuration;
mod figures;
mod gltf;
mod https;
mod keys;
mod readme;
mod service;
mod strangers;
mod usage;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The command, in a directory of its own and without settings from outside.
pub fn shapelex(dir: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_shapelex"));
    command.current_dir(dir);
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("SHAPELEX_")) {
        command.env_remove(name);
    }
    command
}

/// Runs it to its end.
pub fn run(dir: &Path, args: &[&str]) -> Output {
    shapelex(dir).args(args).output().unwrap()
}

/// Runs it and demands success; returns stdout.
pub fn answer(dir: &Path, args: &[&str]) -> String {
    let output = run(dir, args);
    assert!(
        output.status.success(),
        "{args:?} ended with {}:\n{}",
        output.status,
        stderr(&output)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// The last line of stdout as JSON.
pub fn last_json(stdout: &str) -> serde_json::Value {
    let line = stdout.lines().last().unwrap_or_else(|| panic!("no output"));
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A file of the repository.
pub fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A small zoo: three classes that are easy to tell apart, four poses each.
pub fn small_zoo(dir: &Path) {
    answer(
        dir,
        &[
            "zoo",
            "--out",
            "shapes",
            "--classes",
            "3",
            "--poses",
            "4",
            "--min-vertices",
            "900",
            "--max-vertices",
            "1200",
        ],
    );
}
