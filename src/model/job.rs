//! Background work: what was asked, how far it is, how it ended.

use super::{ClassId, JobId, ShapeId};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use shapelex_core::parameters::Parameters;

/// Which classes a reindex learns again. Changed parameters make every class stale.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReindexScope {
    /// Those whose shapes changed since they were learnt, and those never learnt.
    #[default]
    Stale,
    /// Every class, changed or not.
    All,
    /// These, changed or not. Others keep the dictionary they have, even a stale one; those that have none stay without.
    Classes(Vec<ClassId>),
}

/// What a job does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// Learns dictionaries and switches to a new generation of the index.
    Reindex {
        /// Which classes.
        scope: ReindexScope,
        /// The new parameters of the index; `None` keeps those it has.
        parameters: Option<Parameters>,
    },
}

/// Where a job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits for its turn.
    Enqueued,
    /// Is being worked on.
    Processing,
    /// Did what it was asked.
    Succeeded,
    /// Could not; see [`Job::failure`].
    Failed,
    /// Was stopped on request.
    Cancelled,
}

impl JobState {
    /// All states, in the order a job can go through them.
    pub const ALL: [Self; 5] = [
        Self::Enqueued,
        Self::Processing,
        Self::Succeeded,
        Self::Failed,
        Self::Cancelled,
    ];

    /// Whether the state is final.
    pub fn is_finished(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }

    /// The state's name on the wire and in metrics.
    pub fn name(self) -> &'static str {
        match self {
            Self::Enqueued => "enqueued",
            Self::Processing => "processing",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}

/// One step of a job's work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Step {
    /// What is counted, such as `describe shapes`.
    pub name: String,
    /// How many are done.
    pub finished: usize,
    /// How many there are.
    pub total: usize,
}

/// Why a job failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobFailure {
    /// A stable name a program can act on, such as `all_shapes_failed`.
    pub code: String,
    /// One sentence for people.
    pub detail: String,
}

/// A class a reindex learnt.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RelearnedClass {
    /// The class.
    pub class: ClassId,
    /// Its name at the time.
    pub name: String,
    /// Shapes it was learnt from.
    pub shapes: usize,
}

/// A class a reindex left out of the index.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkippedClass {
    /// The class.
    pub class: ClassId,
    /// Its name at the time.
    pub name: String,
    /// One sentence.
    pub reason: String,
}

/// A shape that gave no signatures and was left out of its class.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedShape {
    /// The class.
    pub class: ClassId,
    /// The shape.
    pub shape: ShapeId,
    /// A stable name, such as `mesh_unusable`.
    pub code: String,
    /// One sentence.
    pub detail: String,
}

/// What a reindex did.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ReindexReport {
    /// Classes learnt.
    pub relearned: Vec<RelearnedClass>,
    /// Classes that kept their dictionaries.
    pub reused: Vec<ClassId>,
    /// Classes left out of the index.
    pub skipped: Vec<SkippedClass>,
    /// Shapes left out of their class.
    pub failed_shapes: Vec<FailedShape>,
    /// Shapes whose signatures were computed.
    pub described: usize,
    /// Shapes whose signatures were still there from an earlier reindex.
    pub described_before: usize,
}

/// A piece of background work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Never changes; jobs run in this order.
    pub id: JobId,
    /// What was asked.
    pub kind: JobKind,
    /// Where it stands.
    pub state: JobState,
    /// How far it is; steps appear as they begin.
    pub steps: Vec<Step>,
    /// Why it failed; only where it did.
    pub failure: Option<JobFailure>,
    /// When it was asked for.
    pub enqueued_at: Timestamp,
    /// When work on it last began.
    pub started_at: Option<Timestamp>,
    /// When it ended.
    pub finished_at: Option<Timestamp>,
    /// How often work on it began.
    pub attempts: u32,
    /// The generation it ended in; only where it succeeded.
    pub generation: Option<u64>,
    /// What it did; only where it succeeded.
    pub result: Option<ReindexReport>,
}

impl Job {
    /// A job that waits for its turn.
    pub fn new(kind: JobKind, now: Timestamp) -> Self {
        Self {
            id: JobId::new(),
            kind,
            state: JobState::Enqueued,
            steps: Vec::new(),
            failure: None,
            enqueued_at: now,
            started_at: None,
            finished_at: None,
            attempts: 0,
            generation: None,
            result: None,
        }
    }
}
