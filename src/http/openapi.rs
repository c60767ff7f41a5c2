//! The API's description, made out of the handlers. `openapi.yaml` at the top level is this document; a test fails
//! where the two differ, and another one where the route table does.

use super::auth::{Access, access_of, is_probe};
use super::dto::problem::ProblemDocument;
use super::problem::Code;
use super::routes::{classes, datasets, docs, health, index, jobs, keys, query, shapes, snapshots};
use crate::model::ClassName;
use axum::http::Method;
use std::collections::BTreeMap;
use std::sync::OnceLock;
use utoipa::openapi::path::{Operation, PathItem};
use utoipa::openapi::security::{
    ApiKey, ApiKeyValue, HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme,
};
use utoipa::openapi::{Content, Ref, RefOr, Response, ResponseBuilder, Schema};
use utoipa::{Modify, OpenApi};

#[derive(OpenApi)]
#[openapi(
    info(
        title = "shapelex",
        description = "Retrieval of deformable 3D shapes: upload meshes to classes, reindex, query with a mesh and get \
                       the classes ranked.\n\nEvery answer that is not a success is a problem document \
                       (`application/problem+json`, RFC 9457) with a stable `code`.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")
    ),
    tags(
        (name = "classes", description = "What a query is recognised as"),
        (name = "shapes", description = "What a class is learnt from"),
        (name = "jobs", description = "Learning, in the background"),
        (name = "query", description = "Which class is this?"),
        (name = "index", description = "What has been learnt, and how"),
        (name = "keys", description = "Who may do what"),
        (name = "operation", description = "For those who run the service"),
        (name = "documents", description = "This description, and a page"),
    ),
    paths(
        classes::create_class, classes::list_classes, classes::get_class, classes::rename_class,
        classes::delete_class,
        datasets::upload_dataset,
        shapes::create_shapes, shapes::list_shapes, shapes::get_shape, shapes::delete_shape, shapes::get_original,
        jobs::start_reindex, jobs::list_jobs, jobs::get_job, jobs::cancel_job, jobs::follow_job,
        query::query_mesh, query::query_batch,
        index::get_index, index::get_parameters,
        keys::create_key, keys::list_keys, keys::revoke_key,
        snapshots::create_snapshot, snapshots::list_snapshots, snapshots::get_snapshot, snapshots::delete_snapshot,
        snapshots::get_snapshot_file, snapshots::restore_snapshot, snapshots::restore_upload,
        health::get_liveness, health::get_readiness, health::get_metrics,
        docs::get_page, docs::get_docs, docs::get_openapi_yaml, docs::get_openapi_json,
    ),
    components(schemas(ProblemDocument)),
    modifiers(&Problems, &Keys, &Names)
)]
struct Document;

/// The document.
pub fn document() -> utoipa::openapi::OpenApi {
    Document::openapi()
}

/// The document in YAML: the contents of `openapi.yaml`.
///
/// # Errors
/// Where a schema cannot be written in YAML, which the tests rule out.
pub fn document_yaml() -> Result<String, impl std::fmt::Display> {
    document().to_yaml()
}

/// The document in JSON.
///
/// # Errors
/// Where a schema cannot be written in JSON, which the tests rule out.
pub fn document_json() -> Result<String, impl std::fmt::Display> {
    document().to_pretty_json()
}

/// Path → method → operation id.
fn operations() -> &'static BTreeMap<String, BTreeMap<&'static str, String>> {
    static OPERATIONS: OnceLock<BTreeMap<String, BTreeMap<&'static str, String>>> = OnceLock::new();
    OPERATIONS.get_or_init(|| {
        let mut table = BTreeMap::new();
        for (path, mut item) in document().paths.paths {
            let mut methods = BTreeMap::new();
            for (method, operation) in operations_of(&mut item) {
                methods.insert(method, operation.operation_id.clone().unwrap_or_default());
            }
            table.insert(path, methods);
        }
        table
    })
}

/// The id of the operation a route and a method belong to.
pub fn operation_id(method: &Method, path: &str) -> Option<&'static str> {
    Some(operations().get(path)?.get(method.as_str())?.as_str())
}

/// The ids of all operations.
pub fn operation_ids() -> impl Iterator<Item = String> {
    operations()
        .values()
        .flat_map(|methods| methods.values().cloned())
}

fn operations_of(item: &mut PathItem) -> impl Iterator<Item = (&'static str, &mut Operation)> {
    [
        ("GET", &mut item.get),
        ("POST", &mut item.post),
        ("PATCH", &mut item.patch),
        ("PUT", &mut item.put),
        ("DELETE", &mut item.delete),
    ]
    .into_iter()
    .filter_map(|(method, operation)| Some((method, operation.as_mut()?)))
}

/// Adds the problems every operation can answer with, and the request id.
struct Problems;

impl Modify for Problems {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        for item in document.paths.paths.values_mut() {
            for (method, operation) in operations_of(item) {
                let id = operation.operation_id.clone().unwrap_or_default();
                let mut by_status: BTreeMap<u16, Vec<Code>> = BTreeMap::new();
                let strangers = (method != "GET").then_some(Code::CrossSiteRequest);
                for code in problems_of(&id).into_iter().chain(strangers) {
                    by_status.entry(code.status().as_u16()).or_default().push(code);
                }
                for (status, codes) in by_status {
                    operation
                        .responses
                        .responses
                        .insert(status.to_string(), RefOr::T(problem_response(&codes)));
                }
            }
        }
    }
}

/// Says what each operation demands of its caller.
struct Keys;

impl Modify for Keys {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let components = document.components.get_or_insert_default();
        let bearer = HttpBuilder::new()
            .scheme(HttpAuthScheme::Bearer)
            .description(Some("An API key, `slx_…`"))
            .build();
        let header = ApiKeyValue::with_description("X-API-Key", "The same key in a header of its own");
        components.add_security_scheme("bearer", SecurityScheme::Http(bearer));
        components.add_security_scheme("api_key", SecurityScheme::ApiKey(ApiKey::Header(header)));
        for item in document.paths.paths.values_mut() {
            for (_, operation) in operations_of(item) {
                let id = operation.operation_id.clone().unwrap_or_default();
                let Access::Needs(scope) = access_of(&id) else {
                    operation.security = Some(Vec::new());
                    continue;
                };
                let scope = scope.name();
                operation.security = Some(vec![
                    SecurityRequirement::new("bearer", [scope]),
                    SecurityRequirement::new("api_key", [scope]),
                    SecurityRequirement::default(),
                ]);
                let description = operation.description.get_or_insert_default();
                if !description.is_empty() {
                    description.push_str("\n\n");
                }
                description.push_str(&format!("Where keys are on, a key of scope `{scope}`."));
            }
        }
    }
}

/// Says what a class may be called, in the words of the code that checks it.
struct Names;

impl Modify for Names {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        let schemas = &mut document.components.get_or_insert_default().schemas;
        for request in ["CreateClass", "RenameClass"] {
            if let Some(RefOr::T(Schema::Object(body))) = schemas.get_mut(request)
                && let Some(RefOr::T(Schema::Object(name))) = body.properties.get_mut("name")
            {
                name.pattern = Some(ClassName::pattern());
            }
        }
    }
}

fn problem_response(codes: &[Code]) -> Response {
    let lines: Vec<String> = codes
        .iter()
        .map(|code| format!("`{}`: {}", code.name(), code.title()))
        .collect();
    let content = Content::new(Some(Ref::from_schema_name("ProblemDocument")));
    ResponseBuilder::new()
        .description(lines.join("; "))
        .content("application/problem+json", content)
        .build()
}

/// The problems an operation can answer with.
fn problems_of(operation: &str) -> Vec<Code> {
    use Code::*;
    let mut codes = match operation {
        "get_page" | "get_docs" | "get_openapi_yaml" | "get_openapi_json" | "get_liveness"
        | "get_metrics" => vec![],
        "get_readiness" => vec![NotReady],
        "get_index" => vec![InvalidQuery, InvalidCursor],
        "get_parameters" => vec![],
        "list_classes" => vec![InvalidQuery, InvalidCursor],
        "create_class" => [JSON, WRITE, &[InvalidName, ClassExists, QuotaExceeded]].concat(),
        "get_class" => vec![InvalidRequest, ClassNotFound],
        "rename_class" => [
            JSON,
            WRITE,
            &[
                InvalidRequest,
                InvalidName,
                ClassNotFound,
                ClassExists,
                RevisionMismatch,
            ],
        ]
        .concat(),
        "delete_class" => [WRITE, &[InvalidRequest, ClassNotFound, RevisionMismatch]].concat(),
        "create_shapes" => [
            UPLOAD,
            MESH,
            POOL,
            WRITE,
            &[
                InvalidName,
                ClassNotFound,
                UploadRejected,
                NoAnimation,
                QuotaExceeded,
            ],
        ]
        .concat(),
        "upload_dataset" => [
            UPLOAD,
            MESH,
            POOL,
            WRITE,
            &[
                InvalidName,
                FileWithoutClass,
                UploadRejected,
                NoAnimation,
                QuotaExceeded,
                ClassExists,
            ],
        ]
        .concat(),
        "list_shapes" => vec![InvalidRequest, InvalidQuery, InvalidCursor, ClassNotFound],
        "get_shape" => vec![InvalidRequest, ClassNotFound, ShapeNotFound],
        "delete_shape" => [WRITE, &[InvalidRequest, ClassNotFound, ShapeNotFound]].concat(),
        "get_original" => vec![
            InvalidRequest,
            ClassNotFound,
            ShapeNotFound,
            OriginalMissing,
            OriginalDamaged,
            StorageDenied,
        ],
        "start_reindex" => [
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
        ]
        .concat(),
        "create_key" => [JSON, WRITE, &[InvalidName, KeyExists, TooManyKeys]].concat(),
        "list_keys" => vec![InvalidQuery, InvalidCursor],
        "revoke_key" => [WRITE, &[InvalidRequest, KeyNotFound, LastAdminKey]].concat(),
        "list_jobs" => vec![InvalidQuery, InvalidCursor],
        "get_job" | "follow_job" => vec![InvalidRequest, JobNotFound],
        "cancel_job" => [WRITE, &[InvalidRequest, JobNotFound, JobFinished]].concat(),
        "query_mesh" => [
            UPLOAD,
            MESH,
            POOL,
            &[
                OneMeshExpected,
                IndexEmpty,
                IndexIncomplete,
                RecoveryMode,
                RateLimited,
                NoAnimation,
            ],
            STORED,
        ]
        .concat(),
        "create_snapshot" => [WRITE, &[SnapshotRunning]].concat(),
        "list_snapshots" => vec![InvalidQuery, InvalidCursor],
        "get_snapshot" | "get_snapshot_file" | "delete_snapshot" => vec![SnapshotNotFound],
        "restore_snapshot" => [WRITE, RESTORE, &[SnapshotNotFound]].concat(),
        "restore_upload" => [
            WRITE,
            RESTORE,
            &[
                EmptyBody,
                InvalidRequest,
                RequestTimeout,
                BodyTooLarge,
                UnsupportedMediaType,
            ],
        ]
        .concat(),
        "query_batch" => [
            UPLOAD,
            STORED,
            &[IndexEmpty, RecoveryMode, RateLimited, OneMeshExpected],
        ]
        .concat(),
        _ => vec![],
    };
    if access_of(operation) != Access::Public {
        codes.extend([Unauthorized, InsufficientScope]);
    }
    if !is_probe(operation) {
        codes.push(MisdirectedRequest);
    }
    codes.extend([UriTooLong, Overloaded, Internal]);
    codes.sort_unstable();
    codes.dedup();
    codes
}

const JSON: &[Code] = &[
    Code::RequestTimeout,
    Code::InvalidJson,
    Code::InvalidField,
    Code::BodyTooLarge,
    Code::UnsupportedMediaType,
];
const WRITE: &[Code] = &[Code::StoreUnavailable, Code::RecoveryMode, Code::StorageFull];
const RESTORE: &[Code] = &[
    Code::SnapshotRunning,
    Code::InvalidSnapshot,
    Code::JobsUnfinished,
    Code::ShuttingDown,
];
const UPLOAD: &[Code] = &[
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
const MESH: &[Code] = &[
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
/// Of a stored shape as a query.
const STORED: &[Code] = &[
    Code::ClassNotFound,
    Code::ShapeNotFound,
    Code::OriginalMissing,
    Code::OriginalDamaged,
    Code::StorageDenied,
];
const POOL: &[Code] = &[
    Code::Overloaded,
    Code::Cancelled,
    Code::ShuttingDown,
    Code::DeadlineExceeded,
];
