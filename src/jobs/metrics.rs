//! What is counted of jobs: how they ended and how long they took.

use crate::model::{Job, JobState};
use metrics::{counter, describe_counter, describe_histogram, histogram};

/// Jobs that ended, by outcome.
pub const JOBS: &str = "shapelex_jobs_total";
/// Seconds from a job's start to its end, by outcome.
pub const JOB_SECONDS: &str = "shapelex_job_seconds";

/// Describes the series, and makes each exist at zero.
pub fn describe() {
    describe_counter!(JOBS, "Jobs that ended, by outcome");
    describe_histogram!(JOB_SECONDS, "Seconds from a job's start to its end, by outcome");
    for state in JobState::ALL.into_iter().filter(|state| state.is_finished()) {
        counter!(JOBS, "outcome" => state.name()).increment(0);
        let _ = histogram!(JOB_SECONDS, "outcome" => state.name());
    }
}

/// Counts a job that has ended; one that was cancelled before it began took no time.
pub(super) fn count(job: &Job) {
    counter!(JOBS, "outcome" => job.state.name()).increment(1);
    if let (Some(started), Some(finished)) = (job.started_at, job.finished_at) {
        let seconds = finished.duration_since(started).as_secs_f64();
        histogram!(JOB_SECONDS, "outcome" => job.state.name()).record(seconds.max(0.0));
    }
}
