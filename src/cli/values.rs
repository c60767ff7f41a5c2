//! Values of flags that several commands have.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use shapelex_core::mesh::Limits;

/// A whole number of 1 or more.
///
/// # Errors
/// A sentence.
pub fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err("expected a whole number, 1 or more".to_owned()),
        Ok(number) => Ok(number),
    }
}

/// Poses to be sampled from an animated file in this process.
///
/// # Errors
/// A sentence.
pub fn poses(text: &str) -> Result<usize, String> {
    let most = Limits::default().max_poses;
    match text.parse() {
        Ok(count) if (1..=most).contains(&count) => Ok(count),
        _ => Err(format!("expected a whole number between 1 and {most}")),
    }
}

/// One of several values that have a name, listed in the help.
pub fn one_of<T>(all: &'static [T], name: fn(T) -> &'static str) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let values = all.iter().map(|&value| PossibleValue::new(name(value)));
    PossibleValuesParser::new(values).try_map(move |text| {
        let found = all.iter().copied().find(|&value| name(value) == text);
        found.ok_or("this value is not known")
    })
}
