//! The routes with everything around them.

use super::auth::API_KEY;
use super::compression;
use super::middleware::{REQUEST_ID, around};
use super::problem::{Code, Problem};
use super::route::operations;
use super::routes::routes;
use super::state::AppState;
use axum::Router;
use axum::extract::{DefaultBodyLimit, Request};
use axum::http::{HeaderName, HeaderValue, Method, header};
use std::time::Duration;
use tower_http::cors::{AllowOrigin, CorsLayer};

/// The service as a router: every route, behind the middleware.
pub fn router(state: AppState) -> Router {
    let table = routes();
    let known = operations(&table);
    let routes = table.into_iter().fold(Router::new(), |router, route| {
        router.route(&route.info.path, route.handler)
    });
    let routes = routes
        .fallback(route_not_found)
        .layer(DefaultBodyLimit::max(state.config.max_body_bytes));
    let cors = cors(&state.config.cors_origins);
    let routes = around(routes, &state, known)
        .layer(compression::layer())
        .with_state(state);
    match cors {
        Some(cors) => routes.layer(cors),
        None => routes,
    }
}

/// No route matches.
async fn route_not_found(request: Request) -> Problem {
    let path = request.uri().path();
    let detail = format!("there is nothing at {path}; /docs lists what there is");
    Problem::new(Code::RouteNotFound, detail)
}

/// What browsers are told about other sites' pages; `None` where none may call.
fn cors(origins: &[String]) -> Option<CorsLayer> {
    if origins.is_empty() {
        return None;
    }
    let allowed = if origins.iter().any(|o| o == "*") {
        AllowOrigin::any()
    } else {
        AllowOrigin::list(origins.iter().filter_map(|o| HeaderValue::from_str(o).ok()))
    };
    let layer = CorsLayer::new()
        .allow_origin(allowed)
        .allow_methods([Method::GET, Method::POST, Method::PATCH, Method::DELETE])
        .allow_headers([
            header::AUTHORIZATION,
            API_KEY,
            header::CONTENT_TYPE,
            header::IF_MATCH,
            header::IF_NONE_MATCH,
            HeaderName::from_static("idempotency-key"),
            HeaderName::from_static("traceparent"),
            REQUEST_ID,
        ])
        .expose_headers([header::ETAG, header::LOCATION, header::RETRY_AFTER, REQUEST_ID])
        .max_age(Duration::from_secs(600));
    Some(layer)
}
