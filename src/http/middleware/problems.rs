//! A problem document for every failure, also those that axum or a layer answers.

use super::identify::RequestId;
use crate::http::admission::panic_message;
use crate::http::caller::Caller;
use crate::http::metrics;
use crate::http::problem::{Code, Problem};
use axum::extract::Request;
use axum::http::{StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// How a request ended: `done`, or the problem's code. Among the extensions of every response.
#[derive(Clone, Copy, Debug)]
pub struct Outcome(pub &'static str);

impl Default for Outcome {
    fn default() -> Self {
        Self("done")
    }
}

/// Writes a failure as a problem document with the request's id.
pub async fn render(request: Request, next: Next) -> Response {
    let id = request
        .extensions()
        .get::<RequestId>()
        .cloned()
        .unwrap_or_default();
    let response = next.run(request).await;
    let status = response.status();
    let failed = status.is_client_error() || status.is_server_error();
    let (mut response, outcome) = if failed {
        document(response, &id.0)
    } else {
        (response, Outcome::default())
    };
    response.extensions_mut().insert(outcome);
    response
}

/// A handler panicked.
pub fn panicked(panic: Box<dyn std::any::Any + Send + 'static>) -> Response {
    metrics::count_panic();
    Problem::internal(panic_message(&*panic)).into_response()
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

fn document(mut response: Response, id: &str) -> (Response, Outcome) {
    let problem = response
        .extensions_mut()
        .remove::<Problem>()
        .unwrap_or_else(|| from_status(response.status()));
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
    if let Some(caller) = response.extensions_mut().remove::<Caller>() {
        rendered.extensions_mut().insert(caller);
    }
    (rendered, Outcome(problem.code.name()))
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
