//! Arguments → [`Cli`]: which of flag and environment counts, and whose mistake a wrong value is.

use super::Cli;
use crate::config::Config;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, CommandFactory, FromArgMatches};
use serde_json::Value;
use std::error::Error;
use std::ffi::OsString;

/// Places a command can work in, of which one counts.
const PLACES: [&str; 3] = ["data", "server", "dictionaries"];

/// No environment has a variable of this name; clap cannot take an argument's variable away.
const NO_VARIABLE: &str = "";

/// Why there is no [`Cli`].
pub enum ParseError {
    /// Help, the version or a mistake, as clap says it.
    Clap(clap::Error),
    /// A wrong value of a flag or an environment variable, as one line.
    Line(String),
}

/// Parses the arguments. A place named by a flag wins over one that the environment names.
///
/// # Errors
/// [`ParseError`].
pub fn parse(args: impl IntoIterator<Item = OsString>) -> Result<Cli, ParseError> {
    let args: Vec<OsString> = args.into_iter().collect();
    let mut command = command();
    if PLACES.iter().any(|place| names(&args, place)) {
        command = without_environment(command, &args);
    }
    let told = |error: clap::Error| match of_environment(&error, &args).or_else(|| of_flag(&error)) {
        Some(line) => ParseError::Line(line),
        None => ParseError::Clap(error),
    };
    let matches = command.try_get_matches_from(&args).map_err(told)?;
    Cli::from_arg_matches(&matches).map_err(told)
}

/// The command line, with the defaults of the service's settings in the help. The settings themselves have none there,
/// so that the environment and a file are asked first.
pub fn command() -> Command {
    let defaults = serde_json::to_value(Config::default()).unwrap_or_default();
    Cli::command().mut_subcommand("serve", |serve| {
        serve.mut_args(|arg| {
            let default = match &defaults[arg.get_id().as_str()] {
                Value::String(text) if !text.is_empty() => text.clone(),
                number @ Value::Number(_) => number.to_string(),
                _ => return arg,
            };
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            arg.help(format!("{help} [default: {default}]"))
        })
    })
}

/// Whether the arguments have a flag.
fn names(args: &[OsString], long: &str) -> bool {
    let flag = format!("--{long}");
    let assigned = format!("{flag}=");
    args.iter()
        .take_while(|arg| *arg != "--")
        .filter_map(|arg| arg.to_str())
        .any(|arg| arg == flag || arg.starts_with(&assigned))
}

/// The command, whose places are taken from the arguments only.
fn without_environment(command: Command, args: &[OsString]) -> Command {
    let subcommands: Vec<String> = command
        .get_subcommands()
        .map(|c| c.get_name().to_owned())
        .collect();
    let silent: Vec<&str> = PLACES
        .into_iter()
        .filter(|place| !names(args, place))
        .filter(|place| command.get_arguments().any(|arg| arg.get_id() == place))
        .collect();
    let command = silent.into_iter().fold(command, |c, place| {
        c.mut_arg(place, |arg| arg.env(NO_VARIABLE).hide_env(true))
    });
    subcommands.into_iter().fold(command, |c, name| {
        c.mut_subcommand(name, |sub| without_environment(sub, args))
    })
}

/// The line about a wrong value that came out of the environment; `None` where it did not.
fn of_environment(error: &clap::Error, args: &[OsString]) -> Option<String> {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    let invalid = text(ContextKind::InvalidArg)?;
    let (_, variable, value) = from_environment(&invalid, args)?;
    match error.kind() {
        ErrorKind::ArgumentConflict => {
            let other = text(ContextKind::PriorArg).unwrap_or_default();
            let other = from_environment(&other, args).map_or(other, |(_, variable, _)| variable);
            Some(format!(
                "{variable} cannot be used with {other}; unset one of them"
            ))
        }
        ErrorKind::InvalidValue => {
            let expected = match error.get(ContextKind::ValidValue) {
                Some(ContextValue::Strings(names)) => format!("expected one of {}", names.join(", ")),
                _ => "this value is not known".to_owned(),
            };
            Some(format!("{variable}='{value}': {expected}"))
        }
        _ => Some(format!("{variable}='{value}': {}", reason(error))),
    }
}

/// The line about a value that a flag cannot have; `None` where it is another mistake.
fn of_flag(error: &clap::Error) -> Option<String> {
    if error.kind() != ErrorKind::ValueValidation {
        return None;
    }
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    let flag = text(ContextKind::InvalidArg)?.split([' ', '=', '[']).next()?;
    let value = text(ContextKind::InvalidValue)?;
    Some(format!("{flag} '{value}': {}", reason(error)))
}

/// What was expected of a value, in words for people.
fn reason(error: &clap::Error) -> String {
    let said = error.source().map(ToString::to_string).unwrap_or_default();
    match said.as_str() {
        "" => "this value is wrong".to_owned(),
        "invalid digit found in string" | "cannot parse integer from empty string" => {
            "expected a whole number, 0 or more".to_owned()
        }
        "number too large to fit in target type" => "the number is too large".to_owned(),
        "invalid socket address syntax" => {
            "expected an IP address and a port, such as 127.0.0.1:7345".to_owned()
        }
        "invalid float literal" => "expected a number".to_owned(),
        _ => said,
    }
}

/// The flag as the arguments would spell it, its variable and the variable's value, where the value came from there.
/// `shown` is how clap spells an argument, such as `--listen <ADDRESS>`.
fn from_environment(shown: &str, args: &[OsString]) -> Option<(String, String, String)> {
    let long = shown.strip_prefix("--")?.split([' ', '=', '[']).next()?;
    if names(args, long) {
        return None;
    }
    let mut command = Cli::command();
    command.build();
    let variable = variable_of(&command, long)?;
    let value = std::env::var_os(&variable)?;
    Some((
        format!("--{long}"),
        variable,
        value.to_string_lossy().into_owned(),
    ))
}

/// The environment variable of the first argument of that name, in any subcommand.
fn variable_of(command: &Command, long: &str) -> Option<String> {
    let of = |arg: &Arg| arg.get_env().map(|name| name.to_string_lossy().into_owned());
    command
        .get_arguments()
        .find(|arg| arg.get_long() == Some(long))
        .and_then(of)
        .or_else(|| command.get_subcommands().find_map(|sub| variable_of(sub, long)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(list: &[&str]) -> Vec<OsString> {
        list.iter().map(OsString::from).collect()
    }

    #[test]
    fn flags_are_found_in_both_spellings_and_not_after_the_dashes() {
        assert!(names(&args(&["shapelex", "query", "--data", "d"]), "data"));
        assert!(names(&args(&["shapelex", "query", "--data=d"]), "data"));
        assert!(!names(&args(&["shapelex", "query", "--database"]), "data"));
        assert!(!names(&args(&["shapelex", "query", "--", "--data"]), "data"));
    }

    #[test]
    fn a_wrong_value_is_told_in_words() {
        let told = |list: &[&str]| match parse(args(list)) {
            Err(ParseError::Line(line)) => line,
            Err(ParseError::Clap(error)) => error.to_string(),
            Ok(_) => String::new(),
        };
        assert_eq!(
            told(&["shapelex", "serve", "--listen", "here"]),
            "--listen 'here': expected an IP address and a port, such as 127.0.0.1:7345"
        );
        for wrong in ["x", "-1", "1.5", ""] {
            assert_eq!(
                told(&["shapelex", "serve", &format!("--max-vertices={wrong}")]),
                format!("--max-vertices '{wrong}': expected a whole number, 0 or more")
            );
        }
    }

    #[test]
    fn the_help_has_the_defaults_of_settings() {
        let mut command = command();
        let help = command
            .find_subcommand_mut("serve")
            .unwrap()
            .render_help()
            .to_string();
        for default in [
            "[default: 127.0.0.1:7345]",
            "[default: shapelex-data]",
            "[default: 64]",
        ] {
            assert!(help.contains(default), "{default}: {help}");
        }
    }

    #[test]
    fn a_place_of_the_arguments_silences_the_others_of_the_environment() {
        let of = |list: &[&str]| {
            let mut command = without_environment(Cli::command(), &args(list));
            command.build();
            let query = command.find_subcommand("query").unwrap().clone();
            let has = |id: &str| {
                let arg = query.get_arguments().find(|a| a.get_id() == id).unwrap();
                arg.get_env().is_some_and(|name| !name.is_empty())
            };
            (has("data"), has("server"))
        };
        assert_eq!(of(&["shapelex", "query", "--data", "d"]), (true, false));
        assert_eq!(of(&["shapelex", "query", "--server", "u"]), (false, true));
        assert_eq!(of(&["shapelex", "query", "--dictionaries", "f"]), (false, false));
    }
}
