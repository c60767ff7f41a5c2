//! Files too large for memory, sent to a service and fetched from it piece by piece.

use super::CliError;
use super::client::{Client, Transport};
use super::outcome::CallError;
use super::outcome::outcome;
use axum::body::Body;
use axum::http::Request;
use futures_util::StreamExt;
use serde_json::Value;
use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::path::Path;
use tower::ServiceExt;

/// Longest answer that is read into memory.
const MAX_ANSWER_BYTES: u64 = 1 << 20;
const PIECE: usize = 256 << 10;

pub(super) fn unreachable(error: impl std::fmt::Display) -> CallError {
    CallError::Unreachable(error.to_string())
}

impl Client {
    /// Sends a file as the body of a POST.
    ///
    /// # Errors
    /// [`CliError::Failed`] where the file cannot be read, the service refuses or nobody answers.
    pub fn send_file(&self, path: &str, media_type: &str, from: &Path) -> Result<Value, CliError> {
        let file = File::open(from).map_err(|error| CliError::at(from, error))?;
        let length = file.metadata().map_err(|error| CliError::at(from, error))?.len();
        let (status, bytes) = match &self.0 {
            Transport::Remote { agent, base, key } => {
                let request = authorized(ureq::http::Request::post(format!("{base}{path}")), key.as_deref())
                    .header("content-type", media_type)
                    .header("content-length", length)
                    .body(file)
                    .map_err(unreachable)?;
                let mut response = agent.run(request).map_err(unreachable)?;
                let status = response.status().as_u16();
                let body = response.body_mut().with_config().limit(MAX_ANSWER_BYTES);
                (status, body.read_to_vec().map_err(unreachable)?)
            }
            Transport::Local { runtime, router, .. } => runtime.block_on(async {
                let file = tokio::fs::File::from_std(file);
                let request = Request::post(path)
                    .header("content-type", media_type)
                    .header("content-length", length)
                    .body(Body::from_stream(tokio_util::io::ReaderStream::with_capacity(
                        file, PIECE,
                    )))
                    .map_err(unreachable)?;
                let response = match router.clone().oneshot(request).await {
                    Ok(response) => response,
                    Err(never) => match never {},
                };
                let status = response.status().as_u16();
                let bytes = axum::body::to_bytes(response.into_body(), MAX_ANSWER_BYTES as usize).await;
                Ok::<_, CallError>((status, bytes.map_err(unreachable)?.to_vec()))
            })?,
        };
        Ok(outcome(status, &bytes).map_err(|error| error.worded(&self.place()))?)
    }

    /// Saves what a GET answers with: all of it, or nothing at the file's place. Returns its length.
    ///
    /// # Errors
    /// [`CliError::Failed`] where the file cannot be written, the service refuses or the answer breaks off.
    pub fn download(&self, path: &str, to: &Path) -> Result<u64, CliError> {
        let at = |error: std::io::Error| CliError::at(to, error);
        let folder = match to.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let mut file = tempfile::NamedTempFile::new_in(folder).map_err(at)?;
        let length = match &self.0 {
            Transport::Remote { agent, base, key } => {
                let request = authorized(ureq::http::Request::get(format!("{base}{path}")), key.as_deref())
                    .body(())
                    .map_err(unreachable)?;
                let mut response = agent.run(request).map_err(unreachable)?;
                let status = response.status().as_u16();
                if status != 200 {
                    let body = response.body_mut().with_config().limit(MAX_ANSWER_BYTES);
                    let bytes = body.read_to_vec().map_err(unreachable)?;
                    return Err(self.refusal(status, &bytes));
                }
                let mut body = BufReader::with_capacity(PIECE, response.body_mut().as_reader());
                let mut piece = vec![0_u8; PIECE];
                let mut length = 0;
                loop {
                    let read = body.read(&mut piece).map_err(unreachable)?;
                    if read == 0 {
                        break length;
                    }
                    file.write_all(&piece[..read]).map_err(at)?;
                    length += read as u64;
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
                    return Err(self.refusal(status, &bytes.map_err(unreachable)?));
                }
                let mut body = response.into_body().into_data_stream();
                let mut length = 0;
                while let Some(piece) = body.next().await {
                    let piece = piece.map_err(unreachable)?;
                    file.write_all(&piece).map_err(at)?;
                    length += piece.len() as u64;
                }
                Ok::<_, CliError>(length)
            })?,
        };
        file.as_file().sync_all().map_err(at)?;
        file.persist(to).map_err(|error| at(error.error))?;
        Ok(length)
    }

    fn refusal(&self, status: u16, bytes: &[u8]) -> CliError {
        match outcome(status, bytes) {
            Ok(_) => CliError::Failed(format!("the service answered with status {status}")),
            Err(error) => error.worded(&self.place()).into(),
        }
    }
}

pub(super) fn authorized(
    request: ureq::http::request::Builder,
    key: Option<&str>,
) -> ureq::http::request::Builder {
    match key {
        Some(key) => request.header("authorization", format!("Bearer {key}")),
        None => request,
    }
}
