//! Plain data shared by the store, the jobs and the HTTP layer: parsed identifiers, classes, shapes, jobs,
//! generations and API keys. No I/O happens here, and a value of these types is valid by construction where its type says so.
//!
//! These types are never sent over the wire and never stored as they are: `http` has its own transfer types and
//! `store` its own versioned records.

pub mod class;
pub mod generation;
pub mod id;
pub mod job;
pub mod key;
pub mod shape;
pub mod snapshot;
pub mod text;

pub use class::{Class, ClassName, ClassNameError};
pub use generation::{Generation, GenerationClass, GenerationShape, Origin};
pub use id::{ClassId, IdError, JobId, KeyId, ShapeId, SnapshotId};
pub use job::{
    FailedShape, Job, JobFailure, JobKind, JobState, ReindexReport, ReindexScope, RelearnedClass,
    SkippedClass, Step,
};
pub use key::{ApiKey, KeyHash, KeyLimits, KeyName, KeyNameError, Scope};
pub use shape::{CompanionFile, ContentHash, ContentHashError, NewShape, Shape, ShapePose};
pub use snapshot::{Restored, Snapshot, SnapshotOrigin};
