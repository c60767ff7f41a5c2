//! What a service answered, as JSON or as the reason why there is none.

use super::client::{CallError, Client, Payload};
use serde_json::Value;

/// An answer's JSON, or why there is none.
pub(super) fn outcome(status: u16, bytes: &[u8]) -> Result<Value, CallError> {
    let value = serde_json::from_slice(bytes).unwrap_or(Value::Null);
    if (200..300).contains(&status) {
        return Ok(value);
    }
    Err(refusal(&value, &status.to_string()))
}

/// What a problem document says.
fn refusal(problem: &Value, status: &str) -> CallError {
    let text = |name: &str| problem.get(name).and_then(Value::as_str).map(str::to_owned);
    CallError::Refused {
        code: text("code").unwrap_or_else(|| status.to_owned()),
        detail: text("detail").unwrap_or_else(|| format!("the service answered with status {status}")),
    }
}

/// The error of a service that does not answer.
pub(super) fn unreachable(base: &str, error: &ureq::Error) -> CallError {
    let text = match error {
        ureq::Error::Io(io) if io.kind() == std::io::ErrorKind::ConnectionRefused => format!(
            "no service answers at {base} (connection refused); `shapelex serve` starts one, --server URL names another"
        ),
        ureq::Error::Io(io) => format!("{base}: {io}"),
        other => format!("{base}: {other}"),
    };
    let hint = if text.contains("CaUsedAsEndEntity") {
        "; that is the certificate of an authority, make one for the service with basicConstraints=CA:FALSE"
    } else if text.contains("invalid peer certificate") {
        "; --ca-cert FILE says which certificate to trust"
    } else if text.contains("invalid HTTP version") && base.starts_with("http:") {
        "; the service may speak TLS, try https:// instead of http://"
    } else {
        ""
    };
    CallError::Unreachable(format!("{text}{hint}"))
}

impl Client {
    /// Sends a request whose answer is lines of JSON.
    ///
    /// # Errors
    /// As [`Client::call`]; [`CallError::Unreachable`] where a line is no JSON.
    pub(super) fn lines(&self, method: &str, path: &str, payload: Payload) -> Result<Vec<Value>, CallError> {
        let (content_type, body) = payload.parts();
        let (status, bytes) = self.send(method, path, content_type, body)?;
        if !(200..300).contains(&status) {
            let refused = outcome(status, &bytes).map(|_| Vec::new());
            return refused.map_err(|error| error.worded(&self.place()));
        }
        bytes
            .split(|byte| *byte == b'\n')
            .filter(|line| !line.is_empty())
            .map(|line| {
                let cut = |_| CallError::Unreachable("the answer was cut short; ask again".to_owned());
                serde_json::from_slice(line).map_err(cut)
            })
            .collect()
    }

    /// The refusal that a problem document within an answer stands for.
    pub(super) fn refusal_of(&self, problem: &Value) -> CallError {
        refusal(problem, "unknown").worded(&self.place())
    }
}
