//! `shapelex reindex`: learns the dictionaries of shapes that are there.

use super::client::TargetArgs;
use super::output::note_line;
use super::{CliError, ParameterArgs, api, listing};
use serde_json::{Value, json};

/// Arguments of `reindex`.
#[derive(Debug, clap::Args)]
pub struct ReindexArgs {
    /// Learn this class, by name or id, whether it changed or not; may be repeated [default: those that changed]
    #[arg(long = "class", value_name = "CLASS", conflicts_with = "all")]
    pub classes: Vec<String>,
    /// Learn every class
    #[arg(long)]
    pub all: bool,
    /// Where the index is.
    #[command(flatten)]
    pub target: TargetArgs,
    /// The method's parameters; those the index has where they are left out.
    #[command(flatten)]
    pub parameters: ParameterArgs,
}

impl ReindexArgs {
    /// The scope as the API takes it.
    fn scope(&self) -> Value {
        match (self.all, self.classes.as_slice()) {
            (true, _) => json!("all"),
            (false, []) => json!("stale"),
            (false, classes) => json!({ "classes": classes }),
        }
    }
}

/// Starts the job and follows it.
///
/// # Errors
/// [`CliError::Usage`] for a wrong parameter; [`CliError::Failed`] where the job failed; [`CliError::Reported`] where
/// shapes were left out.
pub fn run(args: &ReindexArgs, as_json: bool) -> Result<(), CliError> {
    args.parameters.parameters()?;
    let client = args.target.client()?;
    let job = api::reindex(&client, &args.parameters, args.scope())?;
    listing::tell(as_json, &job, || text(&job))?;
    warn_of_failed_shapes(&job)
}

/// What a reindex did, in words.
pub fn text(job: &Value) -> String {
    let result = &job["result"];
    let count = |member: &str| result[member].as_array().map_or(0, Vec::len);
    let mut text = format!(
        "classes learnt: {}, kept: {}; index generation {}",
        count("relearned"),
        count("reused"),
        listing::cell(job, "generation")
    );
    for skipped in result["skipped"].as_array().into_iter().flatten() {
        let name = listing::cell(skipped, "class.name");
        text += &format!(
            "\nclass {name} was left out: {}",
            listing::cell(skipped, "reason")
        );
    }
    text
}

/// Names the shapes that could not be learnt on stderr.
///
/// # Errors
/// [`CliError::Reported`] where there are some.
pub fn warn_of_failed_shapes(job: &Value) -> Result<(), CliError> {
    let failed = job["result"]["failed_shapes"]
        .as_array()
        .map(Vec::as_slice)
        .unwrap_or_default();
    for shape in failed {
        note_line!(
            "shapelex: shape {} of class {} was left out: {}",
            listing::cell(shape, "shape"),
            listing::cell(shape, "class"),
            listing::cell(shape, "detail")
        );
    }
    if failed.is_empty() {
        Ok(())
    } else {
        Err(CliError::Reported)
    }
}
