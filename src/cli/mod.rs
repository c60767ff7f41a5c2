//! The command line: one file per subcommand, and what they share.
//!
//! Answers go to stdout, everything else to stderr. With `--json` an answer is one JSON value per line. Exit codes:
//! 0 everything was done, 1 something failed or some inputs were refused, 2 the command line or the configuration is
//! wrong.

mod api;
mod ask;
pub mod benchmark;
pub mod benchmark_args;
mod benchmark_cache;
mod benchmark_nulls;
mod benchmark_report;
pub mod classes;
mod client;
mod confirm;
mod data_dir;
pub mod demo;
mod demo_report;
mod dictionaries;
mod encode;
mod error;
pub mod evaluate;
pub mod evaluate_args;
mod evaluate_checks;
mod evaluate_describe;
mod evaluate_figures;
mod evaluation;
mod evaluation_report;
mod events;
pub mod export;
mod exported_baselines;
mod figures;
mod files;
mod folders;
mod follow;
pub mod health;
pub mod import;
pub mod index;
pub mod inspect;
pub mod jobs;
pub mod keys;
mod listing;
pub mod manual;
mod openapi;
mod outcome;
mod output;
mod parameters;
mod parse;
mod peak_memory;
mod process;
mod progress;
mod prune;
pub mod query;
mod query_inputs;
mod query_summary;
mod query_text;
mod refused;
pub mod reindex;
pub mod serve;
mod service;
pub mod shapes;
pub mod snapshot;
mod tensors;
mod transfer;
mod trust;
mod values;
mod verdict;
mod wording;
pub mod zoo;

pub use error::CliError;
pub use parameters::ParameterArgs;

use crate::telemetry::{self, LogFormat};
use clap::{Parser, Subcommand};
use output::note_line;
use parse::ParseError;
use std::ffi::OsString;
use std::process::ExitCode;

/// Recognises deformable 3D shapes
#[derive(Debug, Parser)]
#[command(name = "shapelex", version, about, long_about = LONG_ABOUT, after_help = AFTER_HELP)]
pub struct Cli {
    /// Answer in JSON, one value per line
    #[arg(long, global = true)]
    pub json: bool,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const LONG_ABOUT: &str = "Recognises deformable 3D shapes: learns a dictionary of local signatures per class from \
example meshes, and ranks the classes a new mesh may belong to.";
const AFTER_HELP: &str = "Exit codes: 0 done; 1 something failed or some inputs were refused; 2 wrong usage or \
configuration.";

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the service
    Serve(Box<serve::ServeArgs>),
    /// Make a zoo, teach it to a service and recognise unseen poses, over HTTP
    Demo(demo::DemoArgs),
    /// Learn the classes of a folder per class
    Index(index::IndexArgs),
    /// Rank the classes a mesh may belong to
    Query(query::QueryArgs),
    /// Learn again what changed, or all, with the shapes that are there
    Reindex(reindex::ReindexArgs),
    /// List, show, rename and delete classes
    Classes(classes::ClassesArgs),
    /// List, show, delete and download the shapes of a class
    Shapes(shapes::ShapesArgs),
    /// List, show, follow and cancel background work
    Jobs(jobs::JobsArgs),
    /// Measure accuracy on a folder per class
    Evaluate(evaluate_args::EvaluateArgs),
    /// Measure robustness: deform null shapes, compare methods and baselines
    Benchmark(benchmark_args::BenchmarkArgs),
    /// Show what is read of a file, what cleaning did, how its spectrum begins
    Inspect(inspect::InspectArgs),
    /// Write procedural creatures, a folder per class
    Zoo(zoo::ZooArgs),
    /// Write the index's dictionaries to a safetensors file
    Export(export::ExportArgs),
    /// Make dictionaries of a safetensors file the index of a data directory
    Import(import::ImportArgs),
    /// Make, list and revoke API keys
    Keys(keys::KeysArgs),
    /// Make, list, download and restore snapshots of everything a service holds
    Snapshot(snapshot::SnapshotArgs),
    /// Ask whether a service answers
    Health(health::HealthArgs),
    /// Print the API's OpenAPI document
    Openapi,
    /// Print what a shell needs to complete commands and flags
    Completions(manual::CompletionsArgs),
    /// Print the manual page, or write a page per command
    Man(manual::ManArgs),
}

/// Parses the arguments, runs the command, prints its error and returns the exit code.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match parse::parse(args) {
        Ok(cli) => cli,
        Err(ParseError::Line(line)) => {
            note_line!("shapelex: {line}");
            return ExitCode::from(error::USAGE);
        }
        Err(ParseError::Clap(error)) => {
            // Printing help fails only where nobody reads it.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() {
                error::USAGE
            } else {
                error::OK
            });
        }
    };
    match dispatch(&cli) {
        Ok(()) => ExitCode::from(error::OK),
        Err(error) => {
            if let Some(message) = error.message() {
                note_line!("{message}");
            }
            error.exit_code()
        }
    }
}

fn dispatch(cli: &Cli) -> Result<(), CliError> {
    let json = cli.json;
    if !matches!(cli.command, Command::Serve(_)) {
        quiet_logs()?;
    }
    match &cli.command {
        Command::Serve(args) => serve::run(args, json),
        Command::Demo(args) => demo::run(args, json),
        Command::Index(args) => index::run(args, json),
        Command::Query(args) => query::run(args, json),
        Command::Reindex(args) => reindex::run(args, json),
        Command::Classes(args) => classes::run(args, json),
        Command::Shapes(args) => shapes::run(args, json),
        Command::Jobs(args) => jobs::run(args, json),
        Command::Evaluate(args) => evaluate::run(args, json),
        Command::Benchmark(args) => benchmark::run(args, json),
        Command::Inspect(args) => inspect::run(args, json),
        Command::Zoo(args) => zoo::run(args, json),
        Command::Export(args) => export::run(args, json),
        Command::Import(args) => import::run(args, json),
        Command::Keys(args) => keys::run(args, json),
        Command::Snapshot(args) => snapshot::run(args, json),
        Command::Health(args) => health::run(args, json),
        Command::Openapi => openapi::run(json),
        Command::Completions(args) => manual::completions(args),
        Command::Man(args) => manual::man(args, json),
    }
}

/// Logs of commands other than `serve`: warnings, unless the environment asks for more.
fn quiet_logs() -> Result<(), CliError> {
    let filter = std::env::var("SHAPELEX_LOG").unwrap_or_else(|_| "warn".to_owned());
    telemetry::init(&filter, LogFormat::Text, None)
        .map(drop)
        .map_err(|error| CliError::Usage(format!("SHAPELEX_LOG: {error}")))
}
