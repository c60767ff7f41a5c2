//! The page, and the API's description for machines and for people.

use crate::http::AppState;
use crate::http::access::Access;
use crate::http::route::Route;
use axum::extract::State;
use axum::http::{HeaderName, header};
use axum::response::IntoResponse;
use utoipa_axum::routes;

/// The routes of this file: handler, what it demands, the problems of its own.
pub(super) fn routes() -> Vec<Route> {
    vec![
        Route::new(routes!(get_page), Access::Public, &[]),
        Route::new(routes!(get_docs), Access::Public, &[]),
        Route::new(routes!(get_openapi_yaml), Access::Public, &[]),
        Route::new(routes!(get_openapi_json), Access::Public, &[]),
    ]
}

/// Nothing is loaded from elsewhere, and no other site may frame the pages.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'; \
                      img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

fn page(text: &'static str) -> impl IntoResponse {
    let headers: [(HeaderName, &str); 4] = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (headers, text)
}

/// The page
///
/// Drop a mesh and see the ranking.
#[utoipa::path(
    get, path = "/", tag = "documents",
    responses((status = 200, description = "HTML", body = String, content_type = "text/html"))
)]
pub async fn get_page() -> impl IntoResponse {
    page(include_str!("../../../web/index.html"))
}

/// The API, to read
#[utoipa::path(
    get, path = "/docs", tag = "documents",
    responses((status = 200, description = "HTML", body = String, content_type = "text/html"))
)]
pub async fn get_docs() -> impl IntoResponse {
    page(include_str!("../../../web/docs.html"))
}

/// The API, as OpenAPI in YAML
#[utoipa::path(
    get, path = "/openapi.yaml", tag = "documents",
    responses((status = 200, description = "YAML", body = Object, content_type = "application/yaml"))
)]
pub async fn get_openapi_yaml(State(state): State<AppState>) -> impl IntoResponse {
    (
        [(header::CONTENT_TYPE, "application/yaml")],
        state.document_yaml.clone(),
    )
}

/// The API, as OpenAPI in JSON
#[utoipa::path(
    get, path = "/openapi.json", tag = "documents",
    responses((status = 200, description = "JSON", body = Object, content_type = "application/json"))
)]
pub async fn get_openapi_json(State(state): State<AppState>) -> impl IntoResponse {
    (
        [(header::CONTENT_TYPE, "application/json")],
        state.document_json.clone(),
    )
}
