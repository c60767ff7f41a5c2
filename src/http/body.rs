//! What all bodies have in common: how long they may be, how long they may take, and what they are called.

use super::problem::{Code, Problem};
use crate::model::text::is_hidden;
use axum::http::{HeaderMap, header};
use shapelex_core::memory::MemoryError;
use std::future::Future;
use std::time::Duration;

/// What a body's arrival comes to, or `request_timeout` where it takes longer than `limit`.
pub async fn within<T>(
    limit: Duration,
    receiving: impl Future<Output = Result<T, Problem>>,
) -> Result<T, Problem> {
    match tokio::time::timeout(limit, receiving).await {
        Ok(received) => received,
        Err(_) => Err(too_late(limit)),
    }
}

/// The problem of a body that takes longer than `limit` to arrive.
pub fn too_late(limit: Duration) -> Problem {
    let seconds = limit.as_secs_f64();
    Problem::new(
        Code::RequestTimeout,
        format!("the body did not arrive within {seconds:.1} s"),
    )
    .with("limit_seconds", seconds)
}

/// The problem of a body longer than the limit.
pub fn body_too_large(limit: usize) -> Problem {
    Problem::new(
        Code::BodyTooLarge,
        format!("the body is longer than {limit} bytes"),
    )
    .with("limit_bytes", limit)
}

/// The problem of a body for which there is no memory: for good, or at the moment.
pub fn no_room(error: MemoryError) -> Problem {
    match error {
        MemoryError::NeverFits { needed, limit } => Problem::new(
            Code::BodyTooLarge,
            format!("a body of {needed} bytes or more does not fit the memory for bodies, {limit} bytes; send less at a time"),
        )
        .with("limit_bytes", limit),
        MemoryError::NotNow { .. } => error.into(),
    }
}

/// The problem of a body that broke off.
pub fn broke_off(error: axum::Error) -> Problem {
    Problem::new(Code::InvalidRequest, "the body broke off while it arrived").logged(error)
}

/// Bytes the body has at most: as many as are declared, or the limit.
pub fn most_bytes(headers: &HeaderMap, limit: usize, memory: u64) -> Result<usize, Problem> {
    let Some(length) = content_length(headers) else {
        return Ok(limit);
    };
    if length > limit as u64 {
        return Err(body_too_large(limit).with("body_bytes", length));
    }
    if length > memory {
        return Err(no_room(MemoryError::NeverFits {
            needed: length,
            limit: memory,
        }));
    }
    Ok(usize::try_from(length).unwrap_or(limit))
}

fn content_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// The media type of a body, where it is declared.
pub fn media_type(headers: &HeaderMap) -> Option<String> {
    headers.get(header::CONTENT_TYPE)?.to_str().ok().map(essence)
}

/// A media type without its parameters, in small letters.
pub fn essence(media_type: &str) -> String {
    let essence = media_type.split(';').next().unwrap_or_default();
    essence.trim().to_ascii_lowercase()
}

/// A name as it is kept: no folders from outside, no hidden characters, at most 200 characters.
pub fn clean_name(name: Option<&str>) -> String {
    let name: String = name
        .unwrap_or_default()
        .rsplit(['/', '\\'])
        .next()
        .unwrap_or_default()
        .chars()
        .filter(|&c| !is_hidden(c))
        .take(200)
        .collect();
    let name = name.trim();
    if name.is_empty() {
        "mesh".to_owned()
    } else {
        name.to_owned()
    }
}
