//! Lists of a service, page by page, and single objects as lines.

use super::client::{Client, Payload};
use super::encode::encode;
use super::outcome::CallError;
use super::{CliError, output};
use serde_json::Value;

/// Everything in a list, in the service's order.
///
/// # Errors
/// As [`Client::call`].
pub fn all(client: &Client, path: &str) -> Result<Vec<Value>, CallError> {
    let mut items = Vec::new();
    let mut cursor = String::new();
    loop {
        let mut page = client.call("GET", &format!("{path}?limit=1000{cursor}"), Payload::Empty)?;
        if let Some(found) = page["items"].as_array_mut() {
            items.append(found);
        }
        match page["next_cursor"].as_str() {
            Some(next) => cursor = format!("&cursor={}", encode(next)),
            None => return Ok(items),
        }
    }
}

/// A column of a table: its header and the member it shows, a member of a member after a dot.
pub type Column = (&'static str, &'static str);

/// Prints a list: a JSON value per line, a table, or `nothing` where it is empty.
///
/// # Errors
/// As [`output::line`].
pub fn print(items: &[Value], columns: &[Column], nothing: &str, as_json: bool) -> Result<(), CliError> {
    if as_json {
        return items.iter().try_for_each(output::json);
    }
    if items.is_empty() {
        return output::line(nothing);
    }
    let header: Vec<&str> = columns.iter().map(|(header, _)| *header).collect();
    let rows: Vec<Vec<String>> = items
        .iter()
        .map(|item| columns.iter().map(|(_, member)| cell(item, member)).collect())
        .collect();
    output::line(&output::table(&header, &rows))
}

/// Prints one object: as JSON, or a line per member.
///
/// # Errors
/// As [`output::line`].
pub fn print_one(item: &Value, columns: &[Column], as_json: bool) -> Result<(), CliError> {
    if as_json {
        return output::json(item);
    }
    let widest = columns.iter().map(|(header, _)| header.len()).max().unwrap_or(0);
    let lines: Vec<String> = columns
        .iter()
        .map(|(header, member)| {
            let header = header.trim_start_matches('>');
            format!("{header:<widest$}  {}", cell(item, member))
                .trim_end()
                .to_owned()
        })
        .collect();
    output::line(&lines.join("\n"))
}

/// Prints an answer: as JSON, or as a line.
///
/// # Errors
/// As [`output::line`].
pub fn tell(as_json: bool, value: &Value, line: impl FnOnce() -> String) -> Result<(), CliError> {
    if as_json {
        output::json(value)
    } else {
        output::line(&line())
    }
}

/// A moment without the fraction of its second.
fn to_the_second(text: &str) -> String {
    match text.split_once('.') {
        Some((seconds, fraction)) => {
            let zone = fraction.trim_start_matches(|c: char| c.is_ascii_digit());
            format!("{seconds}{zone}")
        }
        None => text.to_owned(),
    }
}

/// A member as text.
pub fn cell(item: &Value, member: &str) -> String {
    let value = member.split('.').fold(item, |value, part| &value[part]);
    match value {
        Value::Null => String::new(),
        Value::String(text) if member.ends_with("_at") => to_the_second(text),
        Value::String(text) => text.replace('_', if member.ends_with("state") { " " } else { "_" }),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_shown_to_the_second() {
        for (moment, shown) in [
            ("2026-11-29T04:53:43.585819186Z", "2026-11-29T04:53:43Z"),
            ("2026-11-29T04:53:43.5+01:00", "2026-11-29T04:53:43+01:00"),
            ("2026-11-29T04:53:43Z", "2026-11-29T04:53:43Z"),
        ] {
            assert_eq!(cell(&serde_json::json!({ "made_at": moment }), "made_at"), shown);
        }
    }
}
