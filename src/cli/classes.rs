//! `shapelex classes`: the classes of an index.

use super::CliError;
use super::client::{Payload, TargetArgs};
use super::confirm::ConfirmArgs;
use super::encode::encode;
use super::listing::{self, Column};
use serde_json::json;

const COLUMNS: [Column; 5] = [
    ("name", "name"),
    (">shapes", "shapes"),
    (">bytes", "bytes"),
    ("index", "index_state"),
    ("id", "id"),
];
const DETAILS: [Column; 7] = [
    ("name", "name"),
    ("id", "id"),
    ("shapes", "shapes"),
    ("bytes", "bytes"),
    ("index", "index_state"),
    ("made", "created_at"),
    ("changed", "updated_at"),
];

/// Arguments of `classes`.
#[derive(Debug, clap::Args)]
pub struct ClassesArgs {
    /// What to do.
    #[command(subcommand)]
    pub command: ClassesCommand,
}

/// What can be done with classes.
#[derive(Debug, clap::Subcommand)]
pub enum ClassesCommand {
    /// List the classes
    List(TargetArgs),
    /// Show a class
    Show {
        /// The class's name or id
        class: String,
        /// Where the index is.
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Give a class another name; nothing has to be learnt again
    Rename {
        /// The class's name or id
        class: String,
        /// Its new name
        name: String,
        /// Where the index is.
        #[command(flatten)]
        target: TargetArgs,
    },
    /// Delete classes with all their shapes
    Delete {
        /// The classes' names or ids
        #[arg(required = true, value_name = "CLASS")]
        classes: Vec<String>,
        /// Whether it is asked before.
        #[command(flatten)]
        confirm: ConfirmArgs,
        /// Where the index is.
        #[command(flatten)]
        target: TargetArgs,
    },
}

/// Does what is asked for.
///
/// # Errors
/// [`CliError::Usage`] where it would have to ask and cannot; [`CliError::Refused`] where the service refuses.
pub fn run(args: &ClassesArgs, as_json: bool) -> Result<(), CliError> {
    match &args.command {
        ClassesCommand::List(target) => {
            let classes = listing::all(&target.client()?, "/v1/classes")?;
            listing::print(&classes, &COLUMNS, "there are no classes", as_json)
        }
        ClassesCommand::Show { class, target } => {
            let found = target.client()?.call("GET", &path(class), Payload::Empty)?;
            listing::print_one(&found, &DETAILS, as_json)
        }
        ClassesCommand::Rename { class, name, target } => {
            let body = Payload::Json(json!({ "name": name }));
            let renamed = target.client()?.call("PATCH", &path(class), body)?;
            let now = listing::cell(&renamed, "name");
            listing::tell(as_json, &renamed, || format!("class {class} is called {now} now"))
        }
        ClassesCommand::Delete {
            classes,
            confirm,
            target,
        } => delete(classes, *confirm, target, as_json),
    }
}

/// Looks for all of them before the first is deleted.
fn delete(
    classes: &[String],
    confirm: ConfirmArgs,
    target: &TargetArgs,
    as_json: bool,
) -> Result<(), CliError> {
    confirm.can_ask()?;
    let client = target.client()?;
    let found = classes
        .iter()
        .map(|class| client.call("GET", &path(class), Payload::Empty))
        .collect::<Result<Vec<_>, _>>()?;
    let shapes: u64 = found.iter().filter_map(|class| class["shapes"].as_u64()).sum();
    let names: Vec<String> = found.iter().map(|class| listing::cell(class, "name")).collect();
    confirm.ask(&format!("Delete {} with {shapes} shapes", names.join(", ")))?;
    for (class, name) in found.iter().zip(&names) {
        let id = listing::cell(class, "id");
        client.call("DELETE", &path(&id), Payload::Empty)?;
        let told = json!({ "deleted": name, "id": id, "shapes": class["shapes"] });
        listing::tell(as_json, &told, || {
            format!("deleted class {name} with {} shapes", class["shapes"])
        })?;
    }
    Ok(())
}

fn path(class: &str) -> String {
    format!("/v1/classes/{}", encode(class))
}
