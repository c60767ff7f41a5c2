//! `shapelex index`: a folder per class → a learnt index.

use super::client::{Client, TargetArgs};
use super::confirm::ConfirmArgs;
use super::files::MeshFile;
use super::folders::{LabelledFile, labelled_files};
use super::outcome::CallError;
use super::progress::Progress;
use super::refused::Refused;
use super::values::at_least_one;
use super::{CliError, ParameterArgs, api, output, prune, reindex};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};
use shapelex_core::mesh::Limits;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

/// Uploads under way at the same time: enough to keep two cores and the disk busy.
const UPLOADS: usize = 4;

/// Arguments of `index`.
#[derive(Debug, clap::Args)]
pub struct IndexArgs {
    /// Folder with a folder per class, which may have subfolders; a file in DIR itself is a class of its own
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,
    /// Where the index is.
    #[command(flatten)]
    pub target: TargetArgs,
    /// Sample this many poses of every animated glTF; other files count once
    #[arg(long, value_name = "COUNT", value_parser = at_least_one)]
    pub poses: Option<usize>,
    /// Learn from the files that could be read even where others could not; the exit code is 1 then all the same
    #[arg(long)]
    pub keep_going: bool,
    /// Delete shapes and classes that are in the index but no longer in DIR; they are listed first
    #[arg(long)]
    pub prune: bool,
    /// Whether it is asked before.
    #[command(flatten)]
    pub confirm: ConfirmArgs,
    /// The method's parameters.
    #[command(flatten)]
    pub parameters: ParameterArgs,
}

/// What indexing led to.
#[derive(Debug, Default, Serialize)]
struct Report {
    /// Shapes added by class.
    added: BTreeMap<String, usize>,
    /// Shapes that were there already.
    existing: usize,
    /// Files that could not be used.
    refused: Vec<Refused>,
    /// What left the folder and was deleted, where it was asked for.
    pruned: Option<prune::Pruned>,
    /// The reindex, as the API tells it; `null` where there was none.
    job: Value,
    /// Wall-clock time of the whole.
    seconds: f64,
}

/// Uploads every file, then learns what is stale. A file that cannot be read stops it before the learning, unless
/// `--keep-going`; what was uploaded stays, so a second run goes on from there.
///
/// # Errors
/// [`CliError::Usage`] before anything is done; [`CliError::Reported`] where files were refused; [`CliError::Failed`]
/// where the service or the learning failed.
pub fn run(args: &IndexArgs, json: bool) -> Result<(), CliError> {
    let began = Instant::now();
    args.parameters.parameters()?;
    if args.prune {
        args.confirm.can_ask()?;
    }
    // A service has a limit of its own.
    let most = Limits::default().max_poses;
    if args.target.server.is_none() && args.poses.is_some_and(|poses| poses > most) {
        return Err(CliError::Usage(format!(
            "--poses: expected a whole number between 1 and {most}"
        )));
    }
    let files = labelled_files(&args.dir)?;
    let client = args.target.client_or_new()?;
    let mut report = upload_all(&client, &files, args.poses)?;
    let refused = !report.refused.is_empty();
    let learns = !refused || (args.keep_going && report.refused.len() < files.len());
    if args.prune && learns {
        report.pruned = Some(prune::prune(&client, &files, args.confirm)?);
    }
    if learns {
        report.job = api::reindex(&client, &args.parameters, json!("stale"))?;
    }
    report.seconds = began.elapsed().as_secs_f64();
    if json {
        output::json(&report)?;
    } else {
        output::line(&report.text(learns))?;
    }
    reindex::warn_of_failed_shapes(&report.job)?;
    if refused { Err(CliError::Reported) } else { Ok(()) }
}

/// Uploads every file, several at a time; goes on after one that is refused.
fn upload_all(client: &Client, files: &[LabelledFile], poses: Option<usize>) -> Result<Report, CliError> {
    let progress = Progress::new("upload", files.len());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(UPLOADS)
        .build()
        .map_err(|error| CliError::Failed(format!("no threads for uploading: {error}")))?;
    let outcomes: Vec<Result<api::Uploaded, CliError>> = pool.install(|| {
        files
            .par_iter()
            .map(|file| {
                let outcome = upload(client, file, poses);
                progress.tick();
                outcome
            })
            .collect()
    });
    progress.finish();
    let mut report = Report::default();
    for (file, outcome) in files.iter().zip(outcomes) {
        match outcome {
            Ok(uploaded) => {
                *report.added.entry(file.class.clone()).or_default() += uploaded.added;
                report.existing += uploaded.existing;
            }
            Err(error) => {
                let refused = Refused::new(&file.path, error);
                refused.warn();
                report.refused.push(refused);
            }
        }
    }
    Ok(report)
}

fn upload(client: &Client, file: &LabelledFile, poses: Option<usize>) -> Result<api::Uploaded, CliError> {
    let load = || MeshFile::load(&file.path, Limits::default().max_bytes);
    match api::upload(client, &file.class, load()?, poses) {
        Err(CallError::Refused { code, .. }) if poses.is_some() && code == "no_animation" => {
            Ok(api::upload(client, &file.class, load()?, None)?)
        }
        outcome => Ok(outcome?),
    }
}

impl Report {
    fn text(&self, learnt: bool) -> String {
        let rows: Vec<Vec<String>> = self
            .added
            .iter()
            .map(|(class, added)| vec![class.clone(), added.to_string()])
            .collect();
        let mut text = output::table(&["class", ">shapes added"], &rows);
        if self.existing > 0 {
            text += &format!("\nshapes that were there already: {}", self.existing);
        }
        if !self.refused.is_empty() {
            text += &format!("\nfiles refused: {}, see above", self.refused.len());
        }
        if let Some(pruned) = &self.pruned {
            text += &format!(
                "\ndeleted, no longer in the folder: {} shapes, {} classes",
                pruned.shapes.len(),
                pruned.classes.len()
            );
        }
        if learnt {
            text += &format!("\n{}, {:.1} s", reindex::text(&self.job), self.seconds);
        } else {
            text += "\nnothing was learnt; mend or remove the refused files, or use --keep-going";
        }
        text
    }
}
