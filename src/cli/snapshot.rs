//! `shapelex snapshot`: everything a service holds, as one file, and back.

use super::CliError;
use super::client::{OperatorArgs, Payload};
use super::encode::encode;
use super::listing::{self, Column, tell};
use crate::model::SnapshotId;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Arguments of `snapshot`.
#[derive(Debug, clap::Args)]
pub struct SnapshotArgs {
    /// What to do.
    #[command(subcommand)]
    pub command: SnapshotCommand,
}

/// What can be done with snapshots.
#[derive(Debug, clap::Subcommand)]
pub enum SnapshotCommand {
    /// Make a snapshot; requests go on meanwhile
    Create {
        /// Save it to this file too
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
        /// Where the data is.
        #[command(flatten)]
        target: OperatorArgs,
    },
    /// List the snapshots there are
    List {
        /// Where the data is.
        #[command(flatten)]
        target: OperatorArgs,
    },
    /// Save a snapshot to a file
    Download {
        /// The snapshot's id
        id: String,
        /// File to write
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        /// Where the data is.
        #[command(flatten)]
        target: OperatorArgs,
    },
    /// Replace everything there is by what a snapshot holds
    Restore {
        /// A snapshot's file, or the id of one that is there
        #[arg(value_name = "FILE_OR_ID")]
        snapshot: String,
        /// Where the data goes; a data directory is made where there is none.
        #[command(flatten)]
        target: OperatorArgs,
    },
    /// Delete a snapshot
    Delete {
        /// The snapshot's id
        id: String,
        /// Where the data is.
        #[command(flatten)]
        target: OperatorArgs,
    },
}

/// Does what is asked for.
///
/// # Errors
/// [`CliError::Failed`] where the service refuses, or a file cannot be read or written.
pub fn run(args: &SnapshotArgs, as_json: bool) -> Result<(), CliError> {
    match &args.command {
        SnapshotCommand::Create { out, target } => {
            let client = target.client()?;
            let made = client.call("POST", "/v1/snapshots", Payload::Empty)?;
            if let Some(out) = out {
                client.download(text(&made, "file"), out)?;
            }
            tell(as_json, &made, || {
                let saved = out.as_ref().map(|out| format!(", saved to {}", out.display()));
                format!("snapshot {}{}", describe(&made), saved.unwrap_or_default())
            })
        }
        SnapshotCommand::List { target } => {
            let snapshots = listing::all(&target.client()?, "/v1/snapshots")?;
            listing::print(&snapshots, &COLUMNS, "no snapshots", as_json)
        }
        SnapshotCommand::Download { id, out, target } => {
            let client = target.client()?;
            let path = format!("/v1/snapshots/{}/file", encode(id));
            let bytes = client.download(&path, out)?;
            let told = json!({"file": out.display().to_string(), "bytes": bytes});
            tell(as_json, &told, || format!("{bytes} bytes in {}", out.display()))
        }
        SnapshotCommand::Restore { snapshot, target } => restore(snapshot, target, as_json),
        SnapshotCommand::Delete { id, target } => {
            let path = format!("/v1/snapshots/{}", encode(id));
            target.client()?.call("DELETE", &path, Payload::Empty)?;
            tell(as_json, &json!({ "deleted": id }), || format!("deleted {id}"))
        }
    }
}

const COLUMNS: [Column; 6] = [
    ("id", "id"),
    ("made", "created_at"),
    ("origin", "origin"),
    (">classes", "classes"),
    (">shapes", "shapes"),
    (">bytes", "bytes"),
];

/// What a snapshot's file begins with (RFC 8878).
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Refuses what is no snapshot by its first bytes, before a data directory is made for it.
fn require_zstd(file: &Path) -> Result<(), CliError> {
    let mut first = [0; ZSTD.len()];
    let read = File::open(file).and_then(|mut file| file.read_exact(&mut first));
    match read {
        Ok(()) if first == ZSTD => Ok(()),
        Err(error) if error.kind() != ErrorKind::UnexpectedEof => Err(CliError::at(file, error)),
        _ => Err(CliError::at(
            file,
            "the snapshot cannot be restored: this is no file of a snapshot",
        )),
    }
}

/// Restores from a file, or from a snapshot that is there. What is neither is found out before a directory is made.
fn restore(snapshot: &str, target: &OperatorArgs, as_json: bool) -> Result<(), CliError> {
    let file = PathBuf::from(snapshot);
    let restored = if file.is_file() {
        require_zstd(&file)?;
        let client = target.client_or_new()?;
        client.send_file("/v1/snapshots/restore", "application/zstd", &file)?
    } else {
        if snapshot.parse::<SnapshotId>().is_err() {
            let what = if file.is_dir() {
                "this is a folder"
            } else {
                "there is no such file"
            };
            return Err(CliError::Usage(format!(
                "{snapshot}: {what}, and no snapshot has such an id; `shapelex snapshot list` shows those there are"
            )));
        }
        let path = format!("/v1/snapshots/{}/restore", encode(snapshot));
        target.client()?.call("POST", &path, Payload::Empty)?
    };
    tell(as_json, &restored, || {
        format!(
            "restored: {} classes, {} shapes, index generation {}, as of {}",
            restored["classes"],
            restored["shapes"],
            restored["generation"],
            text(&restored, "created_at")
        )
    })
}

fn describe(snapshot: &Value) -> String {
    format!(
        "{}: {} classes, {} shapes, {} bytes",
        text(snapshot, "id"),
        snapshot["classes"],
        snapshot["shapes"],
        snapshot["bytes"]
    )
}

fn text<'a>(value: &'a Value, name: &str) -> &'a str {
    value[name].as_str().unwrap_or_default()
}
