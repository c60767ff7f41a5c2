//! A job, followed to its end.

use super::CliError;
use super::client::{Client, Payload};
use super::encode::encode;
use super::outcome::CallError;
use super::progress::Progress;
use serde_json::Value;
use std::ops::ControlFlow;
use std::time::Duration;

/// Time before a stream of events that broke off is asked for again.
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// Times in a row that a service may be out of reach before the command gives up; the job goes on without it.
const ATTEMPTS: usize = 30;

/// Shows a job's steps on stderr until it ends; the answer is the job as it ended. A connection that breaks off is made
/// again, as the job does not depend on it.
///
/// # Errors
/// [`CliError::Failed`] where the service stays out of reach.
pub fn follow(client: &Client, job: Value) -> Result<Value, CliError> {
    let id = job["id"]
        .as_str()
        .ok_or_else(|| CliError::Failed("the service's answer names no job".to_owned()))?
        .to_owned();
    let path = format!("/v1/jobs/{}", encode(&id));
    let mut steps = Steps::default();
    steps.show(&job);
    let mut job = job;
    let mut failures = 0;
    while !has_ended(&job) {
        let outcome = client.events(&format!("{path}/events"), &mut |event| {
            steps.show(&event);
            job = event;
            failures = 0;
            if has_ended(&job) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        match outcome {
            _ if has_ended(&job) => break,
            // The service is going down, or a proxy cut the stream.
            Ok(()) | Err(CallError::Unreachable(_)) if failures < ATTEMPTS => {
                failures += 1;
                std::thread::sleep(AGAIN_AFTER);
                match client.call("GET", &path, Payload::Empty) {
                    Ok(now) => job = now,
                    Err(CallError::Unreachable(_)) => {}
                    Err(error) => return Err(error.into()),
                }
            }
            Ok(()) => {
                return Err(CliError::Failed(format!(
                    "the service ends the events of job {id} again and again; ask with `shapelex jobs show {id}`"
                )));
            }
            Err(error) => return Err(error.into()),
        }
    }
    steps.end();
    Ok(job)
}

/// The job, where it succeeded.
///
/// # Errors
/// [`CliError::Failed`] with the job's reason where it did not.
pub fn succeeded(job: Value) -> Result<Value, CliError> {
    match job["state"].as_str() {
        Some("succeeded") => Ok(job),
        Some("cancelled" | "canceled") => Err(CliError::Failed("the reindex was cancelled".to_owned())),
        _ => {
            let detail = job["failure"]["detail"].as_str().unwrap_or("no reason given");
            Err(CliError::Failed(format!("the reindex failed: {detail}")))
        }
    }
}

fn has_ended(job: &Value) -> bool {
    matches!(
        job["state"].as_str(),
        Some("succeeded" | "failed" | "cancelled" | "canceled")
    )
}

/// The progress of a job's steps, one after the other.
#[derive(Default)]
struct Steps {
    shown: Option<(String, Progress)>,
}

impl Steps {
    fn show(&mut self, job: &Value) {
        let steps = job["steps"].as_array().map(Vec::as_slice).unwrap_or_default();
        for (i, step) in steps.iter().enumerate() {
            let name = step["name"].as_str().unwrap_or("reindex");
            let number = |key: &str| step[key].as_u64().unwrap_or(0) as usize;
            match &self.shown {
                Some((current, progress)) if current == name => {
                    progress.set(number("finished"), number("total"));
                }
                _ if i + 1 == steps.len() => {
                    self.end();
                    let progress = Progress::new(name, number("total"));
                    progress.set(number("finished"), number("total"));
                    self.shown = Some((name.to_owned(), progress));
                }
                _ => {}
            }
        }
    }

    fn end(&mut self) {
        if let Some((_, progress)) = self.shown.take() {
            progress.finish();
        }
    }
}
