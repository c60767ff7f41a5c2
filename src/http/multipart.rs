//! A `multipart/form-data` body → its parts, within bounds and in time linear in its length.
//!
//! The parser, `multer`, keeps what it is given until it makes sense of it, looks at all of it again with every piece,
//! and takes pieces for as long as there are any. So it is fed: little by little where the head of a part is due, and
//! no more than a head may have; a piece after the other within a part, whose contents it hands on at once.

use super::archive_path::safe_path;
use super::arriving::Arriving;
use super::body::{body_too_large, clean_name, essence, no_room};
use super::problem::{Code, Problem};
use super::uploaded::Part;
use axum::body::{Body, BodyDataStream};
use axum::extract::multipart::{Field, MultipartError};
use axum::extract::{FromRequest, Multipart, Request};
use bytes::Bytes;
use futures_util::{Stream, StreamExt};
use shapelex_core::memory::Reservation;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};

/// Bytes that may stand before the first part, or in the head of a part.
const MAX_HEAD: usize = 16 << 10;
/// Bytes the parser is given at a time where a head is due, and within a part.
const HEAD_PIECE: usize = 4 << 10;
const BODY_PIECE: usize = 64 << 10;

/// What the parser is given, and why it was given no more.
#[derive(Default)]
struct Feeding {
    /// Bytes given since the head of a part became due; `None` within a part.
    head: Option<usize>,
    refused: Option<Problem>,
}

/// The body, in the pieces the parser takes.
struct Fed {
    body: BodyDataStream,
    rest: Bytes,
    /// Whether the parser has had its turn since the last piece.
    rested: bool,
    feeding: Arc<Mutex<Feeding>>,
    memory: Arc<Reservation>,
}

impl Stream for Fed {
    type Item = Result<Bytes, axum::Error>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        if !self.rested {
            self.rested = true;
            context.waker().wake_by_ref();
            return Poll::Pending;
        }
        while self.rest.is_empty() {
            match self.body.poll_next_unpin(context) {
                Poll::Ready(Some(Ok(piece))) => self.rest = piece,
                other => return other,
            }
        }
        let feeding = Arc::clone(&self.feeding);
        let mut feeding = feeding.lock().unwrap_or_else(PoisonError::into_inner);
        let size = match &mut feeding.head {
            Some(given) => {
                let size = self.rest.len().min(HEAD_PIECE);
                *given += size;
                if *given > MAX_HEAD {
                    feeding.refused = Some(long_head());
                    return Poll::Ready(Some(Err(axum::Error::new(std::fmt::Error))));
                }
                size
            }
            None => self.rest.len().min(BODY_PIECE),
        };
        // Until it comes out of the parser again.
        if let Err(error) = self.memory.grow_body(size as u64) {
            feeding.refused = Some(no_room(error));
            return Poll::Ready(Some(Err(axum::Error::new(error))));
        }
        self.rested = false;
        Poll::Ready(Some(Ok(self.rest.split_to(size))))
    }
}

fn long_head() -> Problem {
    Problem::new(
        Code::InvalidMultipart,
        format!("more than {MAX_HEAD} bytes stand before the first part or in the head of a part"),
    )
    .with("limit_bytes", MAX_HEAD)
}

/// Receives the parts of a body of at most `most` bytes, no more than `max_parts`.
///
/// # Errors
/// `invalid_multipart`, `too_many_files`, `body_too_large`, and `overloaded` where memory is short.
pub(super) async fn receive_multipart(
    request: Request,
    most: usize,
    max_parts: usize,
    memory: &Arc<Reservation>,
) -> Result<Vec<Part>, Problem> {
    let feeding = Arc::new(Mutex::new(Feeding {
        head: Some(0),
        refused: None,
    }));
    let fed = |body: Body| {
        Body::from_stream(Fed {
            body: body.into_data_stream(),
            rest: Bytes::new(),
            rested: true,
            feeding: Arc::clone(&feeding),
            memory: Arc::clone(memory),
        })
    };
    let mut multipart = Multipart::from_request(request.map(fed), &())
        .await
        .map_err(|e| Problem::new(Code::InvalidMultipart, e.body_text()))?;
    let feed = |head| feeding.lock().unwrap_or_else(PoisonError::into_inner).head = head;
    let broken = |error: MultipartError| {
        let refused = feeding
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .refused
            .take();
        match refused {
            Some(problem) => problem,
            None if error.status() == axum::http::StatusCode::PAYLOAD_TOO_LARGE => body_too_large(most),
            None => Problem::new(Code::InvalidMultipart, error.body_text()),
        }
    };
    let mut parts = Vec::new();
    let mut received = 0;
    loop {
        feed(Some(0));
        let Some(field) = multipart.next_field().await.map_err(&broken)? else {
            return Ok(parts);
        };
        feed(None);
        if parts.len() >= max_parts {
            return Err(too_many_parts(max_parts));
        }
        let part = receive_part(field, most.saturating_sub(received), memory, &broken).await?;
        received += part.bytes.len();
        parts.push(part);
    }
}

fn too_many_parts(limit: usize) -> Problem {
    Problem::new(Code::TooManyFiles, format!("more than {limit} files were sent")).with("limit_files", limit)
}

async fn receive_part(
    mut field: Field<'_>,
    most: usize,
    memory: &Reservation,
    broken: &impl Fn(MultipartError) -> Problem,
) -> Result<Part, Problem> {
    let name = clean_name(field.file_name().or(field.name()));
    // Only where it lies among the other files of the form: nothing is ever opened under it.
    let path = field
        .file_name()
        .filter(|name| name.contains(['/', '\\']))
        .and_then(|name| safe_path(name).ok());
    let media_type = field.content_type().map(essence);
    let mut contents = Arriving::new(most, memory);
    while let Some(piece) = field.chunk().await.map_err(broken)? {
        contents.push(&piece).map_err(no_room)?;
        memory.shrink_body(piece.len() as u64);
    }
    Ok(Part {
        name,
        path,
        media_type,
        bytes: contents.into_bytes(),
        packed: false,
    })
}
