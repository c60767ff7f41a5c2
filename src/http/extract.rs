//! axum's extractors with problems for rejections.

use super::arriving::Arriving;
use super::body::{body_too_large, broke_off, no_room, within};
use super::problem::{Code, Problem};
use super::request_memory;
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::header;
use axum::http::request::Parts;
use futures_util::StreamExt;
use serde::de::DeserializeOwned;
use std::time::Duration;

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

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for ApiQuery<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        Query::<T>::from_request_parts(parts, state)
            .await
            .map(|Query(value)| Self(value))
            .map_err(|e| Problem::new(Code::InvalidQuery, e.body_text()))
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
    let bytes = within(JSON_WITHIN, receive(request)).await?;
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

/// A body of at most [`MAX_JSON_BYTES`], counted as memory of the request.
async fn receive(request: Request) -> Result<bytes::Bytes, Problem> {
    let memory = request_memory::of(&request)?;
    let mut body = Arriving::new(MAX_JSON_BYTES, &memory);
    let mut pieces = request.into_body().into_data_stream();
    while let Some(piece) = pieces.next().await {
        let piece = piece.map_err(broke_off)?;
        if body.len() + piece.len() > MAX_JSON_BYTES {
            return Err(body_too_large(MAX_JSON_BYTES));
        }
        body.push(&piece).map_err(no_room)?;
    }
    Ok(body.into_bytes())
}

fn parse<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    // serde would read a list as the fields of a struct in their order; the API promises objects.
    if body.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'[') {
        return Err(Problem::new(
            Code::InvalidField,
            "expected an object, found a list",
        ));
    }
    serde_json::from_slice(body).map_err(|error| {
        let code = match error.classify() {
            serde_json::error::Category::Data => Code::InvalidField,
            _ => Code::InvalidJson,
        };
        Problem::new(code, error.to_string())
            .with("line", error.line())
            .with("column", error.column())
    })
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
