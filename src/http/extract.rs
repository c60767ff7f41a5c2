//! axum's extractors with problems for rejections.

use super::problem::{Code, Problem};
use super::query_string;
use super::upload::body_too_large;
use axum::extract::{FromRequest, FromRequestParts, Path, Request};
use axum::http::header;
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use std::time::Duration;
use utoipa::IntoParams;

/// The longest JSON body, in bytes.
pub const MAX_JSON_BYTES: usize = 256 << 10;

/// How long a JSON body may take to arrive.
const JSON_WITHIN: Duration = Duration::from_secs(30);

/// Path parameters.
pub struct ApiPath<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for ApiPath<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        Path::<T>::from_request_parts(parts, state)
            .await
            .map(|Path(value)| Self(value))
            .map_err(|e| Problem::new(Code::InvalidRequest, e.body_text()))
    }
}

/// Query parameters.
pub struct ApiQuery<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + IntoParams> FromRequestParts<S> for ApiQuery<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        query_string::parse(&parts.uri).map(Self)
    }
}

/// A JSON body.
pub struct ApiJson<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned> FromRequest<S> for ApiJson<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, _: &S) -> Result<Self, Problem> {
        parse(&body(request).await?).map(Self)
    }
}

/// A JSON body that may be left out.
pub struct OptionalJson<T>(pub T);

impl<S: Send + Sync, T: DeserializeOwned + Default> FromRequest<S> for OptionalJson<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, _: &S) -> Result<Self, Problem> {
        let body = body(request).await?;
        if body.is_empty() {
            return Ok(Self(T::default()));
        }
        parse(&body).map(Self)
    }
}

async fn body(request: Request) -> Result<bytes::Bytes, Problem> {
    let media_type = request
        .headers()
        .get(header::CONTENT_TYPE)
        .map(|v| String::from_utf8_lossy(v.as_bytes()).to_ascii_lowercase());
    let receiving = axum::body::to_bytes(request.into_body(), MAX_JSON_BYTES);
    let bytes = tokio::time::timeout(JSON_WITHIN, receiving)
        .await
        .map_err(|_| {
            let seconds = JSON_WITHIN.as_secs();
            Problem::new(
                Code::RequestTimeout,
                format!("the body did not arrive within {seconds} s"),
            )
            .with("limit_seconds", seconds)
        })?
        .map_err(|_| body_too_large(MAX_JSON_BYTES))?;
    let essence = media_type
        .as_deref()
        .map(|t| t.split(';').next().unwrap_or_default().trim());
    match essence {
        None | Some("application/json") => Ok(bytes),
        Some(_) if bytes.is_empty() => Ok(bytes),
        Some(other) => Err(Problem::new(
            Code::UnsupportedMediaType,
            format!("'{other}' is not read here; send application/json"),
        )),
    }
}

fn parse<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    // serde would read a list as the fields of a struct in their order; the API promises objects.
    if body.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'[') {
        return Err(Problem::new(
            Code::InvalidField,
            "expected an object, found a list",
        ));
    }
    let mut reader = serde_json::Deserializer::from_slice(body);
    let value = serde_path_to_error::deserialize(&mut reader)
        .map_err(|error| refused(&error.path().to_string(), error.inner()))?;
    reader.end().map_err(|error| refused(".", &error))?;
    Ok(value)
}

/// The problem of a body that is no JSON, or whose field at `path` is not what it must be; `.` is the body itself.
fn refused(path: &str, error: &serde_json::Error) -> Problem {
    let text = error.to_string();
    // The place has members of its own.
    let reason = text.split(" at line ").next().unwrap_or_default();
    let problem = match error.classify() {
        serde_json::error::Category::Data if path == "." => {
            Problem::new(Code::InvalidField, format!("the body: {reason}"))
        }
        serde_json::error::Category::Data => {
            Problem::new(Code::InvalidField, format!("{path}: {reason}")).with("name", path)
        }
        _ => Problem::new(
            Code::InvalidJson,
            format!(
                "not JSON: {reason} (line {}, column {})",
                error.line(),
                error.column()
            ),
        ),
    };
    problem.with("line", error.line()).with("column", error.column())
}

/// For fields that are objects: refuses the lists serde would read as their fields in order.
pub(super) fn object<'de, D, T>(deserializer: D) -> Result<Option<T>, D::Error>
where
    D: serde::Deserializer<'de>,
    T: DeserializeOwned,
{
    use serde::Deserialize;
    let map = Option::<serde_json::Map<String, serde_json::Value>>::deserialize(deserializer)?;
    map.map(|map| serde_json::from_value(serde_json::Value::Object(map)).map_err(serde::de::Error::custom))
        .transpose()
}
