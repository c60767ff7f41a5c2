//! What an operator's probes ask.

use crate::http::AppState;
use crate::http::access::Access;
use crate::http::gauges;
use crate::http::problem::{Code, Problem};
use crate::http::route::Route;
use crate::http::state::Condition;
use crate::model::Scope;
use crate::store::ScrubReport;
use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use serde::Serialize;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    use Code::*;
    vec![
        Route::new(routes!(get_liveness), Access::Probe, &[]),
        Route::new(routes!(get_readiness), Access::Probe, &[&[NotReady]]),
        Route::new(routes!(get_metrics), Access::Needs(Scope::Read), &[]),
    ]
}

/// That the process answers.
#[derive(Serialize, ToSchema)]
pub struct Liveness {
    /// `ok`.
    pub status: &'static str,
    /// The service's version.
    pub version: &'static str,
}

/// That the service can work.
#[derive(Serialize, ToSchema)]
pub struct Ready {
    /// `ready`.
    pub status: &'static str,
    /// Every part that was looked at: `ok`, or `degraded: ` and what an operator should look at.
    #[schema(example = json!({"store": "ok", "integrity": "ok"}))]
    pub checks: BTreeMap<&'static str, String>,
    /// The last check of all stored files and records; missing before the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_scrub: Option<Scrubbed>,
}

/// What a check of all stored files and records found.
#[derive(Serialize, ToSchema)]
pub struct Scrubbed {
    /// When it ended.
    #[schema(format = DateTime)]
    pub finished_at: String,
    /// Uploaded files that were read.
    pub originals: u64,
    /// Records that were read.
    pub records: u64,
    /// Uploaded files that were damaged or gone.
    pub damaged_originals: usize,
    /// Records that were damaged.
    pub damaged_records: usize,
}

impl From<ScrubReport> for Scrubbed {
    fn from(report: ScrubReport) -> Self {
        Self {
            finished_at: report.finished_at.to_string(),
            originals: report.originals,
            records: report.records,
            damaged_originals: report.damaged_originals.len(),
            damaged_records: report.damaged_records.len(),
        }
    }
}

/// Is the process alive?
#[utoipa::path(
    get, path = "/healthz", tag = "operation",
    responses((status = 200, description = "It is", body = Liveness))
)]
pub async fn get_liveness() -> Json<Liveness> {
    Json(Liveness {
        status: "ok",
        version: env!("CARGO_PKG_VERSION"),
    })
}

/// Is the service ready?
///
/// The problem names every part that is not, under `checks`. A part that is `degraded` keeps the service from nothing,
/// such as `integrity` where an uploaded file is damaged.
#[utoipa::path(
    get, path = "/readyz", tag = "operation",
    responses((status = 200, description = "It is", body = Ready))
)]
pub async fn get_readiness(State(state): State<AppState>) -> Result<Json<Ready>, Problem> {
    let readiness = state.readiness();
    let down: Vec<&str> = readiness
        .checks
        .iter()
        .filter(|(_, condition)| matches!(condition, Condition::Down(_)))
        .map(|(part, _)| *part)
        .collect();
    let detail = format!("not ready: {}", down.join(", "));
    let ready = readiness.is_ready();
    let checks: BTreeMap<&str, String> = readiness
        .checks
        .into_iter()
        .map(|(part, condition)| {
            let shown = match condition {
                Condition::Well => "ok".to_owned(),
                Condition::Degraded(why) => format!("degraded: {why}"),
                Condition::Down(why) => why,
            };
            (part, shown)
        })
        .collect();
    if ready {
        return Ok(Json(Ready {
            status: "ready",
            checks,
            last_scrub: state.store.last_scrub().map(Into::into),
        }));
    }
    let checks: Map<String, Value> = checks
        .into_iter()
        .map(|(part, shown)| (part.to_owned(), shown.into()))
        .collect();
    Err(Problem::new(Code::NotReady, detail).with("checks", checks))
}

/// Show the metrics
///
/// In the Prometheus text format.
#[utoipa::path(
    get, path = "/metrics", tag = "operation",
    responses((status = 200, description = "All series", body = String, content_type = "text/plain"))
)]
pub async fn get_metrics(State(state): State<AppState>) -> Result<impl IntoResponse, Problem> {
    let shared = state.clone();
    let text = state.blocking(move |_| Ok(gauges::render(&shared))).await?;
    Ok((
        [(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")],
        text,
    ))
}
