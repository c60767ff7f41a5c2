//! The memory of a request, from the first byte of its body to the last of its answer.

use super::problem::Problem;
use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures_util::StreamExt;
use http_body::{Frame, SizeHint};
use shapelex_core::memory::{MemoryBudget, Reservation};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use tokio::io::AsyncRead;

#[derive(Clone)]
struct RequestMemory(Arc<Reservation>);

/// Gives a request its reservation, empty so far.
pub fn begin(request: &mut Request, budget: &MemoryBudget) {
    let memory = RequestMemory(Arc::new(budget.reservation()));
    request.extensions_mut().insert(memory);
}

/// The reservation of a request that went through [`begin`].
///
/// # Errors
/// `internal` where it did not.
pub fn of(request: &Request) -> Result<Arc<Reservation>, Problem> {
    let memory = request.extensions().get::<RequestMemory>();
    memory
        .map(|memory| Arc::clone(&memory.0))
        .ok_or_else(|| Problem::internal("the request has no reservation of memory"))
}

/// Answers up to this many bytes are not counted: a thousand connections have 16 MiB of them.
const COUNTED_FROM: u64 = 16 << 10;

/// Whether an answer may still be replaced by a refusal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusable {
    /// Nothing was changed; the client may ask again.
    Yes,
    /// What was done has to be told.
    No,
}

/// Counts an answer that is held as a whole until its client has read it.
pub fn hold_answer(response: Response, budget: &MemoryBudget, refusable: Refusable) -> Response {
    let bytes = response.body().size_hint().lower();
    if bytes < COUNTED_FROM {
        return response;
    }
    let memory = budget.reservation();
    match refusable {
        Refusable::No => memory.add(bytes),
        Refusable::Yes => {
            if let Err(error) = memory.grow(bytes) {
                return Problem::from(error).into_response();
            }
        }
    }
    response.map(|body| {
        Body::new(HeldBody {
            body,
            _memory: memory,
        })
    })
}

struct HeldBody {
    body: Body,
    _memory: Reservation,
}

impl HttpBody for HeldBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// What an item of a list takes per byte of its record: as it is read, as it goes over the wire, and as text.
const PAGE_FACTOR: u64 = 6;

/// Reserves memory for the items of a page, as they are read.
pub fn page_memory(memory: &Reservation) -> impl FnMut(usize) -> Result<(), Problem> {
    |bytes| Ok(memory.grow(PAGE_FACTOR * bytes as u64)?)
}

/// Counts an event until the next one. Short ones are not counted, as short answers are not.
pub fn counted_event(memory: &Reservation, bytes: u64) -> bool {
    memory.shrink(u64::MAX);
    bytes < COUNTED_FROM || memory.grow(bytes).is_ok()
}

/// Bytes that are read of a file at a time.
const FILE_PIECE: usize = 64 << 10;
/// Pieces that are held at a time: by the file, by the stream, and while the client takes them.
const FILE_PIECES: u64 = 4;

/// A file as a body.
///
/// # Errors
/// `overloaded` where there is no memory for its pieces.
pub fn file_body(file: impl AsyncRead + Send + 'static, budget: &MemoryBudget) -> Result<Body, Problem> {
    let memory = budget.reservation();
    memory.grow(FILE_PIECES * FILE_PIECE as u64)?;
    let pieces = tokio_util::io::ReaderStream::with_capacity(file, FILE_PIECE);
    Ok(Body::from_stream(pieces.inspect(move |_| {
        // Held for as long as the stream is.
        let _ = &memory;
    })))
}
