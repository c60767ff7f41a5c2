//! What an address says to a method that it does not answer: which methods it does.

use crate::http::operation::Operations;
use crate::http::problem::{Code, Problem};
use axum::extract::{MatchedPath, Request, State};
use axum::http::StatusCode;
use axum::middleware::Next;
use axum::response::Response;
use std::sync::Arc;

/// Gives a 405 of the router the problem that names the methods of its address.
pub async fn name(State(operations): State<Arc<Operations>>, request: Request, next: Next) -> Response {
    let matched = request.extensions().get::<MatchedPath>().cloned();
    let mut response = next.run(request).await;
    if response.status() == StatusCode::METHOD_NOT_ALLOWED
        && response.extensions().get::<Problem>().is_none()
        && let Some(path) = matched
    {
        let methods = operations.methods_of(path.as_str()).join(", ");
        let problem = Problem::new(
            Code::MethodNotAllowed,
            format!("this address answers {methods} only"),
        );
        response.extensions_mut().insert(problem);
    }
    response
}
