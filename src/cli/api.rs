//! The calls of the API that commands make.

use super::CliError;
use super::client::{Client, Payload};
use super::encode::encode;
use super::files::MeshFile;
use super::follow::{follow, succeeded};
use super::outcome::CallError;
use super::parameters::ParameterArgs;
use serde_json::{Map, Value, json};
use std::fmt::Write;

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

/// Starts a reindex and follows it to its end. `scope` is the API's: "stale", "all" or a list of classes. The answer is
/// the job.
///
/// # Errors
/// [`CliError::Failed`] with the job's reason where it did not succeed.
pub fn reindex(client: &Client, parameters: &ParameterArgs, scope: Value) -> Result<Value, CliError> {
    let mut request = Map::from_iter([("scope".to_owned(), scope)]);
    if let Some(preset) = parameters.preset {
        request.insert("preset".to_owned(), json!(preset));
    }
    if !parameters.set.is_empty() {
        request.insert("parameters".to_owned(), Value::Object(parameters.overrides()?));
    }
    let job = client.call("POST", "/v1/reindex", Payload::Json(Value::Object(request)))?;
    succeeded(follow(client, job)?)
}

/// A file with its buffers as multipart, a file without as it is.
pub(super) fn mesh_payload(file: MeshFile) -> Payload {
    if file.companions.is_empty() {
        return Payload::Bytes("application/octet-stream".to_owned(), file.bytes);
    }
    let mut hash = blake3::Hasher::new();
    hash.update(&file.bytes);
    // A boundary the contents would have to hash themselves to contain.
    let boundary = format!("shapelex-{}", &hash.finalize().to_hex()[..40]);
    let mut body = Vec::new();
    let parts = std::iter::once((&file.name, file.bytes.as_slice()))
        .chain(file.companions.iter().map(|c| (&c.name, c.bytes())));
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

#[cfg(test)]
mod tests {
    use super::*;
    use shapelex_core::mesh::Companion;

    #[test]
    fn buffers_travel_beside_their_file() {
        let file = MeshFile {
            name: "fox.gltf".to_owned(),
            bytes: b"{}".to_vec(),
            companions: vec![Companion::new("fox.bin", vec![1, 2])],
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
