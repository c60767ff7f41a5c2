//! What the service counts and times, in the Prometheus text format.
//!
//! Every series exists from the start, at zero, and labels come from closed lists only: operations of the route table,
//! stages of the pipeline, failure codes.

use super::operation::{Operations, UNMATCHED};
use super::problem::Code;
use crate::jobs::metrics::JOB_SECONDS;
use ::metrics::{counter, describe_counter, describe_gauge, describe_histogram, gauge, histogram};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use shapelex_core::pipeline::Stage;
use std::sync::OnceLock;
use std::time::Duration;

/// Upper bounds of the histograms' buckets, in seconds.
const BUCKETS: &[f64] = &[
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0,
];

/// Upper bounds of a reindex's time, in seconds.
const JOB_BUCKETS: &[f64] = &[1.0, 5.0, 10.0, 30.0, 60.0, 300.0, 600.0, 1800.0, 3600.0, 14_400.0];
/// Upper bounds of p-values: a query whose best class is below 0.05 is of none of the known classes.
const P_VALUE_BUCKETS: &[f64] = &[0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];

const REQUESTS: &str = "shapelex_http_requests_total";
const REQUEST_SECONDS: &str = "shapelex_http_request_seconds";
const PROBLEMS: &str = "shapelex_problems_total";
const STAGE_SECONDS: &str = "shapelex_stage_seconds";
const WAIT_SECONDS: &str = "shapelex_compute_wait_seconds";
const PANICS: &str = "shapelex_panics_total";
const ANSWERS: &str = "shapelex_query_answers_total";
const P_VALUES: &str = "shapelex_query_p_value";
const BUILD_INFO: &str = "shapelex_build_info";

static RECORDER: OnceLock<PrometheusHandle> = OnceLock::new();

/// Installs the process's recorder, once, with a series for each of the operations.
pub fn install(operations: &Operations) {
    RECORDER.get_or_init(|| {
        // Buckets are constants, so setting them fails for no value.
        let builder = PrometheusBuilder::new()
            .set_buckets(BUCKETS)
            .and_then(|builder| builder.set_buckets_for_metric(full(JOB_SECONDS), JOB_BUCKETS))
            .and_then(|builder| builder.set_buckets_for_metric(full(P_VALUES), P_VALUE_BUCKETS))
            .unwrap_or_else(|_| PrometheusBuilder::new());
        let recorder = builder.build_recorder();
        let handle = recorder.handle();
        if ::metrics::set_global_recorder(recorder).is_err() {
            tracing::warn!("another metrics recorder is installed; /metrics stays empty");
        }
        describe();
        zero(operations);
        handle
    });
}

/// Everything that was counted and set, in the text format; empty before [`install`].
pub fn text() -> String {
    RECORDER.get().map_or_else(String::new, |handle| {
        handle.run_upkeep();
        handle.render()
    })
}

fn full(name: &str) -> Matcher {
    Matcher::Full(name.to_owned())
}

fn describe() {
    crate::jobs::metrics::describe();
    metrics_process::Collector::default().describe();
    describe_counter!(
        ANSWERS,
        "Queries answered, by verdict: known (a class is possible), none_of_these, or not_judged"
    );
    describe_histogram!(P_VALUES, "p-value of the best class of a query that was judged");
    describe_gauge!(BUILD_INFO, "1, with the version that runs");
    describe_counter!(REQUESTS, "Requests answered, by operation and class of status");
    describe_histogram!(REQUEST_SECONDS, "Seconds until the answer began, by operation");
    describe_counter!(PROBLEMS, "Problems answered, by code");
    describe_histogram!(STAGE_SECONDS, "Seconds of a query's stages");
    describe_histogram!(WAIT_SECONDS, "Seconds a piece of work waited for a thread");
    describe_counter!(PANICS, "Panics that were caught");
    describe_gauge!(
        "shapelex_compute_running",
        "Pieces of work being done by the query threads"
    );
    describe_gauge!(
        "shapelex_compute_waiting",
        "Pieces of work waiting for a query thread"
    );
    describe_gauge!(
        "shapelex_memory_reserved_bytes",
        "Memory that requests have reserved, bodies included"
    );
    describe_gauge!("shapelex_memory_limit_bytes", "Memory that requests may reserve");
    describe_gauge!("shapelex_body_bytes", "Memory reserved for bodies");
    describe_gauge!("shapelex_connections", "Connections being served");
    describe_gauge!("shapelex_api_keys", "API keys, also expired ones");
    describe_gauge!("shapelex_jobs_pending", "Jobs waiting or being worked on");
    describe_gauge!("shapelex_classes", "Classes in the catalogue");
    describe_gauge!("shapelex_shapes", "Training shapes in the catalogue");
    describe_gauge!("shapelex_original_bytes", "Bytes of the training shapes' files");
    describe_gauge!(
        "shapelex_index_generation",
        "Generation of the index; 0 before the first"
    );
    describe_gauge!(
        "shapelex_index_classes",
        "Classes of the catalogue that the index knows"
    );
    describe_gauge!(
        "shapelex_disk_free_bytes",
        "Bytes the file system of the data directory has free"
    );
    describe_gauge!(
        "shapelex_damaged_originals",
        "Uploaded files found damaged or gone"
    );
    describe_gauge!("shapelex_damaged_records", "Records found damaged");
    describe_gauge!(
        "shapelex_scrub_timestamp_seconds",
        "When the last check of all stored files and records ended, in seconds since 1970; 0 before the first"
    );
    describe_gauge!("shapelex_scrub_originals", "Uploaded files the last check read");
    describe_gauge!("shapelex_scrub_records", "Records the last check read");
    describe_gauge!("shapelex_ready", "1 where the service is ready");
}

fn zero(operations: &Operations) {
    let known = operations.iter().map(|info| info.operation.clone());
    for operation in known.chain([UNMATCHED.to_owned()]) {
        for status in ["2xx", "3xx", "4xx", "5xx"] {
            counter!(REQUESTS, "operation" => operation.clone(), "status" => status).increment(0);
        }
        let _ = histogram!(REQUEST_SECONDS, "operation" => operation);
    }
    for code in Code::ALL {
        counter!(PROBLEMS, "code" => code.name()).increment(0);
    }
    for stage in STAGES {
        let _ = histogram!(STAGE_SECONDS, "stage" => stage.name());
    }
    let _ = histogram!(WAIT_SECONDS);
    counter!(PANICS).increment(0);
    for verdict in ["known", "none_of_these", "not_judged"] {
        counter!(ANSWERS, "verdict" => verdict).increment(0);
    }
    let _ = histogram!(P_VALUES);
    gauge!(BUILD_INFO, "version" => env!("CARGO_PKG_VERSION")).set(1.0);
}

const STAGES: [Stage; 6] = [
    Stage::Read,
    Stage::Prepare,
    Stage::Laplacian,
    Stage::Eigenpairs,
    Stage::Signatures,
    Stage::Ranking,
];

/// A request was answered.
pub fn count_request(operation: &str, status: u16, took: Duration) {
    let class = match status {
        0..=299 => "2xx",
        300..=399 => "3xx",
        400..=499 => "4xx",
        _ => "5xx",
    };
    counter!(REQUESTS, "operation" => operation.to_owned(), "status" => class).increment(1);
    histogram!(REQUEST_SECONDS, "operation" => operation.to_owned()).record(took.as_secs_f64());
}

/// A problem was answered, also as a line of a batch.
pub fn count_problem(code: Code) {
    counter!(PROBLEMS, "code" => code.name()).increment(1);
}

/// A stage of a query ended.
pub fn time_stage(stage: Stage, took: Duration) {
    histogram!(STAGE_SECONDS, "stage" => stage.name()).record(took.as_secs_f64());
}

/// A piece of work got its place.
pub fn time_wait(took: Duration) {
    histogram!(WAIT_SECONDS).record(took.as_secs_f64());
}

/// A query was answered: whether a class is possible, where that could be judged, and the best class's p-value.
pub fn count_answer(none_of_these: Option<bool>, p_value: Option<f64>) {
    let verdict = match none_of_these {
        Some(true) => "none_of_these",
        Some(false) => "known",
        None => "not_judged",
    };
    counter!(ANSWERS, "verdict" => verdict).increment(1);
    if let Some(p_value) = p_value {
        histogram!(P_VALUES).record(p_value);
    }
}

/// A panic was caught.
pub fn count_panic() {
    counter!(PANICS).increment(1);
}
