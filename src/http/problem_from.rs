//! The one place where errors of the layers below become problems.

use super::problem::{Code, Problem};
use crate::jobs::JobError;
use crate::model::{ClassNameError, KeyNameError};
use crate::store::{OriginalDamage, StoreError};
use shapelex_core::coding::CodingError;
use shapelex_core::memory::MemoryError;
use shapelex_core::mesh::MeshError;
use shapelex_core::parameters::ParameterError;
use shapelex_core::pipeline::PipelineError;
use shapelex_core::ranking::RankingError;
use shapelex_core::spectral::SpectralError;

impl From<MeshError> for Problem {
    fn from(error: MeshError) -> Self {
        let detail = error.to_string();
        let of = |code| Self::new(code, detail.clone());
        match error {
            MeshError::Empty => of(Code::EmptyBody),
            MeshError::UnknownFormat => of(Code::UnknownFormat),
            MeshError::Malformed { format, .. } => of(Code::MalformedMesh).with("format", format.to_string()),
            MeshError::Truncated { format, .. } => of(Code::TruncatedMesh).with("format", format.to_string()),
            MeshError::Unsupported { format, feature } => of(Code::UnsupportedFeature)
                .with("format", format.to_string())
                .with("feature", feature),
            MeshError::MissingBuffer { uri } => of(Code::MissingBuffer).with("uri", uri),
            MeshError::IndexOutOfRange {
                face,
                index,
                vertices,
            } => of(Code::IndexOutOfRange)
                .with("face", face)
                .with("index", index)
                .with("vertices", vertices),
            MeshError::NotFinite { vertex } => of(Code::NotFinite).with("vertex", vertex),
            MeshError::NoFaces { vertices } => of(Code::NoFaces).with("vertices", vertices),
            MeshError::EmptyScene { meshes } => of(Code::NoFaces).with("meshes", meshes),
            MeshError::TooSmall { vertices, faces } => of(Code::MeshTooSmall)
                .with("vertices", vertices)
                .with("faces", faces),
            MeshError::Degenerate => of(Code::DegenerateMesh),
            MeshError::Disconnected {
                parts,
                dropped,
                percent,
            } => of(Code::DisconnectedMesh)
                .with("parts", parts)
                .with("dropped", dropped)
                .with("area_dropped", percent / 100.0),
            MeshError::NotSimplified { vertices, size } => of(Code::NotSimplified)
                .with("vertices", vertices)
                .with("size", size),
            MeshError::TooLarge { what, found, limit } => of(Code::MeshTooLarge)
                .with("what", what)
                .with("found", found)
                .with("limit", limit),
            MeshError::NoAnimation => of(Code::NoAnimation),
            MeshError::Memory(error) => error.into(),
            MeshError::Cancelled(_) => of(Code::Cancelled),
            MeshError::Invalid { .. } => of(Code::InvalidMesh),
        }
    }
}

/// Seconds a client is asked to wait where memory is not free at the moment.
const MEMORY_RETRY_AFTER: u64 = 2;

impl From<MemoryError> for Problem {
    fn from(error: MemoryError) -> Self {
        let detail = error.to_string();
        match error {
            MemoryError::NeverFits { needed, limit } => Self::new(Code::MeshTooLarge, detail)
                .with("what", "bytes of memory")
                .with("found", needed)
                .with("limit", limit),
            MemoryError::NotNow { .. } => {
                Self::new(Code::Overloaded, detail).with("retry_after_seconds", MEMORY_RETRY_AFTER)
            }
        }
    }
}

impl From<SpectralError> for Problem {
    fn from(error: SpectralError) -> Self {
        let detail = error.to_string();
        match error {
            SpectralError::Cancelled(_) => Self::new(Code::Cancelled, detail),
            SpectralError::TooFewEigenpairs { found, needed } => Self::new(Code::SpectrumFailed, detail)
                .with("found", found)
                .with("needed", needed),
            SpectralError::Factorisation { .. } | SpectralError::NotConverged { .. } => {
                Self::new(Code::SpectrumFailed, detail)
            }
        }
    }
}

impl From<CodingError> for Problem {
    fn from(error: CodingError) -> Self {
        let detail = error.to_string();
        match error {
            CodingError::Cancelled(_) => Self::new(Code::Cancelled, detail),
            other => Self::new(Code::CodingFailed, detail).logged(format!("{other:?}")),
        }
    }
}

impl From<RankingError> for Problem {
    fn from(error: RankingError) -> Self {
        let detail = error.to_string();
        match error {
            RankingError::Coding(inner) => inner.into(),
            RankingError::EmptyIndex => index_empty(),
            RankingError::NoPlainView => Self::internal(detail),
            RankingError::MissingChannel { class, .. } => {
                Self::new(Code::IndexIncomplete, detail).with("class", class)
            }
        }
    }
}

impl From<ParameterError> for Problem {
    fn from(error: ParameterError) -> Self {
        Self::new(Code::InvalidParameter, error.to_string())
            .with("name", error.name)
            .with("expected", error.expected)
            .with("found", error.found)
    }
}

impl From<PipelineError> for Problem {
    fn from(error: PipelineError) -> Self {
        match error {
            PipelineError::Cancelled(c) => Self::new(Code::Cancelled, c.to_string()),
            PipelineError::Mesh(e) => e.into(),
            PipelineError::Spectral(e) => e.into(),
            PipelineError::Coding(e) => e.into(),
            PipelineError::Ranking(e) => e.into(),
            PipelineError::Parameter(e) => e.into(),
        }
    }
}

/// No class has a dictionary: says what to do next.
pub fn index_empty() -> Problem {
    Problem::new(
        Code::IndexEmpty,
        "no class has a dictionary yet; upload shapes to a class, then POST /v1/reindex and wait for its job",
    )
    .with("next", "/v1/reindex")
}

/// The service shows the catalogue only: says where it says why.
pub fn recovery_mode() -> Problem {
    Problem::new(
        Code::RecoveryMode,
        "the service is in recovery mode: it shows the catalogue and changes nothing; /readyz and the log say why",
    )
    .with("retry_after_seconds", 30)
}

/// The disk was too full to read the index: says that this passes.
pub fn index_unread() -> Problem {
    Problem::new(
        Code::StorageFull,
        "the disk was too full at the start to read the index; it is read by itself once there is space",
    )
    .with("retry_after_seconds", 10)
}

/// The index knows nothing for the baselines: says what to do next.
pub fn baselines_missing(rank_by: &str) -> Problem {
    Problem::new(
        Code::BaselinesMissing,
        format!(
            "the index was learnt without what {rank_by} needs; POST /v1/reindex, wait for its job and ask again, or \
             rank by objective"
        ),
    )
    .with("rank_by", rank_by)
    .with("next", "/v1/reindex")
}

/// All classes are imported, and their file had nothing for a baseline.
pub fn baselines_not_imported(rank_by: &str) -> Problem {
    Problem::new(
        Code::BaselinesMissing,
        format!(
            "the index was imported from a file without what {rank_by} needs, and a reindex cannot make it; export it again \
             with a newer shapelex, add shapes, or rank by objective"
        ),
    )
    .with("rank_by", rank_by)
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        let detail = error.to_string();
        match error {
            StoreError::NoClass { .. } => Self::new(Code::ClassNotFound, detail),
            StoreError::NoShape { .. } => Self::new(Code::ShapeNotFound, detail),
            StoreError::NoJob { .. } => Self::new(Code::JobNotFound, detail),
            StoreError::NameTaken { name, id } => Self::new(Code::ClassExists, detail)
                .with("name", name.to_string())
                .with("class", id.to_string()),
            StoreError::NoKey { .. } => Self::new(Code::KeyNotFound, detail),
            StoreError::KeyNameTaken { name, id } => Self::new(Code::KeyExists, detail)
                .with("name", name.to_string())
                .with("key", id.to_string()),
            StoreError::TooManyKeys { limit } => Self::new(Code::TooManyKeys, detail).with("limit", limit),
            StoreError::NoSnapshot { id } => {
                Self::new(Code::SnapshotNotFound, detail).with("snapshot", id.to_string())
            }
            StoreError::SnapshotRunning => {
                Self::new(Code::SnapshotRunning, detail).with("retry_after_seconds", 10)
            }
            StoreError::BadSnapshot { .. } => Self::new(Code::InvalidSnapshot, detail),
            StoreError::QuotaExceeded {
                quota, limit, used, ..
            } => Self::new(Code::QuotaExceeded, detail)
                .with("quota", quota.name())
                .with("limit", limit)
                .with("used", used),
            StoreError::OutOfDescriptors { .. } => Self::new(
                Code::Overloaded,
                "the service has as many files and connections open as it may; nothing was changed",
            )
            .with("retry_after_seconds", 2)
            .logged(detail),
            StoreError::Full { .. } => Self::new(
                Code::StorageFull,
                "the disk is full; nothing was changed. Writes are taken again by themselves once there is space",
            )
            .with("retry_after_seconds", 10)
            .logged(detail),
            StoreError::ReadOnly { .. } => Self::new(
                Code::StoreUnavailable,
                "the store takes no writes since one failed; /readyz and the log say why",
            )
            .with("retry_after_seconds", 30)
            .logged(detail),
            StoreError::RecoveryMode { .. } => recovery_mode(),
            StoreError::Original { content, damage } => Self::new(
                match damage {
                    OriginalDamage::Missing => Code::OriginalMissing,
                    OriginalDamage::Changed | OriginalDamage::Unreadable => Code::OriginalDamaged,
                },
                detail,
            )
            .with("content", content.to_string()),
            StoreError::Denied { .. } => Self::new(Code::StorageDenied, detail.clone())
                .with("retry_after_seconds", 30)
                .logged(detail),
            StoreError::Damaged { .. } => Self::new(
                Code::Internal,
                "a stored record is damaged; the log has it under this request id",
            )
            .logged(detail),
            // Paths and system errors are the operator's business, not the client's.
            other => Self::internal(other),
        }
    }
}

impl From<JobError> for Problem {
    fn from(error: JobError) -> Self {
        let detail = error.to_string();
        match error {
            JobError::QueueFull { limit } => Self::new(Code::QueueFull, detail)
                .with("limit", limit)
                .with("retry_after_seconds", 10),
            JobError::NoJob { .. } => Self::new(Code::JobNotFound, detail),
            JobError::Finished { state, .. } => {
                Self::new(Code::JobFinished, detail).with("state", state.name())
            }
            JobError::Parameter(e) => e.into(),
            JobError::Unfinished { jobs } => Self::new(Code::JobsUnfinished, detail).with("jobs", jobs),
            JobError::Paused => Self::new(Code::StoreUnavailable, detail).with("retry_after_seconds", 5),
            JobError::ShuttingDown => Self::new(Code::ShuttingDown, detail),
            JobError::Store(e) => e.into(),
            JobError::NoWorker { .. } => Self::internal(detail),
        }
    }
}

impl From<ClassNameError> for Problem {
    fn from(error: ClassNameError) -> Self {
        Self::new(Code::InvalidName, error.to_string())
    }
}

impl From<KeyNameError> for Problem {
    fn from(error: KeyNameError) -> Self {
        Self::new(Code::InvalidName, error.to_string())
    }
}
