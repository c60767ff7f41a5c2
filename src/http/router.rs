//! The route table.

use super::respond::{around, panicked, route_not_found};
use super::routes::{classes, docs, health, index, jobs, keys, query, shapes, snapshots};
use super::state::AppState;
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware::from_fn_with_state;
use axum::routing::{delete, get, post};
use tower_http::catch_panic::CatchPanicLayer;

/// Every route of the service.
pub fn router(state: AppState) -> Router {
    Router::new()
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
        .with_state(state)
}
