//! A query as the commands send it.

use super::api::mesh_payload;
use super::client::{Client, Payload};
use super::encode::encode;
use super::files::MeshFile;
use super::outcome::CallError;
use crate::http::dto::parameters::QueryRankByName;
use serde_json::Value;
use std::fmt::Write;

/// What is asked about every mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Question {
    /// How many classes are answered at most.
    pub top: Option<usize>,
    /// What they are ordered by.
    pub rank_by: Option<QueryRankByName>,
    /// How many poses are sampled of an animated glTF.
    pub poses: Option<usize>,
    /// Which of them is meant, from 0; each where it is left out.
    pub pose: Option<usize>,
}

impl Question {
    /// The address with the parameters. Each of several poses is answered by the batch.
    fn path(&self) -> String {
        let mut path = match (self.poses, self.pose) {
            (Some(_), None) => "/v1/query/batch?".to_owned(),
            _ => "/v1/query?".to_owned(),
        };
        let numbers = [("top", self.top), ("poses", self.poses), ("pose", self.pose)];
        for (name, value) in numbers {
            if let Some(value) = value {
                // Writing to a String cannot fail.
                let _ = write!(path, "{name}={value}&");
            }
        }
        if let Some(rank_by) = self.rank_by {
            let _ = write!(path, "rank_by={}&", rank_by.name());
        }
        path
    }

    /// Ranks a file. Each answer is the API's `QueryAnswer`; there are several where each pose is asked about.
    ///
    /// # Errors
    /// [`CallError`] where the file is refused or the service does not answer.
    pub fn file(&self, client: &Client, file: MeshFile) -> Result<Vec<Result<Value, CallError>>, CallError> {
        let path = format!("{}name={}", self.path(), encode(&file.name));
        self.send(client, &path, mesh_payload(file))
    }

    /// Ranks a stored shape, named by its id or as `CLASS/ID`.
    ///
    /// # Errors
    /// As [`Question::file`].
    pub fn stored(&self, client: &Client, shape: &str) -> Result<Vec<Result<Value, CallError>>, CallError> {
        let path = format!("{}shape={}", self.path(), encode(shape));
        self.send(client, &path, Payload::Empty)
    }

    fn send(
        &self,
        client: &Client,
        path: &str,
        payload: Payload,
    ) -> Result<Vec<Result<Value, CallError>>, CallError> {
        if !path.starts_with("/v1/query/batch") {
            return Ok(vec![Ok(client.call("POST", path, payload)?)]);
        }
        let mut lines = client.lines("POST", path, payload)?;
        match lines.pop() {
            Some(last) if last.get("summary").is_some() => {}
            _ => {
                return Err(CallError::Unreachable(
                    "the answer was cut short; ask again".to_owned(),
                ));
            }
        }
        // They come in the order they are finished.
        lines.sort_by_key(|line| line["pose"]["index"].as_u64());
        Ok(lines.into_iter().map(|line| of_line(client, line)).collect())
    }
}

/// Ranks a file against the whole index. The answer is the API's `QueryAnswer`.
///
/// # Errors
/// As [`Question::file`].
pub fn query(client: &Client, file: MeshFile) -> Result<Value, CallError> {
    let path = format!("/v1/query?name={}", encode(&file.name));
    client.call("POST", &path, mesh_payload(file))
}

/// The answer in a line of a batch.
fn of_line(client: &Client, mut line: Value) -> Result<Value, CallError> {
    if line["status"] == "failed" {
        return Err(client.refusal_of(&line["problem"]));
    }
    if let Some(answer) = line.as_object_mut() {
        // The members of the batch, beside those of the answer.
        answer.remove("status");
        answer.remove("index");
    }
    Ok(line)
}
