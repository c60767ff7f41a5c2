//! Server-sent events of a service, as they come.

use super::client::{Client, Transport};
use super::outcome::CallError;
use super::outcome::outcome;
use super::transfer::{authorized, unreachable};
use axum::body::Body;
use axum::http::Request;
use futures_util::StreamExt;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::ops::ControlFlow;
use tower::ServiceExt;

/// Longest answer that is read into memory where there are no events.
const MAX_ANSWER_BYTES: u64 = 1 << 20;
/// Longest event; a job that learnt ten thousand classes names each.
const MAX_EVENT_BYTES: usize = 64 << 20;

impl Client {
    /// Reads the events at a path until `each` breaks or the stream ends.
    ///
    /// # Errors
    /// [`CallError::Refused`] where the service gives no events, [`CallError::Unreachable`] where the stream breaks off.
    pub fn events(
        &self,
        path: &str,
        each: &mut dyn FnMut(Value) -> ControlFlow<()>,
    ) -> Result<(), CallError> {
        let mut lines = EventLines::default();
        match &self.0 {
            Transport::Remote { agent, base, key } => {
                let request = authorized(ureq::http::Request::get(format!("{base}{path}")), key.as_deref())
                    .header("accept", "text/event-stream")
                    .body(())
                    .map_err(unreachable)?;
                let lost = |error: &dyn std::fmt::Display| CallError::Unreachable(format!("{base}: {error}"));
                let mut response = agent.run(request).map_err(|error| lost(&error))?;
                let status = response.status().as_u16();
                if status != 200 {
                    let body = response.body_mut().with_config().limit(MAX_ANSWER_BYTES);
                    let bytes = body.read_to_vec().map_err(|error| lost(&error))?;
                    return self.no_events(status, &bytes);
                }
                let mut body = BufReader::new(response.body_mut().as_reader());
                loop {
                    let piece = body.fill_buf().map_err(|error| lost(&error))?;
                    let length = piece.len();
                    if length == 0 || lines.take(piece, each)?.is_break() {
                        return Ok(());
                    }
                    body.consume(length);
                }
            }
            Transport::Local { runtime, router, .. } => runtime.block_on(async {
                let request = Request::get(path).body(Body::empty()).map_err(unreachable)?;
                let response = match router.clone().oneshot(request).await {
                    Ok(response) => response,
                    Err(never) => match never {},
                };
                let status = response.status().as_u16();
                if status != 200 {
                    let bytes = axum::body::to_bytes(response.into_body(), MAX_ANSWER_BYTES as usize).await;
                    return self.no_events(status, &bytes.map_err(unreachable)?);
                }
                let mut body = response.into_body().into_data_stream();
                while let Some(piece) = body.next().await {
                    if lines.take(&piece.map_err(unreachable)?, each)?.is_break() {
                        break;
                    }
                }
                Ok(())
            }),
        }
    }

    fn no_events(&self, status: u16, bytes: &[u8]) -> Result<(), CallError> {
        match outcome(status, bytes) {
            Ok(_) => Err(CallError::Unreachable(format!(
                "the service answered with status {status} where events were expected"
            ))),
            Err(error) => Err(error.worded(&self.place())),
        }
    }
}

/// The data of events, out of pieces of a stream that may be cut anywhere.
#[derive(Default)]
struct EventLines {
    rest: Vec<u8>,
    data: String,
}

impl EventLines {
    /// Takes a piece; `each` gets the JSON of every event that is complete. Comments, which keep the connection open,
    /// and other fields are passed over.
    fn take(
        &mut self,
        piece: &[u8],
        each: &mut dyn FnMut(Value) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, CallError> {
        self.rest.extend_from_slice(piece);
        if self.rest.len() + self.data.len() > MAX_EVENT_BYTES {
            return Err(unreachable("an event of the service is longer than 64 MiB"));
        }
        while let Some(end) = self.rest.iter().position(|&b| b == b'\n') {
            let line: Vec<u8> = self.rest.drain(..=end).collect();
            let line = String::from_utf8_lossy(&line);
            let line = line.trim_end_matches(['\r', '\n']);
            if let Some(data) = line.strip_prefix("data:") {
                self.data += data.strip_prefix(' ').unwrap_or(data);
                self.data.push('\n');
            } else if line.is_empty() && !self.data.is_empty() {
                let value = serde_json::from_str(&self.data).map_err(unreachable)?;
                self.data.clear();
                if each(value).is_break() {
                    return Ok(ControlFlow::Break(()));
                }
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_put_together_wherever_the_stream_is_cut() {
        let stream = b":\n\nevent: progress\nid: 7\ndata: {\"n\":1}\n\nevent: progress\r\ndata: {\ndata: \"n\":2}\r\n\r\ndata: {\"n\":3}\n\n";
        for cut in 1..stream.len() {
            let mut lines = EventLines::default();
            let mut seen = Vec::new();
            for piece in stream.chunks(cut) {
                let flow = lines
                    .take(piece, &mut |value| {
                        seen.push(value["n"].as_u64().unwrap());
                        if seen.len() == 2 {
                            ControlFlow::Break(())
                        } else {
                            ControlFlow::Continue(())
                        }
                    })
                    .unwrap();
                if flow.is_break() {
                    break;
                }
            }
            assert_eq!(seen, [1, 2], "cut at {cut}");
        }
    }
}
