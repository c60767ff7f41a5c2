//! Background work: asked for, listed, shown, cancelled, followed.

use super::classes::{find_class, insert};
use crate::http::AppState;
use crate::http::access::Access;
use crate::http::caller::Caller;
use crate::http::dto::job::{JobDto, JobEvent, ScopeDto, StartReindex};
use crate::http::dto::{Page, PageQuery};
use crate::http::extract::{ApiPath, ApiQuery, OptionalJson};
use crate::http::problem::{Code, Problem};
use crate::http::problem_sets::{JSON, PAGE, WRITE};
use crate::http::request_memory::{counted_event, page_memory};
use crate::http::route::Route;
use crate::http::state::Parts;
use crate::jobs::JobError;
use crate::model::Scope;
use crate::model::{ContentHash, Job, JobId, JobKind, ReindexScope};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, StreamExt, stream};
use shapelex_core::parameters::Parameters;
use std::convert::Infallible;
use std::sync::PoisonError;
use tokio_stream::wrappers::WatchStream;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    use Code::*;
    vec![
        Route::new(
            routes!(start_reindex),
            Access::Needs(Scope::Write),
            &[
                JSON,
                WRITE,
                &[
                    InvalidRequest,
                    IdempotencyKeyReused,
                    InvalidParameter,
                    ClassNotFound,
                    NothingToIndex,
                    QueueFull,
                    ShuttingDown,
                ],
            ],
        ),
        Route::new(routes!(list_jobs), Access::Needs(Scope::Read), &[PAGE]),
        Route::new(
            routes!(get_job),
            Access::Needs(Scope::Read),
            &[&[InvalidRequest, JobNotFound]],
        ),
        Route::new(
            routes!(cancel_job),
            Access::Needs(Scope::Write),
            &[WRITE, &[InvalidRequest, JobNotFound, JobFinished]],
        ),
        Route::new(
            routes!(follow_job),
            Access::Needs(Scope::Read),
            &[&[InvalidRequest, JobNotFound]],
        ),
    ]
}

/// Start a reindex
///
/// Learns the dictionaries of classes in the background and then switches to a new generation of the index at once.
/// Queries go on against the old one meanwhile. The answer is a job to follow.
#[utoipa::path(
    post, path = "/v1/reindex", tag = "jobs",
    params(("idempotency-key" = Option<String>, Header, min_length = 1, max_length = 200,
            pattern = "^[!-~]+$", description = "1 to 200 visible characters of the client's \
            choice. The same key with the same body within 24 hours gets the same job")),
    request_body(content = Option<StartReindex>, description = "May be left out"),
    responses((status = 202, description = "The job", body = JobDto, headers(
        ("location" = String, description = "Where the job is"),
    )))
)]
pub async fn start_reindex(
    State(state): State<AppState>,
    caller: Caller,
    headers: HeaderMap,
    OptionalJson(body): OptionalJson<StartReindex>,
) -> Result<Response, Problem> {
    let answers = match idempotency_key(&headers, &caller)? {
        Some(key) => Some((
            key,
            ContentHash::of(&serde_json::to_vec(&body).map_err(Problem::internal)?),
        )),
        None => None,
    };
    let job = state
        .blocking(move |s| {
            let _alone = s.catalogue.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((key, request)) = answers
                && let Some(job) = started_before(s, key, request)?
            {
                return Ok(job);
            }
            let kind = JobKind::Reindex {
                parameters: parameters(s, &body)?,
                scope: scope(s, body.scope)?,
            };
            // With an index the job would empty it, which is right after the last class was deleted. Without one it
            // would do nothing.
            if s.jobs.live_index().generation.is_none() && s.store.statistics()?.shapes == 0 {
                return Err(Problem::new(
                    Code::NothingToIndex,
                    "no class has a shape yet; POST meshes to /v1/classes/{class}/shapes first",
                ));
            }
            Ok(s.jobs.enqueue_answering(kind, answers)?)
        })
        .await?;
    let location = format!("/v1/jobs/{}", job.id);
    let mut response = (StatusCode::ACCEPTED, Json(JobDto::from(job))).into_response();
    insert(&mut response, header::LOCATION, &location);
    Ok(response)
}

/// The client's key, made one with who it is: two callers may choose the same.
fn idempotency_key(headers: &HeaderMap, caller: &Caller) -> Result<Option<ContentHash>, Problem> {
    let Some(value) = headers.get("idempotency-key") else {
        return Ok(None);
    };
    let bytes = value.as_bytes();
    if !(1..=200).contains(&bytes.len()) || !bytes.iter().all(u8::is_ascii_graphic) {
        return Err(Problem::new(
            Code::InvalidRequest,
            "an idempotency-key has 1 to 200 visible ASCII characters",
        )
        .with("name", "idempotency-key"));
    }
    let who = caller.key.as_ref().map_or([0; 16], |key| key.id.to_bytes());
    Ok(Some(ContentHash::of(&[&who[..], bytes].concat())))
}

/// The job this key started before, where it is still known.
fn started_before(parts: &Parts, key: ContentHash, request: ContentHash) -> Result<Option<Job>, Problem> {
    let Some(known) = parts.store.remembered(key, jiff::Timestamp::now())? else {
        return Ok(None);
    };
    if known.request != request {
        return Err(Problem::new(
            Code::IdempotencyKeyReused,
            "this idempotency-key started another job with another body; take a new key",
        )
        .with("job", known.job.to_string()));
    }
    match parts.jobs.job(known.job) {
        Ok(job) => Ok(Some(job)),
        Err(JobError::NoJob { .. }) => Ok(None),
        Err(other) => Err(other.into()),
    }
}

/// `None` where nothing was asked for and there is an index whose parameters can stay.
fn parameters(parts: &Parts, body: &StartReindex) -> Result<Option<Parameters>, Problem> {
    let first = parts.jobs.live_index().generation.is_none();
    let asked = body.preset.is_some() || body.parameters.is_some();
    if !asked && !first {
        return Ok(None);
    }
    let base = match body.preset {
        Some(preset) => Parameters::preset(preset.into()),
        None if first => Parameters::preset(parts.config.preset),
        None => parts.store.parameters()?,
    };
    let parameters = body.parameters.clone().unwrap_or_default().apply(base);
    parameters.validate()?;
    Ok(Some(parameters))
}

/// Classes that a reindex may name. Jobs are kept with their classes, while they wait in memory, too.
const MAX_NAMED: usize = 1000;

fn scope(parts: &Parts, scope: ScopeDto) -> Result<ReindexScope, Problem> {
    Ok(match scope {
        ScopeDto::Stale => ReindexScope::Stale,
        ScopeDto::All => ReindexScope::All,
        ScopeDto::Classes(classes) if classes.is_empty() => {
            return Err(Problem::new(
                Code::InvalidField,
                "scope.classes names no class; name some, or use \"all\" or \"stale\"",
            )
            .with("name", "scope.classes"));
        }
        ScopeDto::Classes(classes) if classes.len() > MAX_NAMED => {
            return Err(Problem::new(
                Code::InvalidField,
                format!(
                    "scope.classes names {} classes, at most {MAX_NAMED}; use \"all\" or \"stale\", or several reindexes",
                    classes.len()
                ),
            )
            .with("name", "scope.classes")
            .with("limit", MAX_NAMED));
        }
        ScopeDto::Classes(classes) => {
            let mut ids = Vec::with_capacity(classes.len());
            for class in classes {
                let id = find_class(&parts.store, &class)?.id;
                if !ids.contains(&id) {
                    ids.push(id);
                }
            }
            ReindexScope::Classes(ids)
        }
    })
}

/// List jobs
///
/// The latest first.
#[utoipa::path(
    get, path = "/v1/jobs", tag = "jobs", params(PageQuery),
    responses((status = 200, description = "A page of jobs", body = Page<JobDto>))
)]
pub async fn list_jobs(
    State(state): State<AppState>,
    ApiQuery(page): ApiQuery<PageQuery>,
) -> Result<Json<Page<JobDto>>, Problem> {
    let (limit, before) = (page.limit()?, page.after::<JobId>("jobs")?);
    let (found, _memory) = state
        .blocking(move |s| {
            let memory = s.memory.reservation();
            let found = s.jobs.page(before, limit, page_memory(&memory))?;
            Ok((found, memory))
        })
        .await?;
    Ok(Json(Page::of(
        "jobs",
        found,
        |job| job.id.to_string(),
        Into::into,
    )))
}

/// Show a job
#[utoipa::path(
    get, path = "/v1/jobs/{job}", tag = "jobs",
    params(("job" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The job", body = JobDto))
)]
pub async fn get_job(
    State(state): State<AppState>,
    ApiPath(job): ApiPath<String>,
) -> Result<Json<JobDto>, Problem> {
    let id = job_id(&job)?;
    let job = state.blocking(move |s| Ok(s.jobs.job(id)?)).await?;
    Ok(Json(job.into()))
}

/// Cancel a job
///
/// A waiting job ends at once, a running one at its next look; the index stays as it is.
#[utoipa::path(
    post, path = "/v1/jobs/{job}/cancel", tag = "jobs",
    params(("job" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The job, which may still be stopping", body = JobDto))
)]
pub async fn cancel_job(
    State(state): State<AppState>,
    ApiPath(job): ApiPath<String>,
) -> Result<Json<JobDto>, Problem> {
    let id = job_id(&job)?;
    let job = state.blocking(move |s| Ok(s.jobs.cancel(id)?)).await?;
    Ok(Json(job.into()))
}

/// Follow a job
///
/// As server-sent events: an event `progress` with the job as JSON whenever it changes. The stream ends after the
/// event with the final state; where `last-event-id` is that event's the answer is 204.
#[utoipa::path(
    get, path = "/v1/jobs/{job}/events", tag = "jobs",
    params(
        ("job" = String, Path, description = "The job's id"),
        ("last-event-id" = Option<String>, Header, description = "The id of the last event that arrived, as browsers send \
            it when they connect again. The events go on with greater ids, from the state the job has now"),
    ),
    responses(
        (status = 200, description = "Events", body = JobEvent, content_type = "text/event-stream"),
        (status = 204, description = "The final event has arrived before"),
    )
)]
pub async fn follow_job(
    State(state): State<AppState>,
    headers: HeaderMap,
    ApiPath(job): ApiPath<String>,
) -> Result<Response, Problem> {
    let id = job_id(&job)?;
    let seen = headers
        .get("last-event-id")
        .and_then(|value| value.to_str().ok()?.trim().parse().ok())
        .unwrap_or(0);
    let changes = state.blocking(move |s| Ok(s.jobs.subscribe(id)?)).await?;
    if ended_at(&changes.borrow()).is_some_and(|ended| seen >= ended) {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let stopping = state.stopping.clone();
    let mut events = Events::after(seen);
    let memory = state.memory.reservation();
    let events = until_finished(WatchStream::new(changes))
        .map(move |job| events.event(job))
        // A client whose events find no memory connects again, as one does whose connection breaks.
        .scan(memory, |memory, (event, bytes)| {
            std::future::ready(counted_event(memory, bytes).then_some(Ok::<_, Infallible>(event)))
        })
        .take_until(stopping.cancelled_owned());
    Ok(Sse::new(events).keep_alive(KeepAlive::default()).into_response())
}

/// When a job reached its final state, in microseconds since 1970.
fn ended_at(job: &Job) -> Option<u64> {
    let ended = job.finished_at.filter(|_| job.state.is_finished())?;
    u64::try_from(ended.as_microsecond()).ok()
}

/// Makes the events of one connection.
struct Events {
    /// The id of the last one.
    last: u64,
    first: bool,
}

impl Events {
    fn after(last: u64) -> Self {
        Self { last, first: true }
    }

    /// The event, and the bytes of its text.
    fn event(&mut self, job: Job) -> (Event, u64) {
        let now = u64::try_from(jiff::Timestamp::now().as_microsecond()).unwrap_or(0);
        let at = ended_at(&job).unwrap_or(now);
        self.last = at.max(self.last.saturating_add(1));
        // Strings, numbers and maps with string keys always serialise.
        let mut body = serde_json::to_value(JobDto::from(job)).unwrap_or_default();
        if !std::mem::take(&mut self.first)
            && let Some(members) = body.as_object_mut()
        {
            members.remove("parameters");
        }
        let text = body.to_string();
        let bytes = text.len() as u64;
        let event = Event::default()
            .event("progress")
            .id(self.last.to_string())
            .data(text);
        (event, bytes)
    }
}

/// The changes of a job up to and with its final state.
fn until_finished(changes: WatchStream<Job>) -> impl Stream<Item = Job> {
    stream::unfold(Some(changes), |changes| async move {
        let mut changes = changes?;
        let job = changes.next().await?;
        let rest = (!job.state.is_finished()).then_some(changes);
        Some((job, rest))
    })
}

fn job_id(text: &str) -> Result<JobId, Problem> {
    text.parse().map_err(|_| {
        let shown: String = text.chars().take(100).collect();
        Problem::new(Code::JobNotFound, format!("there is no job '{shown}'")).with("job", shown)
    })
}
