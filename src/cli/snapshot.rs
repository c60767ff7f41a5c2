//! `shapelex snapshot`: everything a service holds, as one file, and back.

use super::client::{Client, OperatorArgs, Payload};
use super::{CliError, output};
use serde_json::{Value, json};
use std::path::PathBuf;

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
        SnapshotCommand::List { target } => list(&target.client()?, as_json),
        SnapshotCommand::Download { id, out, target } => {
            let client = target.client()?;
            let path = format!("/v1/snapshots/{}/file", super::api::encode(id));
            let bytes = client.download(&path, out)?;
            let told = json!({"file": out.display().to_string(), "bytes": bytes});
            tell(as_json, &told, || format!("{bytes} bytes in {}", out.display()))
        }
        SnapshotCommand::Restore { snapshot, target } => {
            let client = target.client()?;
            let file = PathBuf::from(snapshot);
            let restored = if file.is_file() {
                client.send_file("/v1/snapshots/restore", "application/zstd", &file)?
            } else {
                let path = format!("/v1/snapshots/{}/restore", super::api::encode(snapshot));
                client.call("POST", &path, Payload::Empty)?
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
        SnapshotCommand::Delete { id, target } => {
            let path = format!("/v1/snapshots/{}", super::api::encode(id));
            target.client()?.call("DELETE", &path, Payload::Empty)?;
            tell(as_json, &json!({ "deleted": id }), || format!("deleted {id}"))
        }
    }
}

fn list(client: &Client, as_json: bool) -> Result<(), CliError> {
    let mut rows = Vec::new();
    let mut cursor = String::new();
    loop {
        let page = client.call(
            "GET",
            &format!("/v1/snapshots?limit=1000{cursor}"),
            Payload::Empty,
        )?;
        for snapshot in page["items"].as_array().into_iter().flatten() {
            if as_json {
                output::json(snapshot)?;
            }
            let cell = |name: &str| match &snapshot[name] {
                Value::String(text) => text.clone(),
                other => other.to_string(),
            };
            rows.push(
                ["id", "created_at", "origin", "classes", "shapes", "bytes"]
                    .map(cell)
                    .to_vec(),
            );
        }
        match page["next_cursor"].as_str() {
            Some(next) => cursor = format!("&cursor={}", super::api::encode(next)),
            None => break,
        }
    }
    if as_json {
        return Ok(());
    }
    if rows.is_empty() {
        return output::line("no snapshots");
    }
    let header = ["id", "made", "origin", ">classes", ">shapes", ">bytes"];
    output::line(&output::table(&header, &rows))
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

fn tell(as_json: bool, value: &Value, line: impl FnOnce() -> String) -> Result<(), CliError> {
    if as_json {
        output::json(value)
    } else {
        output::line(&line())
    }
}
