//! The API's description, made out of the route table. `openapi.yaml` at the top level is this document; a test fails
//! where the two differ.

use super::access::Access;
use super::dto::problem::ProblemDocument;
use super::operation::RouteInfo;
use super::problem::Code;
use super::route::{Route, operations_of};
use crate::model::{ClassName, Scope};
use axum::http::Method;
use std::collections::BTreeMap;
use utoipa::openapi::path::Operation;
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
    components(schemas(ProblemDocument)),
    modifiers(&Names)
)]
struct Document;

/// The document of these routes.
pub fn document(routes: Vec<Route>) -> utoipa::openapi::OpenApi {
    let mut document = Document::openapi();
    describe_keys(&mut document);
    for mut route in routes {
        for item in route.paths.paths.values_mut() {
            for (_, operation) in operations_of(item) {
                describe_problems(operation, &route.info);
                describe_access(operation, route.info.access);
                describe_body(operation);
            }
        }
        for (path, item) in route.paths.paths {
            match document.paths.paths.get_mut(&path) {
                Some(others) => others.merge_operations(item),
                None => _ = document.paths.paths.insert(path, item),
            }
        }
        let components = document.components.get_or_insert_default();
        components.schemas.extend(route.schemas);
    }
    Names.modify(&mut document);
    document
}

/// Adds the problems an operation can answer with.
fn describe_problems(operation: &mut Operation, route: &RouteInfo) {
    let mut by_status: BTreeMap<u16, Vec<Code>> = BTreeMap::new();
    for code in problems_of(route) {
        by_status.entry(code.status().as_u16()).or_default().push(code);
    }
    for (status, codes) in by_status {
        let response = RefOr::T(problem_response(&codes));
        operation.responses.responses.insert(status.to_string(), response);
    }
}

/// Says how a key is sent.
fn describe_keys(document: &mut utoipa::openapi::OpenApi) {
    let components = document.components.get_or_insert_default();
    let bearer = HttpBuilder::new()
        .scheme(HttpAuthScheme::Bearer)
        .description(Some("An API key, `slx_…`"))
        .build();
    let header = ApiKeyValue::with_description("X-API-Key", "The same key in a header of its own");
    components.add_security_scheme("bearer", SecurityScheme::Http(bearer));
    components.add_security_scheme("api_key", SecurityScheme::ApiKey(ApiKey::Header(header)));
}

/// Says that a query of a stored shape has no body.
fn describe_body(operation: &mut Operation) {
    let is_query = matches!(
        operation.operation_id.as_deref(),
        Some("query_mesh" | "query_batch")
    );
    if let Some(RefOr::T(body)) = operation.request_body.as_mut().filter(|_| is_query) {
        body.required = None;
    }
}

/// Says what an operation demands of its caller.
fn describe_access(operation: &mut Operation, access: Access) {
    let Some(scope) = access.scope().map(Scope::name) else {
        operation.security = Some(Vec::new());
        return;
    };
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

/// The problems an operation can answer with: its own, and those that its access and method bring.
fn problems_of(route: &RouteInfo) -> Vec<Code> {
    let mut codes = route.problems.clone();
    if route.access.scope().is_some() {
        codes.extend([Code::Unauthorized, Code::InsufficientScope]);
    }
    if route.access != Access::Probe {
        codes.push(Code::MisdirectedRequest);
    }
    if route.method != Method::GET {
        codes.push(Code::CrossSiteRequest);
    }
    codes.extend([Code::UriTooLong, Code::Overloaded, Code::Internal]);
    codes.sort_unstable();
    codes.dedup();
    codes
}
