//! Problems that many operations share.

use super::problem::Code;

/// A JSON body.
pub(super) const JSON: &[Code] = &[
    Code::RequestTimeout,
    Code::InvalidJson,
    Code::InvalidField,
    Code::BodyTooLarge,
    Code::UnsupportedMediaType,
];
/// A change of the store.
pub(super) const WRITE: &[Code] = &[Code::StoreUnavailable, Code::RecoveryMode, Code::StorageFull];
/// A page of a list.
pub(super) const PAGE: &[Code] = &[Code::InvalidQuery, Code::InvalidCursor];
/// A snapshot that becomes the catalogue.
pub(super) const RESTORE: &[Code] = &[
    Code::SnapshotRunning,
    Code::InvalidSnapshot,
    Code::JobsUnfinished,
    Code::ShuttingDown,
];
/// A body with files.
pub(super) const UPLOAD: &[Code] = &[
    Code::InvalidRequest,
    Code::InvalidQuery,
    Code::EmptyBody,
    Code::InvalidMultipart,
    Code::NoFiles,
    Code::RequestTimeout,
    Code::BodyTooLarge,
    Code::TooManyFiles,
    Code::ArchiveTooLarge,
    Code::UnsupportedMediaType,
    Code::InvalidArchive,
    Code::UnsafeArchivePath,
    Code::NestedArchive,
];
/// A mesh that is read and prepared.
pub(super) const MESH: &[Code] = &[
    Code::UnknownFormat,
    Code::MalformedMesh,
    Code::TruncatedMesh,
    Code::UnsupportedFeature,
    Code::MissingBuffer,
    Code::IndexOutOfRange,
    Code::NotFinite,
    Code::NoFaces,
    Code::MeshTooSmall,
    Code::DegenerateMesh,
    Code::DisconnectedMesh,
    Code::NotSimplified,
    Code::MeshTooLarge,
    Code::InvalidMesh,
    Code::SpectrumFailed,
];
/// A stored shape as a query.
pub(super) const STORED: &[Code] = &[
    Code::ClassNotFound,
    Code::ShapeNotFound,
    Code::OriginalMissing,
    Code::OriginalDamaged,
    Code::StorageDenied,
];
/// Work that waits for a query thread.
pub(super) const POOL: &[Code] = &[
    Code::Overloaded,
    Code::Cancelled,
    Code::ShuttingDown,
    Code::DeadlineExceeded,
];
