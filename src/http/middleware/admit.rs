//! Whether a request is let in: by the name it calls the service by, by the page it comes from, by its key.

use crate::http::auth::authorize;
use crate::http::operation::Matched;
use crate::http::problem::{Code, Problem};
use crate::http::state::AppState;
use crate::http::{host, origin};
use axum::extract::{Request, State};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Refuses the request, or runs it with its [`Caller`](crate::http::caller::Caller) among its extensions.
pub async fn admit(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    let access = Matched::of(&request).access();
    let (caller, authorized) = authorize(&state, request.headers(), access);
    // Whether it is meant for this service comes first: a foreign page learns nothing about keys.
    let admitted = host::check(&state, &request, access)
        .and_then(|()| origin::check(&state, &request))
        .and(authorized)
        .and_then(|()| check_length(&request));
    let mut response = match admitted {
        Ok(()) => {
            if caller.key.is_some() {
                tracing::Span::current().record("key", caller.name());
            }
            request.extensions_mut().insert(caller.clone());
            next.run(request).await
        }
        Err(problem) => problem.into_response(),
    };
    response.extensions_mut().insert(caller);
    response
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
