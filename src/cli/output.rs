//! Answers on stdout: lines and tables for people, one JSON value per line for machines. Notes on stderr.

use super::CliError;
use comfy_table::{CellAlignment, ContentArrangement, Table, TableComponent, presets};
use serde::Serialize;
use std::io::Write;

/// Writes a line to stdout.
///
/// # Errors
/// [`CliError::OutputClosed`] where nobody reads any more.
pub fn line(text: &str) -> Result<(), CliError> {
    let mut stdout = std::io::stdout().lock();
    writeln!(stdout, "{text}")?;
    stdout.flush()?;
    Ok(())
}

/// Writes to stderr. Where nothing reads it the text is lost and the command goes on; `eprintln!` would panic.
pub fn note(text: std::fmt::Arguments<'_>) {
    let _ = std::io::stderr().lock().write_fmt(text);
}

/// Writes a line to stderr as [`note`] does; arguments as for `format!`.
macro_rules! note_line {
    ($($text:tt)*) => {
        $crate::cli::output::note(format_args!("{}\n", format_args!($($text)*)))
    };
}
pub(super) use note_line;

/// Writes bytes to stdout as they are.
///
/// # Errors
/// As [`line`].
pub fn bytes(bytes: &[u8]) -> Result<(), CliError> {
    let mut stdout = std::io::stdout().lock();
    stdout.write_all(bytes)?;
    stdout.flush()?;
    Ok(())
}

/// Writes a value as one line of JSON to stdout.
///
/// # Errors
/// As [`line`].
pub fn json(value: &impl Serialize) -> Result<(), CliError> {
    let text = serde_json::to_string(value).map_err(|error| CliError::Failed(error.to_string()))?;
    line(&text)
}

/// A table with a header; columns whose header begins with `>` are aligned to the right.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_HORIZONTAL_ONLY)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header.iter().map(|h| h.trim_start_matches('>')));
    for row in rows {
        table.add_row(row);
    }
    for (i, _) in header.iter().enumerate().filter(|(_, h)| h.starts_with('>')) {
        if let Some(column) = table.column_mut(i) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for line in [
        TableComponent::TopBorder,
        TableComponent::BottomBorder,
        TableComponent::HorizontalLines,
        TableComponent::MiddleIntersections,
        TableComponent::TopBorderIntersections,
        TableComponent::BottomBorderIntersections,
    ] {
        table.remove_style(line);
    }
    let lines: Vec<String> = table.lines().map(|line| line.trim_end().to_owned()).collect();
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_align_and_keep_every_cell() {
        let text = table(
            &["class", ">score"],
            &[
                vec!["cat".into(), "0.35".into()],
                vec!["elephant".into(), "10.5".into()],
            ],
        );
        let cat = text.lines().find(|l| l.contains("cat")).unwrap();
        let elephant = text.lines().find(|l| l.contains("elephant")).unwrap();
        assert!(
            cat.ends_with("0.35") && elephant.ends_with("10.5") && cat.len() == elephant.len(),
            "{text}"
        );
        assert!(!text.contains('>'), "{text}");
        assert_eq!(text.lines().count(), 4, "a header, a line, two rows: {text}");
    }
}
