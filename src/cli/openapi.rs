//! `shapelex openapi`: the API's document.

use super::{CliError, output};
use crate::http::openapi::document;
use crate::http::routes::routes;

/// Prints the OpenAPI document, as YAML or with `--json` as JSON.
///
/// # Errors
/// [`CliError::Failed`] where it cannot be written.
pub fn run(json: bool) -> Result<(), CliError> {
    let document = if json {
        document(routes())
            .to_pretty_json()
            .map_err(|error| CliError::Failed(error.to_string()))?
    } else {
        document(routes())
            .to_yaml()
            .map_err(|error| CliError::Failed(error.to_string()))?
    };
    output::line(document.trim_end())
}
