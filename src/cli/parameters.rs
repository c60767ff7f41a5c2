//! The method's parameters on the command line: a preset, and single values over it.

use super::CliError;
use crate::config::preset_values;
use serde_json::{Map, Value};
use shapelex_core::parameters::{ParameterError, Parameters, Preset};

/// `--preset` and `--set`.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Method")]
pub struct ParameterArgs {
    /// Named setting of all parameters
    #[arg(long, value_name = "PRESET", value_parser = preset_values())]
    pub preset: Option<Preset>,
    /// One parameter over the preset, such as --set atoms=64; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl ParameterArgs {
    /// The parameters asked for.
    ///
    /// # Errors
    /// [`CliError::Usage`] for a key that does not exist, with those that do, or a value outside its range.
    pub fn parameters(&self) -> Result<Parameters, CliError> {
        let parameters: Parameters = serde_json::from_value(Value::Object(self.values()?))
            .map_err(|error| CliError::Usage(format!("--set: {error}")))?;
        parameters.validate().map_err(|error| self.blame(&error))?;
        Ok(parameters)
    }

    /// Only the single values, checked as far as they can be without the parameters they go over.
    ///
    /// # Errors
    /// As [`ParameterArgs::parameters`].
    pub fn overrides(&self) -> Result<Map<String, Value>, CliError> {
        let all = self.values()?;
        Ok(all
            .into_iter()
            .filter(|(key, _)| self.set.iter().any(|s| key_of(s) == Some(key)))
            .collect())
    }

    /// The error with the assignment it is about.
    fn blame(&self, error: &ParameterError) -> CliError {
        let about = self.set.iter().rev().find(|set| key_of(set) == Some(error.name));
        CliError::Usage(match about {
            Some(assignment) => format!("--set {assignment}: {error}"),
            None => error.to_string(),
        })
    }

    fn values(&self) -> Result<Map<String, Value>, CliError> {
        let base = Parameters::preset(self.preset.unwrap_or_default());
        let Ok(Value::Object(mut values)) = serde_json::to_value(base) else {
            return Err(CliError::Failed("the parameters do not serialise".to_owned()));
        };
        for assignment in &self.set {
            let (key, value) = assignment
                .split_once('=')
                .ok_or_else(|| CliError::Usage(format!("--set {assignment}: expected KEY=VALUE")))?;
            set(&mut values, key.trim(), value.trim())?;
        }
        Ok(values)
    }
}

fn key_of(assignment: &str) -> Option<&str> {
    assignment.split_once('=').map(|(key, _)| key.trim())
}

/// Sets one value and tries it at once, so that the error names the key it is about.
fn set(values: &mut Map<String, Value>, key: &str, text: &str) -> Result<(), CliError> {
    if key == "preset" {
        return Err(CliError::Usage(
            "--set preset=…: use --preset, which sets all values".to_owned(),
        ));
    }
    if !values.contains_key(key) {
        let known: Vec<&str> = values
            .keys()
            .map(String::as_str)
            .filter(|&k| k != "preset")
            .collect();
        return Err(CliError::Usage(format!(
            "--set {key}: there is no such parameter; there are {}",
            known.join(", ")
        )));
    }
    // A word is a word without quotes; numbers, true, false, lists and objects are JSON.
    let value = serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned()));
    let expected = expected(values, key);
    values.insert(key.to_owned(), value);
    serde_json::from_value::<Parameters>(Value::Object(values.clone())).map_err(|error| {
        let reason = expected.unwrap_or_else(|| error.to_string());
        CliError::Usage(format!("--set {key}={text}: {reason}"))
    })?;
    Ok(())
}

/// What a number may be: its kind and, where values outside a range are refused, its range. `None` for what is no
/// number, where the error lists the values there are.
fn expected(values: &Map<String, Value>, key: &str) -> Option<String> {
    let number = values.get(key).filter(|value| value.is_number())?;
    let (kind, outside) = if number.is_f64() {
        ("a number", Value::from(-1.0))
    } else {
        ("a whole number", Value::from(u32::MAX))
    };
    let mut tried = values.clone();
    tried.insert(key.to_owned(), outside);
    let range = serde_json::from_value::<Parameters>(Value::Object(tried))
        .ok()
        .and_then(|parameters| parameters.validate().err())
        .filter(|error| error.name == key);
    Some(match range {
        Some(error) if error.expected.contains("number") => format!("expected {}", error.expected),
        Some(error) => format!("expected {kind} {}", error.expected),
        None => format!("expected {kind}, 0 or more"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use shapelex_core::parameters::{Hypothesis, RankBy};

    fn given(preset: Option<Preset>, set: &[&str]) -> Result<Parameters, CliError> {
        let set = set.iter().map(|&s| s.to_owned()).collect();
        ParameterArgs { preset, set }.parameters()
    }

    #[test]
    fn values_go_over_the_preset() {
        let p = given(
            Some(Preset::Paper),
            &[
                "atoms=64",
                "rank_by=objective",
                "hypotheses=[\"plain\",\"whitened\"]",
                "lambda=0.25",
            ],
        )
        .unwrap();
        assert_eq!((p.atoms, p.energies, p.lambda), (64, 500, 0.25));
        assert_eq!(p.rank_by, RankBy::Objective);
        assert_eq!(p.hypotheses, [Hypothesis::Plain, Hypothesis::Whitened]);
        assert_eq!(given(None, &[]).unwrap(), Parameters::default());
    }

    #[test]
    fn mistakes_name_the_key_and_what_there_is() {
        let message = |set: &str| given(None, &[set]).unwrap_err().to_string();
        assert!(
            message("atom=64").contains("eigenpairs, "),
            "{}",
            message("atom=64")
        );
        assert!(message("atoms").contains("KEY=VALUE"));
        assert!(message("atoms=many").contains("--set atoms=many"));
        assert_eq!(
            message("atoms=0"),
            "--set atoms=0: atoms must be between 1 and 5000, got 0"
        );
        assert_eq!(
            message("atoms=many"),
            "--set atoms=many: expected a whole number between 1 and 5000"
        );
        assert_eq!(
            message("lambda=much"),
            "--set lambda=much: expected a finite number above 0"
        );
        assert_eq!(
            message("samples_per_shape=-3"),
            "--set samples_per_shape=-3: expected a whole number, 0 or more"
        );
        assert!(message("rank_by=best").contains("trimmed_objective"));
        assert!(message("preset=paper").contains("--preset"));
    }
}
