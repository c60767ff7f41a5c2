//! Why a command ended early, and what it tells the shell.

use super::wording;
use shapelex_core::mesh::MeshError;
use shapelex_core::parameters::ParameterError;
use shapelex_core::pipeline::PipelineError;
use std::path::Path;
use std::process::ExitCode;

/// Exit status: everything asked for was done.
pub const OK: u8 = 0;
/// Exit status: something failed, or some of the inputs did.
pub const FAILED: u8 = 1;
/// Exit status: the command line or the configuration is wrong; nothing was done.
pub const USAGE: u8 = 2;

/// Why a command ended early. Printed as one line on stderr, after `shapelex: `.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The command line or the configuration asks for something impossible.
    #[error("{0}")]
    Usage(String),
    /// The work failed.
    #[error("{0}")]
    Failed(String),
    /// The service refused, and said why.
    #[error("{detail}")]
    Refused {
        /// The problem's stable code.
        code: String,
        /// One sentence.
        detail: String,
    },
    /// What failed has been printed already.
    #[error("not everything succeeded")]
    Reported,
    /// Whoever read our output stopped reading, as `head` does.
    #[error("the reader of the output went away")]
    OutputClosed,
}

impl CliError {
    /// A failure about a file or folder: `path: reason`.
    pub fn at(path: &Path, reason: impl std::fmt::Display) -> Self {
        Self::Failed(format!("{}: {reason}", path.display()))
    }

    /// The problem's stable code, where a service refused.
    pub fn code(&self) -> Option<&str> {
        match self {
            Self::Refused { code, .. } => Some(code),
            _ => None,
        }
    }

    /// What the shell is told.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Usage(_) => USAGE,
            Self::Failed(_) | Self::Refused { .. } | Self::Reported => FAILED,
            Self::OutputClosed => OK,
        })
    }

    /// The line for stderr, unless there is nothing to add.
    pub fn message(&self) -> Option<String> {
        match self {
            Self::Usage(_) | Self::Failed(_) | Self::Refused { .. } => Some(format!("shapelex: {self}")),
            Self::Reported | Self::OutputClosed => None,
        }
    }
}

impl From<PipelineError> for CliError {
    fn from(error: PipelineError) -> Self {
        Self::Failed(match &error {
            PipelineError::Mesh(mesh) => wording::mesh_error(mesh),
            other => other.to_string(),
        })
    }
}

impl From<MeshError> for CliError {
    fn from(error: MeshError) -> Self {
        Self::Failed(wording::mesh_error(&error))
    }
}

impl From<ParameterError> for CliError {
    fn from(error: ParameterError) -> Self {
        Self::Usage(error.to_string())
    }
}

impl From<std::io::Error> for CliError {
    fn from(error: std::io::Error) -> Self {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            Self::OutputClosed
        } else {
            Self::Failed(error.to_string())
        }
    }
}
