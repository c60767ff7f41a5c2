//! Jobs on the wire.

use super::class::ClassRef;
use super::parameters::{ParameterOverrides, ParametersDto, PresetName};
use super::time;
use crate::model::{Job, JobKind, ReindexReport, ReindexScope};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

/// Which classes are learnt again.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ScopeDto {
    /// Those whose shapes or parameters changed, and those never learnt.
    #[default]
    Stale,
    /// Every class.
    All,
    /// These, by id or name, at most 1000, and no others: those keep what the index has of them.
    Classes(Vec<String>),
}

/// What a scope may be, for messages.
const SCOPES: &str = "\"stale\", \"all\" or {\"classes\": [\"…\"]}";

impl<'de> Deserialize<'de> for ScopeDto {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        Self::of(&value).ok_or_else(|| {
            let shown: String = value.to_string().chars().take(100).collect();
            D::Error::custom(format!("expected {SCOPES}, found {shown}"))
        })
    }
}

impl ScopeDto {
    fn of(value: &Value) -> Option<Self> {
        match value {
            Value::Null => Some(Self::default()),
            Value::String(name) => match name.as_str() {
                "stale" => Some(Self::Stale),
                "all" => Some(Self::All),
                _ => None,
            },
            Value::Object(members) if members.len() == 1 => {
                let names = members.get("classes")?.as_array()?.iter();
                let names = names.map(|name| name.as_str().map(str::to_owned));
                names.collect::<Option<_>>().map(Self::Classes)
            }
            _ => None,
        }
    }
}

/// A reindex. Everything may be left out: `{}` and an empty body learn what is stale with the parameters the index
/// has.
#[derive(Clone, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(example = json!({"scope": "stale", "preset": "default", "parameters": {"atoms": 128}}))]
pub struct StartReindex {
    /// Which classes; `stale` where it is left out or `null`.
    #[schema(value_type = Option<ScopeDto>)]
    pub scope: ScopeDto,
    /// Start from the values of this preset instead of those the index has.
    pub preset: Option<PresetName>,
    /// Single values on top. Changed values make every class stale.
    #[serde(deserialize_with = "crate::http::extract::object")]
    pub parameters: Option<ParameterOverrides>,
}

/// An event of a job's stream.
#[derive(ToSchema)]
#[allow(dead_code, reason = "only its schema is used; the events are written by axum")]
pub struct JobEvent {
    /// `progress`.
    pub event: String,
    /// Grows from event to event of a job, over connections and restarts too: microseconds since 1970. A connection that
    /// gives it back as `last-event-id` after the final event gets 204, after which browsers do not connect again.
    pub id: String,
    /// The job as JSON text, see `JobDto`; `parameters` only in the first event of a connection.
    pub data: String,
}

/// One step of a job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct StepDto {
    /// What is counted.
    pub name: String,
    /// How many are done.
    pub finished: usize,
    /// How many there are.
    pub total: usize,
}

/// Why a job failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct JobFailureDto {
    /// A stable code to act on.
    pub code: String,
    /// One sentence.
    pub detail: String,
}

/// A class that was learnt.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct RelearnedDto {
    /// The class.
    pub class: ClassRef,
    /// Shapes it was learnt from.
    pub shapes: usize,
}

/// A class that was left out of the index.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct SkippedDto {
    /// The class.
    pub class: ClassRef,
    /// One sentence.
    pub reason: String,
}

/// A shape that was left out of its class.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct FailedShapeDto {
    /// The class's id.
    pub class: String,
    /// The shape's id.
    pub shape: String,
    /// A stable code to act on.
    pub code: String,
    /// One sentence.
    pub detail: String,
}

/// What a reindex did.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, ToSchema)]
pub struct ReindexResult {
    /// Classes that were learnt.
    pub relearned: Vec<RelearnedDto>,
    /// Ids of classes that kept their dictionaries.
    pub reused: Vec<String>,
    /// Classes left out of the index.
    pub skipped: Vec<SkippedDto>,
    /// Shapes left out of their class.
    pub failed_shapes: Vec<FailedShapeDto>,
    /// Shapes whose signatures were computed.
    pub described: usize,
    /// Shapes whose signatures were known from before.
    pub described_before: usize,
}

impl From<ReindexReport> for ReindexResult {
    fn from(report: ReindexReport) -> Self {
        Self {
            relearned: report
                .relearned
                .into_iter()
                .map(|c| RelearnedDto {
                    class: ClassRef {
                        id: c.class.to_string(),
                        name: c.name,
                    },
                    shapes: c.shapes,
                })
                .collect(),
            reused: report.reused.iter().map(ToString::to_string).collect(),
            skipped: report
                .skipped
                .into_iter()
                .map(|c| SkippedDto {
                    class: ClassRef {
                        id: c.class.to_string(),
                        name: c.name,
                    },
                    reason: c.reason,
                })
                .collect(),
            failed_shapes: report
                .failed_shapes
                .into_iter()
                .map(|s| FailedShapeDto {
                    class: s.class.to_string(),
                    shape: s.shape.to_string(),
                    code: s.code,
                    detail: s.detail,
                })
                .collect(),
            described: report.described,
            described_before: report.described_before,
        }
    }
}

/// Where a job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobStateDto {
    /// Waits for its turn.
    Enqueued,
    /// Is being worked on.
    Processing,
    /// Did what it was asked.
    Succeeded,
    /// Could not; `failure` says why.
    Failed,
    /// Was stopped on request.
    Cancelled,
}

impl From<crate::model::JobState> for JobStateDto {
    fn from(state: crate::model::JobState) -> Self {
        use crate::model::JobState;
        match state {
            JobState::Enqueued => Self::Enqueued,
            JobState::Processing => Self::Processing,
            JobState::Succeeded => Self::Succeeded,
            JobState::Failed => Self::Failed,
            JobState::Cancelled => Self::Cancelled,
        }
    }
}

/// Background work: what was asked, how far it is, how it ended.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(example = json!({
    "id": "01980c63-5f0e-7d52-a3f5-8b7f5d6f9a10",
    "kind": "reindex",
    "scope": "stale",
    "parameters": null,
    "state": "processing",
    "steps": [{"name": "describe shapes", "finished": 42, "total": 144}],
    "failure": null,
    "generation": null,
    "result": null,
    "attempts": 1,
    "enqueued_at": "2026-01-05T09:12:44.123456Z",
    "started_at": "2026-01-05T09:12:44.223456Z",
    "finished_at": null
}))]
pub struct JobDto {
    /// Never changes; later jobs have greater ids.
    pub id: String,
    /// What it does: `reindex`.
    pub kind: String,
    /// Which classes, by id.
    pub scope: ScopeDto,
    /// The parameters that were asked for; `null` keeps those the index has.
    pub parameters: Option<ParametersDto>,
    /// Where it stands.
    pub state: JobStateDto,
    /// How far it is; steps appear as they begin.
    pub steps: Vec<StepDto>,
    /// Why it failed, where it did.
    pub failure: Option<JobFailureDto>,
    /// The generation of the index it ended in.
    pub generation: Option<u64>,
    /// What it did, once it succeeded.
    pub result: Option<ReindexResult>,
    /// How often work on it began; more than once after a restart.
    pub attempts: u32,
    /// RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub enqueued_at: String,
    /// When work on it last began; RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub started_at: Option<String>,
    /// When it ended; RFC 3339, UTC.
    #[schema(format = DateTime)]
    pub finished_at: Option<String>,
}

impl From<Job> for JobDto {
    fn from(job: Job) -> Self {
        let JobKind::Reindex { scope, parameters } = job.kind;
        Self {
            id: job.id.to_string(),
            kind: "reindex".to_owned(),
            scope: match scope {
                ReindexScope::Stale => ScopeDto::Stale,
                ReindexScope::All => ScopeDto::All,
                ReindexScope::Classes(ids) => {
                    ScopeDto::Classes(ids.iter().map(ToString::to_string).collect())
                }
            },
            parameters: parameters.map(Into::into),
            state: job.state.into(),
            steps: job
                .steps
                .into_iter()
                .map(|step| StepDto {
                    name: step.name,
                    finished: step.finished,
                    total: step.total,
                })
                .collect(),
            failure: job.failure.map(|failure| JobFailureDto {
                code: failure.code,
                detail: failure.detail,
            }),
            generation: job.generation,
            result: job.result.map(Into::into),
            attempts: job.attempts,
            enqueued_at: time(job.enqueued_at),
            started_at: job.started_at.map(time),
            finished_at: job.finished_at.map(time),
        }
    }
}
