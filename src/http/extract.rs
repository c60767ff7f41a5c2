//! axum's extractors with problems for rejections.

use super::arriving::Arriving;
use super::body::{body_too_large, broke_off, no_room, within};
use super::problem::{Code, Problem};
use super::query_string;
use super::request_memory;
use axum::extract::{FromRequest, FromRequestParts, Path, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use futures_util::StreamExt;
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
    let declared = media_type(request.headers());
    let bytes = within(JSON_WITHIN, receive(request)).await?;
    match declared {
        _ if bytes.is_empty() => Ok(bytes),
        Some(declared) if is_json(&declared) => Ok(bytes),
        Some(other) => Err(unsupported(&format!("'{other}'"))),
        None => Err(unsupported("a body without a content type")),
    }
}

fn unsupported(found: &str) -> Problem {
    Problem::new(
        Code::UnsupportedMediaType,
        format!("{found} is not read here; send JSON with 'content-type: application/json'"),
    )
}

/// The declared media type in lower case, without its parameters. Several declarations are none: which one counts
/// would depend on who reads them.
pub(super) fn media_type(headers: &HeaderMap) -> Option<String> {
    let mut declared = headers.get_all(header::CONTENT_TYPE).iter();
    let (first, None) = (declared.next()?, declared.next()) else {
        return None;
    };
    let text = String::from_utf8_lossy(first.as_bytes()).to_ascii_lowercase();
    Some(text.split(';').next().unwrap_or_default().trim().to_owned())
}

/// `application/json`, or a type built on it, such as `application/merge-patch+json`. No form of a web page sends these.
fn is_json(media_type: &str) -> bool {
    media_type
        .strip_prefix("application/")
        .is_some_and(|kind| kind == "json" || kind.ends_with("+json"))
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
    if body.trim_ascii().is_empty() {
        return Err(Problem::new(
            Code::InvalidJson,
            "the body is empty; send a JSON object with 'content-type: application/json'",
        ));
    }
    // serde would read a list as the fields of a struct in their order; the API promises objects.
    if body.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'[') {
        return Err(Problem::new(
            Code::InvalidField,
            "expected an object, found a list",
        ));
    }
    let mut reader = serde_json::Deserializer::from_slice(body);
    let value = serde_path_to_error::deserialize(&mut reader)
        .map_err(|error| refused(body, &error.path().to_string(), error.inner()))?;
    reader.end().map_err(|error| refused(body, ".", &error))?;
    Ok(value)
}

/// The problem of a body that is no JSON, or whose field at `path` is not what it must be; `.` is the body itself.
fn refused(body: &[u8], path: &str, error: &serde_json::Error) -> Problem {
    let text = error.to_string();
    // The place has members of its own.
    let said = text.split(" at line ").next().unwrap_or_default();
    let reason = in_words(said);
    let (line, column) = (error.line(), error.column());
    // A field of the wrong type reads as bad syntax where another was expected.
    let is_json = serde_json::from_slice::<serde::de::IgnoredAny>(body).is_ok();
    let problem = match path {
        _ if !is_json => Problem::new(
            Code::InvalidJson,
            format!("not JSON: {reason} (line {line}, column {column})"),
        ),
        "." => Problem::new(Code::InvalidField, format!("the body: {reason}")),
        path => Problem::new(Code::InvalidField, format!("{path}: {reason}")).with("name", path),
    };
    problem.with("line", line).with("column", column)
}

/// What the deserialiser says, in the words of the API: what was expected, and what was found.
fn in_words(said: &str) -> String {
    let plain = |text: &str| text.replace('`', "'");
    let listed = |rest: &str| {
        let names = rest.trim_start_matches("expected ").trim_start_matches("one of ");
        names.replace('`', "").replace(" or ", ", ")
    };
    if let Some(rest) = said.strip_prefix("unknown field ") {
        let (field, known) = rest.split_once(", ").unwrap_or((rest, ""));
        return match known.starts_with("expected") {
            true => format!("there is no field {}; there are {}", plain(field), listed(known)),
            false => format!("there is no field {}", plain(field)),
        };
    }
    if let Some(rest) = said.strip_prefix("unknown variant ") {
        let (value, known) = rest.split_once(", ").unwrap_or((rest, ""));
        return format!("expected one of {}, found {}", listed(known), plain(value));
    }
    if let Some(field) = said.strip_prefix("missing field ") {
        return format!("the field {} is missing", plain(field));
    }
    let wrong = ["invalid type: ", "invalid value: ", "invalid length "];
    if let Some(rest) = wrong.iter().find_map(|wrong| said.strip_prefix(wrong))
        && let Some((found, expected)) = rest.rsplit_once(", expected ")
    {
        return format!("expected {}, found {}", plain(expected), plain(found));
    }
    said.to_owned()
}

/// For fields that are objects: refuses the lists serde would read as their fields in order.
pub(super) fn object<'de, D, T>(deserializer: D) -> Result<Option<T>, D::Error>
where
    D: serde::Deserializer<'de>,
    T: DeserializeOwned,
{
    use serde::Deserialize;
    let map = Option::<serde_json::Map<String, serde_json::Value>>::deserialize(deserializer)?;
    map.map(|map| {
        serde_path_to_error::deserialize(serde_json::Value::Object(map)).map_err(serde::de::Error::custom)
    })
    .transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::dto::class::CreateClass;
    use crate::http::dto::job::StartReindex;

    fn refused<T: DeserializeOwned>(body: &str) -> String {
        parse::<T>(body.as_bytes()).map(drop).unwrap_err().detail
    }

    #[test]
    fn what_is_wrong_with_a_field_is_said_without_the_deserialisers_words() {
        assert_eq!(
            refused::<CreateClass>("{\"nam\": \"x\"}"),
            "nam: there is no field 'nam'; there are name"
        );
        assert_eq!(
            refused::<CreateClass>("{\"name\": 7}"),
            "name: expected a string, found integer '7'"
        );
        assert_eq!(
            refused::<CreateClass>("{}"),
            "the body: the field 'name' is missing"
        );
        assert_eq!(
            refused::<StartReindex>("{\"preset\": \"quick\"}"),
            "preset: expected one of default, paper, robust, fast, found 'quick'"
        );
        assert!(refused::<CreateClass>(" ").starts_with("the body is empty"));
    }
}
