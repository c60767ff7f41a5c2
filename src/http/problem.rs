//! Every failure's code, status and title in one table, and the body they travel in (RFC 9457).
//!
//! A handler returns a [`Problem`]; the middleware in [`super::respond`] writes it as `application/problem+json` with
//! the request's id. A client acts on `code`, which never changes; `title` and `detail` are for people.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value};

macro_rules! codes {
    ($($variant:ident, $code:literal, $status:literal, $title:literal;)*) => {
        /// A stable failure code.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Code { $(#[doc = $title] $variant,)* }

        impl Code {
            /// Every code, in the table's order.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The code on the wire.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $code,)* }
            }

            /// The HTTP status, always 4xx or 5xx.
            pub fn status(self) -> StatusCode {
                let status: u16 = match self { $(Self::$variant => $status,)* };
                StatusCode::from_u16(status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
            }

            /// What went wrong, the same words for every occurrence.
            pub fn title(self) -> &'static str {
                match self { $(Self::$variant => $title,)* }
            }
        }
    };
}

codes! {
    // --- the request itself ---
    InvalidRequest, "invalid_request", 400, "The request could not be understood";
    InvalidQuery, "invalid_query", 400, "A query parameter is unknown or has a wrong value";
    InvalidJson, "invalid_json", 400, "The body is not JSON";
    InvalidCursor, "invalid_cursor", 400, "The cursor was not issued by this list";
    InvalidField, "invalid_field", 422, "A field is unknown, missing or has a wrong value";
    InvalidName, "invalid_name", 422, "The name is not acceptable";
    InvalidParameter, "invalid_parameter", 422, "A parameter is outside its range";
    MisdirectedRequest, "misdirected_request", 421, "The service does not go by the name in the request";
    CrossSiteRequest, "cross_site_request", 403, "A page of another site may not ask for this";
    Unauthorized, "unauthorized", 401, "A valid API key is needed";
    InsufficientScope, "insufficient_scope", 403, "The API key does not allow this";
    RateLimited, "rate_limited", 429, "The API key's queries per minute are used up";
    QuotaExceeded, "quota_exceeded", 403, "The API key may have no more of this";
    IdempotencyKeyReused, "idempotency_key_reused", 422, "The idempotency key was used for another request";
    UriTooLong, "uri_too_long", 414, "The address is longer than the limit";
    RouteNotFound, "route_not_found", 404, "There is nothing at this address";
    MethodNotAllowed, "method_not_allowed", 405, "This address does not answer that method";
    RequestTimeout, "request_timeout", 408, "The request took too long to arrive";
    BodyTooLarge, "body_too_large", 413, "The body is longer than the limit";
    UnsupportedMediaType, "unsupported_media_type", 415, "The content type is not one this address reads";
    // --- uploads ---
    InvalidMultipart, "invalid_multipart", 400, "The multipart body could not be read";
    NoFiles, "no_files", 400, "No mesh file was sent";
    OneMeshExpected, "one_mesh_expected", 400, "More than one mesh was sent where one is expected";
    TooManyFiles, "too_many_files", 413, "More files were sent than the limit";
    InvalidArchive, "invalid_archive", 422, "The archive could not be read";
    UnsafeArchivePath, "unsafe_archive_path", 422, "The archive names a file outside itself";
    NestedArchive, "nested_archive", 422, "The archive holds another archive";
    ArchiveTooLarge, "archive_too_large", 413, "The archive unpacks to more than the limit";
    UploadRejected, "upload_rejected", 422, "At least one file could not be used; nothing was stored";
    FileWithoutClass, "file_without_class", 422, "The file lies in no folder that names its class";
    // --- meshes ---
    EmptyBody, "empty_body", 400, "The body is empty";
    UnknownFormat, "unknown_format", 415, "The mesh format was not recognised";
    MalformedMesh, "malformed_mesh", 422, "The mesh file is damaged";
    TruncatedMesh, "truncated_mesh", 422, "The mesh file is cut short";
    UnsupportedFeature, "unsupported_feature", 422, "The mesh file needs a feature that is not supported";
    MissingBuffer, "missing_buffer", 422, "The mesh refers to a file that was not sent";
    IndexOutOfRange, "index_out_of_range", 422, "A face points outside the vertex list";
    NotFinite, "not_finite", 422, "A coordinate is not a finite number";
    NoFaces, "no_faces", 422, "The file has points but no faces";
    MeshTooSmall, "mesh_too_small", 422, "The mesh is too small to have a spectrum";
    DegenerateMesh, "degenerate_mesh", 422, "All faces are degenerate";
    DisconnectedMesh, "disconnected_mesh", 422, "The mesh falls into parts of which too little would be kept";
    NotSimplified, "not_simplified", 422, "The mesh cannot be simplified to the working size";
    MeshTooLarge, "mesh_too_large", 413, "The mesh is larger than the limit";
    NoAnimation, "no_animation", 422, "Poses were asked of a file without animation";
    InvalidMesh, "invalid_mesh", 422, "The mesh breaks an invariant";
    SpectrumFailed, "spectrum_failed", 422, "The mesh has no usable spectrum";
    CodingFailed, "coding_failed", 500, "The signatures could not be coded";
    // --- the catalogue ---
    ClassNotFound, "class_not_found", 404, "There is no such class";
    ShapeNotFound, "shape_not_found", 404, "There is no such shape in this class";
    JobNotFound, "job_not_found", 404, "There is no such job";
    OriginalMissing, "original_missing", 500, "The stored file is gone";
    OriginalDamaged, "original_damaged", 500, "The stored file is not what was uploaded";
    ClassExists, "class_exists", 409, "A class of that name exists";
    JobFinished, "job_finished", 409, "The job has ended and cannot be cancelled";
    RevisionMismatch, "revision_mismatch", 412, "The class has changed since it was read";
    // --- API keys ---
    KeyNotFound, "key_not_found", 404, "There is no such API key";
    KeyExists, "key_exists", 409, "An API key of that name exists";
    TooManyKeys, "too_many_keys", 409, "There are as many API keys as there may be";
    LastAdminKey, "last_admin_key", 409, "The last key of scope admin cannot go while there are others";
    // --- snapshots ---
    SnapshotNotFound, "snapshot_not_found", 404, "There is no such snapshot";
    SnapshotRunning, "snapshot_running", 409, "Another snapshot is being made or restored";
    JobsUnfinished, "jobs_unfinished", 409, "Jobs wait or run, and may not";
    InvalidSnapshot, "invalid_snapshot", 422, "The snapshot cannot be restored";
    // --- the index ---
    IndexEmpty, "index_empty", 409, "No class is indexed yet";
    NothingToIndex, "nothing_to_index", 409, "There are no shapes to learn from";
    IndexIncomplete, "index_incomplete", 409, "A class lacks a dictionary the query needs";
    BaselinesMissing, "baselines_missing", 409, "The index was learnt without what this ranking needs";
    // --- load and faults ---
    QueueFull, "queue_full", 503, "The job queue is full";
    Overloaded, "overloaded", 503, "All workers are busy";
    ShuttingDown, "shutting_down", 503, "The service is shutting down";
    NotReady, "not_ready", 503, "The service is not ready";
    StoreUnavailable, "store_unavailable", 503, "The store does not accept this now";
    RecoveryMode, "recovery_mode", 503, "The service only shows the catalogue and changes nothing";
    StorageFull, "storage_full", 507, "There is no space left";
    StorageDenied, "storage_denied", 503, "The service may not use its data directory";
    Cancelled, "cancelled", 503, "The work was stopped before it had a result";
    DeadlineExceeded, "deadline_exceeded", 504, "The answer took longer than the time limit";
    Internal, "internal", 500, "Something went wrong inside the service";
}

/// A failure on its way to the client.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Which failure it is.
    pub code: Code,
    /// What happened this time, for people.
    pub detail: String,
    /// Named numbers and names a client may act on, such as `limit_bytes`.
    pub extra: Map<String, Value>,
    /// What only the log says.
    pub internal: Option<String>,
}

impl Problem {
    /// A problem with a code and what happened this time.
    pub fn new(code: Code, detail: impl Into<String>) -> Self {
        Self {
            code,
            detail: detail.into(),
            extra: Map::new(),
            internal: None,
        }
    }

    /// An internal fault: the client learns that there was one, the log learns which.
    pub fn internal(what: impl std::fmt::Display) -> Self {
        let mut problem = Self::new(
            Code::Internal,
            "an unexpected fault; the log has it under this request id",
        );
        problem.internal = Some(what.to_string());
        problem
    }

    /// Adds a named value.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.extra.insert(name.to_owned(), value.into());
        self
    }

    /// Adds what only the log says.
    #[must_use]
    pub fn logged(mut self, what: impl std::fmt::Display) -> Self {
        self.internal = Some(what.to_string());
        self
    }

    /// The members of the problem document. `request_id` is left out where it is not known yet.
    pub fn to_json(&self, request_id: Option<&str>) -> Value {
        let mut body = Map::new();
        body.insert("type".into(), format!("/docs#{}", self.code.name()).into());
        body.insert("title".into(), self.code.title().into());
        body.insert("status".into(), self.code.status().as_u16().into());
        body.insert("detail".into(), self.detail.clone().into());
        body.insert("code".into(), self.code.name().into());
        if let Some(id) = request_id {
            body.insert("request_id".into(), id.into());
        }
        for (name, value) in &self.extra {
            body.entry(name.clone()).or_insert_with(|| value.clone());
        }
        Value::Object(body)
    }

    /// The response, with its headers.
    pub fn to_response(&self, request_id: Option<&str>) -> Response {
        let mut response = (self.code.status(), self.to_json(request_id).to_string()).into_response();
        let headers = response.headers_mut();
        headers.insert(
            header::CONTENT_TYPE,
            HeaderValue::from_static("application/problem+json"),
        );
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some(challenge) = self.challenge() {
            headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static(challenge));
        }
        if self.code == Code::RateLimited
            && let Some(limit) = self.extra.get("limit").and_then(Value::as_u64)
        {
            headers.insert("ratelimit-limit", HeaderValue::from(limit));
            headers.insert("ratelimit-remaining", HeaderValue::from(0));
            headers.insert(
                "ratelimit-reset",
                HeaderValue::from(self.retry_after().unwrap_or(60)),
            );
        }
        if let Some(seconds) = self.retry_after() {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        response
    }

    /// What RFC 6750 wants beside a refusal.
    fn challenge(&self) -> Option<&'static str> {
        match self.code {
            Code::Unauthorized => Some("Bearer realm=\"shapelex\""),
            Code::InsufficientScope => Some("Bearer realm=\"shapelex\", error=\"insufficient_scope\""),
            _ => None,
        }
    }

    /// Seconds after which trying again makes sense; every 503 and 429 says so.
    fn retry_after(&self) -> Option<u64> {
        let later = [StatusCode::SERVICE_UNAVAILABLE, StatusCode::TOO_MANY_REQUESTS];
        later.contains(&self.code.status()).then(|| {
            self.extra
                .get("retry_after_seconds")
                .and_then(Value::as_u64)
                .unwrap_or(2)
        })
    }
}

impl IntoResponse for Problem {
    /// The response without a request id; the middleware finds the problem among the extensions and adds it.
    fn into_response(self) -> Response {
        let mut response = self.to_response(None);
        response.extensions_mut().insert(self);
        response
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn codes_are_unique_and_only_failures() {
        let names: BTreeSet<_> = Code::ALL.iter().map(|c| c.name()).collect();
        assert_eq!(names.len(), Code::ALL.len());
        for code in Code::ALL {
            assert!(code.status().is_client_error() || code.status().is_server_error());
            assert!(code.name().chars().all(|c| c.is_ascii_lowercase() || c == '_'));
        }
    }

    #[test]
    fn named_values_never_replace_the_standard_members() {
        let problem = Problem::new(Code::BodyTooLarge, "too long")
            .with("status", 200)
            .with("limit_bytes", 5);
        let json = problem.to_json(Some("abc"));
        assert_eq!(json["status"], 413);
        assert_eq!(json["limit_bytes"], 5);
        assert_eq!(json["request_id"], "abc");
    }
}
