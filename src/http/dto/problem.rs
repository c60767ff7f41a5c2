//! The problem document's schema.

use serde::Serialize;
use utoipa::ToSchema;

/// What went wrong (RFC 9457). Some problems carry further named values, such as `limit_bytes`.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(
    example = json!({
        "type": "/docs#class_not_found",
        "title": "There is no such class",
        "status": 404,
        "detail": "there is no class 'unicorn'",
        "code": "class_not_found",
        "request_id": "01980c63-5f0e-7d52-a3f5-8b7f5d6f9a10"
    })
)]
#[allow(dead_code, reason = "only its schema is used; see http::problem::Problem")]
pub struct ProblemDocument {
    /// Where the code is explained.
    #[serde(rename = "type")]
    pub kind: String,
    /// What the code means, the same words every time.
    pub title: String,
    /// The HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What happened this time.
    pub detail: String,
    /// The stable code to act on.
    pub code: String,
    /// The request's id, as in the header `x-request-id` and in the service's log.
    pub request_id: String,
}
