//! `shapelex openapi`: the API's document.

use super::{CliError, output};
use crate::http::openapi::{document_json, document_yaml};

/// Prints the OpenAPI document, as YAML or with `--json` as JSON.
///
/// # Errors
/// [`CliError::Failed`] where it cannot be written.
pub fn run(json: bool) -> Result<(), CliError> {
    let document = if json {
        document_json().map_err(|error| CliError::Failed(error.to_string()))?
    } else {
        document_yaml().map_err(|error| CliError::Failed(error.to_string()))?
    };
    output::line(document.trim_end())
}
