//! The calls of the API that commands make.

use super::CliError;
use super::client::{CallError, Client, Payload};
use super::files::MeshFile;
use super::parameters::ParameterArgs;
use super::progress::Progress;
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::time::Duration;

/// Time between two looks at a running job.
const POLL_EVERY: Duration = Duration::from_millis(200);

/// What an upload led to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uploaded {
    /// Shapes that are new in the class.
    pub added: usize,
    /// Shapes the class had already.
    pub existing: usize,
}

/// Adds a file to a class, which is made where it does not exist yet.
///
/// # Errors
/// [`CallError`] where the file is refused or nobody answers.
pub fn upload(
    client: &Client,
    class: &str,
    file: MeshFile,
    poses: Option<usize>,
) -> Result<Uploaded, CallError> {
    let mut path = format!(
        "/v1/classes/{}/shapes?create=true&name={}",
        encode(class),
        encode(&file.name)
    );
    if let Some(poses) = poses {
        // Writing to a String cannot fail.
        let _ = write!(path, "&poses={poses}");
    }
    let answer = client.call("POST", &path, mesh_payload(file))?;
    let shapes = answer["shapes"].as_array().cloned().unwrap_or_default();
    let existing = shapes.iter().filter(|s| s["existing"] == true).count();
    Ok(Uploaded {
        added: shapes.len() - existing,
        existing,
    })
}

/// Ranks a file against the index. The answer is the API's `QueryAnswer`.
///
/// # Errors
/// As [`upload`].
pub fn query(
    client: &Client,
    file: MeshFile,
    top: Option<usize>,
    rank_by: Option<&str>,
) -> Result<Value, CallError> {
    let mut path = format!("/v1/query?name={}", encode(&file.name));
    if let Some(top) = top {
        path += &format!("&top={top}");
    }
    if let Some(rank_by) = rank_by {
        path += &format!("&rank_by={}", encode(rank_by));
    }
    client.call("POST", &path, mesh_payload(file))
}

/// Starts a reindex of what is stale and follows it to its end. The answer is the job.
///
/// # Errors
/// [`CliError::Failed`] with the job's reason where it did not succeed.
pub fn reindex(client: &Client, parameters: &ParameterArgs) -> Result<Value, CliError> {
    let mut request = Map::new();
    if let Some(preset) = parameters.preset {
        request.insert("preset".to_owned(), json!(preset));
    }
    if !parameters.set.is_empty() {
        request.insert("parameters".to_owned(), Value::Object(parameters.overrides()?));
    }
    let job = client.call("POST", "/v1/reindex", Payload::Json(Value::Object(request)))?;
    follow(client, job)
}

fn follow(client: &Client, mut job: Value) -> Result<Value, CliError> {
    let id = job["id"]
        .as_str()
        .ok_or_else(|| CliError::Failed("the service's answer names no job".to_owned()))?
        .to_owned();
    let mut shown: Option<(String, Progress)> = None;
    loop {
        for step in job["steps"].as_array().into_iter().flatten() {
            let name = step["name"].as_str().unwrap_or("reindex");
            let number = |key: &str| step[key].as_u64().unwrap_or(0) as usize;
            let is_last = job["steps"].as_array().and_then(|s| s.last()) == Some(step);
            match &shown {
                Some((current, progress)) if current == name => {
                    progress.set(number("finished"), number("total"))
                }
                _ if is_last => {
                    if let Some((_, ended)) = shown.take() {
                        ended.finish();
                    }
                    let progress = Progress::new(name, number("total"));
                    progress.set(number("finished"), number("total"));
                    shown = Some((name.to_owned(), progress));
                }
                _ => {}
            }
        }
        match job["state"].as_str() {
            Some("succeeded") => break,
            Some("failed") => {
                let detail = job["failure"]["detail"].as_str().unwrap_or("no reason given");
                return Err(CliError::Failed(format!("the reindex failed: {detail}")));
            }
            Some("cancelled" | "canceled") => {
                return Err(CliError::Failed("the reindex was cancelled".to_owned()));
            }
            _ => {}
        }
        std::thread::sleep(POLL_EVERY);
        job = client.call("GET", &format!("/v1/jobs/{id}"), Payload::Empty)?;
    }
    if let Some((_, progress)) = shown {
        progress.finish();
    }
    Ok(job)
}

/// A file with its buffers as multipart, a file without as it is.
fn mesh_payload(file: MeshFile) -> Payload {
    if file.companions.is_empty() {
        return Payload::Bytes("application/octet-stream".to_owned(), file.bytes);
    }
    let mut hash = blake3::Hasher::new();
    hash.update(&file.bytes);
    // A boundary the contents would have to hash themselves to contain.
    let boundary = format!("shapelex-{}", &hash.finalize().to_hex()[..40]);
    let mut body = Vec::new();
    let parts =
        std::iter::once((&file.name, &file.bytes)).chain(file.companions.iter().map(|c| (&c.name, &c.bytes)));
    for (name, bytes) in parts {
        let name = name.replace(['"', '\r', '\n'], "_");
        body.extend_from_slice(
            format!(
                "--{boundary}\r\ncontent-disposition: form-data; name=\"file\"; filename=\"{name}\"\r\n\
                 content-type: application/octet-stream\r\n\r\n"
            )
            .as_bytes(),
        );
        body.extend_from_slice(bytes);
        body.extend_from_slice(b"\r\n");
    }
    body.extend_from_slice(format!("--{boundary}--\r\n").as_bytes());
    Payload::Bytes(format!("multipart/form-data; boundary={boundary}"), body)
}

/// Percent-encodes everything but RFC 3986's unreserved characters.
pub fn encode(text: &str) -> String {
    text.bytes().fold(String::new(), |mut encoded, byte| {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            encoded.push(char::from(byte));
        } else {
            // Writing to a String cannot fail.
            let _ = write!(encoded, "%{byte:02X}");
        }
        encoded
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Companion;

    #[test]
    fn names_are_encoded_for_a_path() {
        assert_eq!(encode("great dane/ä?.obj"), "great%20dane%2F%C3%A4%3F.obj");
    }

    #[test]
    fn buffers_travel_beside_their_file() {
        let file = MeshFile {
            name: "fox.gltf".to_owned(),
            bytes: b"{}".to_vec(),
            companions: vec![Companion {
                name: "fox.bin".to_owned(),
                bytes: vec![1, 2],
            }],
        };
        let Payload::Bytes(content_type, body) = mesh_payload(file) else {
            panic!("expected bytes")
        };
        let boundary = content_type
            .strip_prefix("multipart/form-data; boundary=")
            .unwrap();
        let body = String::from_utf8(body).unwrap();
        assert_eq!(body.matches(&format!("--{boundary}\r\n")).count(), 2);
        assert!(body.ends_with(&format!("--{boundary}--\r\n")));
        assert!(body.contains("filename=\"fox.bin\""));
    }
}
