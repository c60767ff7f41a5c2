//! Which request this is: its id and the operation it asks for.

use crate::http::linger::linger;
use crate::http::operation::Operations;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderName, HeaderValue};
use axum::middleware::Next;
use axum::response::Response;
use std::sync::Arc;

/// The header a request id comes in by and goes out by.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// The id of a request. Among the extensions of every request.
#[derive(Clone, Debug, Default)]
pub struct RequestId(pub String);

/// Gives the request its id and its operation, and the response the id.
pub async fn identify(State(operations): State<Arc<Operations>>, request: Request, next: Next) -> Response {
    let id = request_id(&request);
    let path = request.extensions().get::<MatchedPath>();
    let matched = operations.matching(request.method(), path.map(MatchedPath::as_str));
    let mut request = linger(request);
    request.extensions_mut().insert(RequestId(id.clone()));
    request.extensions_mut().insert(matched);
    let mut response = next.run(request).await;
    // Only visible ASCII gets through `request_id`, so the value is always a header value.
    if let Ok(value) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(REQUEST_ID, value);
    }
    response
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
