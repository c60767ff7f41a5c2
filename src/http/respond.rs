//! What happens around every handler: a request id, a span, metrics, and a problem document for whatever failed.

use super::audit::Entry;
use super::auth::{Access, UNMATCHED, access_of, authorize, is_probe};
use super::host;
use super::linger::linger;
use super::metrics;
use super::origin;
use super::problem::{Code, Problem};
use super::request_memory::{self, Refusable, hold_answer};
use super::state::AppState;
use super::trace_context::{self, trace_parent};
use crate::model::Scope;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::time::Instant;
use tracing::Instrument;
use tracing::field::Empty;

/// The header a request id comes in by and goes out by.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

#[derive(Clone)]
struct RequestId(String);

/// The id of a request that went through [`around`], for answers that carry problems inside.
pub fn id_of(request: &Request) -> Option<String> {
    request.extensions().get::<RequestId>().map(|id| id.0.clone())
}

/// The outermost layer.
pub async fn around(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    let id = request_id(&request);
    request = linger(request);
    request.extensions_mut().insert(RequestId(id.clone()));
    request_memory::begin(&mut request, &state.memory);
    let operation = operation(&request);
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    let access = match request.extensions().get::<MatchedPath>() {
        // The answers to unknown addresses tell nothing.
        None => Access::Public,
        Some(_) => access_of(operation),
    };
    let span = tracing::info_span!(
        "request", request_id = %id, operation, %method, path, key = Empty, trace_id = Empty, parent_span = Empty,
        otel.name = Empty, otel.kind = Empty
    );
    let parent = trace_parent(request.headers());
    if let Some(parent) = parent {
        span.record("trace_id", parent.trace);
        span.record("parent_span", parent.span);
    }
    trace_context::begin(&span, parent, operation);
    let began = Instant::now();
    let (caller, allowed) = authorize(&state, request.headers(), operation, access);
    // Whether it is meant for this service comes first: a stranger's page learns nothing about keys.
    let allowed = host::check(&state, &request, operation)
        .and_then(|()| origin::check(&state, &request))
        .and(allowed)
        .and_then(|()| check_length(&request));
    let writes = matches!(access, Access::Needs(scope) if scope > Scope::Read);
    let writes = writes && method != Method::GET && method != Method::HEAD;
    let refusable = if writes { Refusable::No } else { Refusable::Yes };
    let response = match allowed {
        Ok(()) => {
            if caller.key.is_some() {
                span.record("key", caller.name());
            }
            request.extensions_mut().insert(caller.clone());
            let response = next.run(request).instrument(span.clone()).await;
            hold_answer(response, &state.memory, refusable)
        }
        Err(problem) => problem.into_response(),
    };
    let took = began.elapsed();
    let (mut response, outcome) = span.in_scope(|| finish(response, &id));
    let status = response.status();
    if writes {
        let entry = Entry::new(&id, &caller, operation, &path, status.as_u16(), outcome);
        state.audit.write(&entry);
    }
    trace_context::end(&span, status, outcome);
    metrics::count_request(operation, status.as_u16(), took);
    let milliseconds = super::answer::milliseconds(took);
    span.in_scope(|| {
        if is_probe(operation) || operation == "get_metrics" {
            tracing::debug!(status = status.as_u16(), milliseconds, "answered");
        } else {
            tracing::info!(status = status.as_u16(), milliseconds, "answered");
        }
    });
    let headers = response.headers_mut();
    // Only visible ASCII gets through `request_id`, so the value is always a header value.
    if let Ok(value) = HeaderValue::from_str(&id) {
        headers.insert(REQUEST_ID, value);
    }
    headers.insert(
        header::X_CONTENT_TYPE_OPTIONS,
        HeaderValue::from_static("nosniff"),
    );
    // Other sites' pages cannot even embed what needs no leave to be fetched.
    headers.insert(
        "cross-origin-resource-policy",
        HeaderValue::from_static("same-origin"),
    );
    headers
        .entry(header::CONTENT_SECURITY_POLICY)
        .or_insert(HeaderValue::from_static(
            "default-src 'none'; frame-ancestors 'none'",
        ));
    headers
        .entry(header::REFERRER_POLICY)
        .or_insert(HeaderValue::from_static("no-referrer"));
    if state.stopping.is_cancelled() {
        headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// A handler panicked.
pub fn panicked(panic: Box<dyn std::any::Any + Send + 'static>) -> Response {
    metrics::count_panic();
    Problem::internal(super::admission::panic_message(&*panic)).into_response()
}

/// No route matches.
pub async fn route_not_found(request: Request) -> Problem {
    Problem::new(
        Code::RouteNotFound,
        format!(
            "there is nothing at {}; /docs lists what there is",
            request.uri().path()
        ),
    )
}

/// Longest path with its query, in bytes.
const MAX_URI_BYTES: usize = 8 << 10;

fn check_length(request: &Request) -> Result<(), Problem> {
    let length = request.uri().path_and_query().map_or(0, |p| p.as_str().len());
    if length <= MAX_URI_BYTES {
        return Ok(());
    }
    let detail = format!("the address has {length} bytes, at most {MAX_URI_BYTES} are read");
    Err(Problem::new(Code::UriTooLong, detail).with("limit_bytes", MAX_URI_BYTES))
}

/// Turns whatever failed into a problem document with the request's id. Also gives `done` or the problem's code.
fn finish(mut response: Response, id: &str) -> (Response, &'static str) {
    let status = response.status();
    if !status.is_client_error() && !status.is_server_error() {
        return (response, "done");
    }
    let problem = response
        .extensions_mut()
        .remove::<Problem>()
        .unwrap_or_else(|| from_status(status));
    metrics::count_problem(problem.code);
    match &problem.internal {
        Some(internal) => tracing::error!(code = problem.code.name(), internal, "{}", problem.detail),
        None => tracing::info!(code = problem.code.name(), "{}", problem.detail),
    }
    let mut rendered = problem.to_response(Some(id));
    // What a method fallback says about the methods there are.
    if let Some(allow) = response.headers_mut().remove(header::ALLOW) {
        rendered.headers_mut().insert(header::ALLOW, allow);
    }
    (rendered, problem.code.name())
}

/// A problem for a failure that axum or a layer answered by itself.
fn from_status(status: StatusCode) -> Problem {
    let code = match status {
        StatusCode::MISDIRECTED_REQUEST => Code::MisdirectedRequest,
        StatusCode::UNAUTHORIZED => Code::Unauthorized,
        StatusCode::FORBIDDEN => Code::InsufficientScope,
        StatusCode::NOT_FOUND => Code::RouteNotFound,
        StatusCode::METHOD_NOT_ALLOWED => Code::MethodNotAllowed,
        StatusCode::REQUEST_TIMEOUT => Code::RequestTimeout,
        StatusCode::PAYLOAD_TOO_LARGE => Code::BodyTooLarge,
        StatusCode::URI_TOO_LONG => Code::UriTooLong,
        StatusCode::UNSUPPORTED_MEDIA_TYPE => Code::UnsupportedMediaType,
        StatusCode::SERVICE_UNAVAILABLE => Code::Overloaded,
        StatusCode::GATEWAY_TIMEOUT => Code::DeadlineExceeded,
        other if other.is_client_error() => Code::InvalidRequest,
        _ => Code::Internal,
    };
    Problem::new(code, code.title())
}

/// The id the client sent, where it is 1 to 128 visible ASCII characters, or a new one.
fn request_id(request: &Request) -> String {
    request
        .headers()
        .get(REQUEST_ID)
        .and_then(|v| v.to_str().ok())
        .filter(|v| (1..=128).contains(&v.len()) && v.bytes().all(|b| b.is_ascii_graphic()))
        .map_or_else(|| uuid::Uuid::now_v7().to_string(), str::to_owned)
}

fn operation(request: &Request) -> &'static str {
    let method = match *request.method() {
        Method::HEAD => &Method::GET,
        ref other => other,
    };
    request
        .extensions()
        .get::<MatchedPath>()
        .and_then(|path| super::openapi::operation_id(method, path.as_str()))
        .unwrap_or(UNMATCHED)
}
