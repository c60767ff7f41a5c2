//! Figures as files.

use super::CliError;
use shapelex_eval::figure::{FigureError, Sheet};
use std::path::Path;

impl From<FigureError> for CliError {
    fn from(error: FigureError) -> Self {
        Self::Failed(format!("a figure: {error}"))
    }
}

/// Writes one SVG document.
///
/// # Errors
/// [`CliError::Failed`] with the path.
pub fn write_one(path: &Path, svg: &str) -> Result<(), CliError> {
    std::fs::write(path, svg).map_err(|error| CliError::at(path, error))
}

/// Writes sheets into a folder, which is made where it is missing.
///
/// # Errors
/// [`CliError::Failed`] with the path.
pub fn write(dir: &Path, sheets: &[Sheet]) -> Result<(), CliError> {
    std::fs::create_dir_all(dir).map_err(|error| CliError::at(dir, error))?;
    sheets
        .iter()
        .try_for_each(|sheet| write_one(&dir.join(&sheet.name), &sheet.svg))
}
