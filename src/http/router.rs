//! The route table.

use super::auth::API_KEY;
use super::compression;
use super::respond::{REQUEST_ID, around, panicked, route_not_found};
use super::routes::{classes, datasets, docs, health, index, jobs, keys, query, shapes, snapshots};
use super::state::AppState;
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::from_fn_with_state;
use axum::routing::{delete, get, post};
use std::time::Duration;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::cors::{AllowOrigin, CorsLayer};

/// Every route of the service.
pub fn router(state: AppState) -> Router {
    let cors = cors(&state.config.cors_origins);
    let routes = Router::new()
        .route(
            "/v1/classes",
            get(classes::list_classes).post(classes::create_class),
        )
        .route(
            "/v1/classes/{class}",
            get(classes::get_class)
                .patch(classes::rename_class)
                .delete(classes::delete_class),
        )
        .route(
            "/v1/classes/{class}/shapes",
            get(shapes::list_shapes).post(shapes::create_shapes),
        )
        .route(
            "/v1/classes/{class}/shapes/{shape}",
            get(shapes::get_shape).delete(shapes::delete_shape),
        )
        .route(
            "/v1/classes/{class}/shapes/{shape}/original",
            get(shapes::get_original),
        )
        .route("/v1/shapes", post(datasets::upload_dataset))
        .route("/v1/reindex", post(jobs::start_reindex))
        .route("/v1/jobs", get(jobs::list_jobs))
        .route("/v1/jobs/{job}", get(jobs::get_job))
        .route("/v1/jobs/{job}/cancel", post(jobs::cancel_job))
        .route("/v1/jobs/{job}/events", get(jobs::follow_job))
        .route("/v1/query", post(query::query_mesh))
        .route("/v1/query/batch", post(query::query_batch))
        .route("/v1/index", get(index::get_index))
        .route("/v1/parameters", get(index::get_parameters))
        .route("/v1/keys", get(keys::list_keys).post(keys::create_key))
        .route("/v1/keys/{key}", delete(keys::revoke_key))
        .route(
            "/v1/snapshots",
            get(snapshots::list_snapshots).post(snapshots::create_snapshot),
        )
        .route("/v1/snapshots/restore", post(snapshots::restore_upload))
        .route(
            "/v1/snapshots/{snapshot}",
            get(snapshots::get_snapshot).delete(snapshots::delete_snapshot),
        )
        .route("/v1/snapshots/{snapshot}/file", get(snapshots::get_snapshot_file))
        .route(
            "/v1/snapshots/{snapshot}/restore",
            post(snapshots::restore_snapshot),
        )
        .route("/healthz", get(health::get_liveness))
        .route("/readyz", get(health::get_readiness))
        .route("/metrics", get(health::get_metrics))
        .route("/", get(docs::get_page))
        .route("/docs", get(docs::get_docs))
        .route("/openapi.yaml", get(docs::get_openapi_yaml))
        .route("/openapi.json", get(docs::get_openapi_json))
        .fallback(route_not_found)
        .layer(DefaultBodyLimit::max(state.config.max_body_bytes))
        .layer(CatchPanicLayer::custom(panicked))
        .layer(from_fn_with_state(state.clone(), around))
        .layer(compression::layer())
        .with_state(state);
    match cors {
        Some(cors) => routes.layer(cors),
        None => routes,
    }
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
