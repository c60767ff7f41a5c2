//! `shapelex jobs`: background work, listed, shown, followed and cancelled.

use super::client::{Client, Payload, TargetArgs};
use super::encode::encode;
use super::follow::{follow, succeeded};
use super::listing::{self, Column};
use super::{CliError, reindex};
use serde_json::Value;

const COLUMNS: [Column; 6] = [
    ("id", "id"),
    ("kind", "kind"),
    ("state", "state"),
    ("asked for", "enqueued_at"),
    ("ended", "finished_at"),
    (">generation", "generation"),
];
const DETAILS: [Column; 8] = [
    ("id", "id"),
    ("kind", "kind"),
    ("state", "state"),
    ("failure", "failure.detail"),
    ("asked for", "enqueued_at"),
    ("begun", "started_at"),
    ("ended", "finished_at"),
    ("generation", "generation"),
];

/// Arguments of `jobs`.
#[derive(Debug, clap::Args)]
pub struct JobsArgs {
    /// What to do.
    #[command(subcommand)]
    pub command: JobsCommand,
}

/// What can be done with jobs.
#[derive(Debug, clap::Subcommand)]
pub enum JobsCommand {
    /// List the jobs, the latest first
    List(TargetArgs),
    /// Show a job
    Show(OneJob),
    /// Wait until a job ends and show how far it is
    Follow(OneJob),
    /// Stop a job; the index stays as it is
    Cancel(OneJob),
}

/// A job and where it is.
#[derive(Debug, clap::Args)]
pub struct OneJob {
    /// The job's id [default: the latest]
    pub job: Option<String>,
    /// Where the jobs are.
    #[command(flatten)]
    pub target: TargetArgs,
}

/// Does what is asked for.
///
/// # Errors
/// [`CliError::Failed`] where a followed job did not succeed; [`CliError::Refused`] where the service refuses.
pub fn run(args: &JobsArgs, as_json: bool) -> Result<(), CliError> {
    match &args.command {
        JobsCommand::List(target) => {
            let jobs = listing::all(&target.client()?, "/v1/jobs")?;
            listing::print(&jobs, &COLUMNS, "there are no jobs", as_json)
        }
        JobsCommand::Show(one) => listing::print_one(&one.find(&one.target.client()?)?, &DETAILS, as_json),
        JobsCommand::Follow(one) => {
            let client = one.target.client()?;
            let ended = follow(&client, one.find(&client)?)?;
            if as_json {
                listing::print_one(&ended, &DETAILS, true)?;
                return succeeded(ended).map(drop);
            }
            let ended = succeeded(ended)?;
            listing::tell(false, &ended, || reindex::text(&ended))
        }
        JobsCommand::Cancel(one) => {
            let client = one.target.client()?;
            let id = listing::cell(&one.find(&client)?, "id");
            let job = client.call(
                "POST",
                &format!("/v1/jobs/{}/cancel", encode(&id)),
                Payload::Empty,
            )?;
            listing::tell(as_json, &job, || format!("job {id} is being stopped"))
        }
    }
}

impl OneJob {
    fn find(&self, client: &Client) -> Result<Value, CliError> {
        if let Some(job) = &self.job {
            return Ok(client.call("GET", &format!("/v1/jobs/{}", encode(job)), Payload::Empty)?);
        }
        let latest = client.call("GET", "/v1/jobs?limit=1", Payload::Empty)?;
        match latest["items"].get(0) {
            Some(job) => Ok(job.clone()),
            None => Err(CliError::Failed("there are no jobs".to_owned())),
        }
    }
}
