//! `shapelex shapes`: the training shapes of a class.

use super::CliError;
use super::client::{Payload, TargetArgs};
use super::confirm::ConfirmArgs;
use super::encode::encode;
use super::listing::{self, Column};
use serde_json::json;
use std::path::{Path, PathBuf};

const COLUMNS: [Column; 6] = [
    ("name", "name"),
    ("pose", "pose.label"),
    ("format", "format"),
    (">bytes", "bytes"),
    (">vertices", "report.vertices"),
    ("id", "id"),
];
const DETAILS: [Column; 8] = [
    ("name", "name"),
    ("id", "id"),
    ("pose", "pose.label"),
    ("format", "format"),
    ("bytes", "bytes"),
    ("hash", "hash"),
    ("mesh", "report.summary"),
    ("made", "created_at"),
];

/// Arguments of `shapes`.
#[derive(Debug, clap::Args)]
pub struct ShapesArgs {
    /// What to do.
    #[command(subcommand)]
    pub command: ShapesCommand,
}

/// A shape of a class.
#[derive(Clone, Debug, clap::Args)]
pub struct OneShape {
    /// The class's name or id
    pub class: String,
    /// The shape's id, as `shapes list` shows it
    pub shape: String,
}

/// What can be done with shapes.
#[derive(Debug, clap::Subcommand)]
pub enum ShapesCommand {
    /// List the shapes of a class
    List {
        /// The class's name or id
        class: String,
        /// Where the index is.
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Show a shape
    Show {
        /// Which.
        #[command(flatten)]
        shape: OneShape,
        /// Where the index is.
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Delete a shape; `reindex` then learns its class again
    Delete {
        /// Which.
        #[command(flatten)]
        shape: OneShape,
        /// Whether it is asked before.
        #[command(flatten)]
        confirm: ConfirmArgs,
        /// Where the index is.
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Save the file a shape came from
    Download {
        /// Which.
        #[command(flatten)]
        shape: OneShape,
        /// File to write [default: the name it was uploaded under]
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
        /// Where the index is.
        #[command(flatten)]
        target: TargetArgs,
    },
}

impl OneShape {
    fn path(&self) -> String {
        format!(
            "/v1/classes/{}/shapes/{}",
            encode(&self.class),
            encode(&self.shape)
        )
    }
}

/// Does what is asked for.
///
/// # Errors
/// [`CliError::Usage`] where it would have to ask and cannot; [`CliError::Refused`] where the service refuses;
/// [`CliError::Failed`] where a file cannot be written.
pub fn run(args: &ShapesArgs, as_json: bool) -> Result<(), CliError> {
    match &args.command {
        ShapesCommand::List { class, target } => {
            let path = format!("/v1/classes/{}/shapes", encode(class));
            let shapes = listing::all(&target.client()?, &path)?;
            listing::print(&shapes, &COLUMNS, "the class has no shapes", as_json)
        }
        ShapesCommand::Show { shape, target } => {
            let found = target.client()?.call("GET", &shape.path(), Payload::Empty)?;
            listing::print_one(&found, &DETAILS, as_json)
        }
        ShapesCommand::Delete {
            shape,
            confirm,
            target,
        } => {
            confirm.can_ask()?;
            let client = target.client()?;
            let found = client.call("GET", &shape.path(), Payload::Empty)?;
            let name = listing::cell(&found, "name");
            confirm.ask(&format!("Delete shape {name} of class {}", shape.class))?;
            client.call("DELETE", &shape.path(), Payload::Empty)?;
            let told = json!({ "deleted": found["id"], "name": found["name"] });
            listing::tell(as_json, &told, || {
                format!("deleted shape {name} of class {}", shape.class)
            })
        }
        ShapesCommand::Download { shape, out, target } => download(shape, out.as_deref(), target, as_json),
    }
}

/// A file that is there is not written over unless it is named.
fn download(
    shape: &OneShape,
    out: Option<&Path>,
    target: &TargetArgs,
    as_json: bool,
) -> Result<(), CliError> {
    let client = target.client()?;
    let out = match out {
        Some(out) => out.to_owned(),
        None => {
            let found = client.call("GET", &shape.path(), Payload::Empty)?;
            let name = listing::cell(&found, "name");
            // A name may be anything that was sent; only its last part is taken.
            let file = Path::new(&name).file_name().map(PathBuf::from);
            let fallback = || PathBuf::from(format!("{}.{}", shape.shape, listing::cell(&found, "format")));
            let out = file.unwrap_or_else(fallback);
            if out.exists() {
                return Err(CliError::at(
                    &out,
                    "this file is there already; --out FILE names another",
                ));
            }
            out
        }
    };
    let bytes = client.download(&format!("{}/original", shape.path()), &out)?;
    let told = json!({ "file": out.display().to_string(), "bytes": bytes });
    listing::tell(as_json, &told, || format!("{bytes} bytes in {}", out.display()))
}
