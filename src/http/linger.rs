//! What is left of a body whose request is answered already.
//!
//! A server that closes a connection while its client still sends makes the system throw the answer away, and the
//! client reports a broken connection instead of the problem. So the rest is read for a while, and dropped.

use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::http::header;
use bytes::Bytes;
use futures_util::StreamExt;
use http_body::{Frame, SizeHint};
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

/// For how long.
const LINGER: Duration = Duration::from_secs(5);

/// Sees to it that what a handler leaves of the body is still read.
pub fn linger(request: Request) -> Request {
    if request.body().is_end_stream() {
        return request;
    }
    // Such a client sends nothing until it is told to, and one that is answered instead sends nothing at all.
    let waits = request
        .headers()
        .get(header::EXPECT)
        .is_some_and(|value| value.as_bytes().eq_ignore_ascii_case(b"100-continue"));
    request.map(|body| {
        Body::new(Lingering {
            body: Some(body),
            begun: !waits,
        })
    })
}

struct Lingering {
    /// `None` from its end on.
    body: Option<Body>,
    /// Whether the client sends.
    begun: bool,
}

impl HttpBody for Lingering {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        self.begun = true;
        let Some(body) = &mut self.body else {
            return Poll::Ready(None);
        };
        let polled = Pin::new(body).poll_frame(context);
        if matches!(polled, Poll::Ready(None | Some(Err(_)))) {
            self.body = None;
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.body.as_ref().is_none_or(HttpBody::is_end_stream)
    }

    fn size_hint(&self) -> SizeHint {
        self.body.as_ref().map(HttpBody::size_hint).unwrap_or_default()
    }
}

impl Drop for Lingering {
    fn drop(&mut self) {
        let Some(body) = self
            .body
            .take()
            .filter(|body| self.begun && !body.is_end_stream())
        else {
            return;
        };
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            runtime.spawn(async move {
                let mut rest = body.into_data_stream();
                let read = async { while let Some(Ok(_)) = rest.next().await {} };
                let _ = tokio::time::timeout(LINGER, read).await;
            });
        }
    }
}
