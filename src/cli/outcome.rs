//! What a service answered, as JSON or as the reason why there is none.

use super::CliError;
use super::wording::{self, Place};
use serde_json::Value;

/// Why a call gave no answer.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// The service refused, and said why.
    #[error("{detail}")]
    Refused {
        /// The stable code of the problem.
        code: String,
        /// One sentence.
        detail: String,
    },
    /// No service answered.
    #[error("{0}")]
    Unreachable(String),
}

impl CallError {
    /// The same, the service's words translated.
    #[must_use]
    pub(super) fn worded(self, place: &Place) -> Self {
        match self {
            Self::Refused { code, detail } => Self::Refused {
                detail: wording::detail(place, &code, &detail),
                code,
            },
            other => other,
        }
    }
}

impl From<CallError> for CliError {
    fn from(error: CallError) -> Self {
        match error {
            CallError::Refused { code, detail } => Self::Refused { code, detail },
            CallError::Unreachable(reason) => Self::Failed(reason),
        }
    }
}

/// An answer's JSON, or why there is none.
pub(super) fn outcome(status: u16, bytes: &[u8]) -> Result<Value, CallError> {
    let value = serde_json::from_slice(bytes).unwrap_or(Value::Null);
    if (200..300).contains(&status) {
        return Ok(value);
    }
    Err(refusal(&value, &status.to_string()))
}

/// What a problem document says.
pub(super) fn refusal(problem: &Value, status: &str) -> CallError {
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
