//! Who asks.

use crate::model::ApiKey;
use axum::extract::FromRequestParts;
use axum::http::request::Parts as RequestParts;
use std::convert::Infallible;
use std::sync::Arc;

/// The API key a request came with, if any. Among the extensions of every request.
#[derive(Clone, Debug, Default)]
pub struct Caller {
    /// The key.
    pub key: Option<Arc<ApiKey>>,
}

impl Caller {
    /// The key's name, or `anonymous`.
    pub fn name(&self) -> &str {
        self.key.as_ref().map_or("anonymous", |key| key.name.as_str())
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Caller {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut RequestParts, _: &S) -> Result<Self, Infallible> {
        Ok(parts.extensions.get::<Self>().cloned().unwrap_or_default())
    }
}
