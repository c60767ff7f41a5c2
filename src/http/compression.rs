//! Compression of answers, where a client asks for it by `accept-encoding`.
//!
//! Lists, rankings and documents shrink to a tenth. What is sent as it happens (events, lines of a batch), and files, which
//! have a tag of their bytes and are compressed already or cheap to compress by the client, are sent as they are.

use axum::http::header;
use tower_http::CompressionLevel;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{And, Predicate, SizeAbove};

/// Answers below this length, in bytes, are not worth it.
const SHORTEST: u16 = 1024;

/// The media types that are compressed.
const COMPRESSED: [&str; 5] = [
    "application/json",
    "application/problem+json",
    "application/yaml",
    "text/html",
    "text/plain",
];

/// The layer: gzip or zstd, whichever the client prefers, at the fastest level.
pub(super) fn layer() -> CompressionLayer<And<SizeAbove, Documents>> {
    CompressionLayer::new()
        .quality(CompressionLevel::Fastest)
        .compress_when(SizeAbove::new(SHORTEST).and(Documents))
}

/// Accepts answers of the types above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Documents;

impl Predicate for Documents {
    fn should_compress<B>(&self, response: &axum::http::Response<B>) -> bool
    where
        B: axum::body::HttpBody,
    {
        let media_type = response.headers().get(header::CONTENT_TYPE);
        let essence = media_type
            .and_then(|value| value.to_str().ok())
            .and_then(|value| value.split(';').next());
        essence.is_some_and(|essence| COMPRESSED.contains(&essence.trim()))
    }
}
