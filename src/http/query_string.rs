//! Query parameters: what is wrong with them, in the words of the API's description.
//!
//! A query string that does not fit its type is compared with the parameters that the type describes for
//! `openapi.yaml`, so that the problem names the parameter, its value and what it may be.

use super::problem::{Code, Problem};
use axum::extract::Query;
use axum::http::Uri;
use serde::de::DeserializeOwned;
use serde_json::Value;
use utoipa::IntoParams;
use utoipa::openapi::path::ParameterIn;

/// Longest value that a message repeats, in characters.
const MAX_SHOWN: usize = 100;

/// Reads the query string of an address.
///
/// # Errors
/// `invalid_query`, with the parameter's `name`.
pub(super) fn parse<T: DeserializeOwned + IntoParams>(uri: &Uri) -> Result<T, Problem> {
    if let Ok(Query(value)) = Query::<T>::try_from_uri(uri) {
        return Ok(value);
    }
    let Ok(Query(pairs)) = Query::<Vec<(String, String)>>::try_from_uri(uri) else {
        return Err(Problem::new(
            Code::InvalidQuery,
            "the query string is not of the form name=value&name=value",
        ));
    };
    let known = parameters::<T>();
    for (i, (name, value)) in pairs.iter().enumerate() {
        let Some((_, schema)) = known.iter().find(|(known, _)| known == name) else {
            return Err(unknown(name, &known));
        };
        if pairs[..i].iter().any(|(earlier, _)| earlier == name) {
            return Err(
                Problem::new(Code::InvalidQuery, format!("{name} is given more than once"))
                    .with("name", name.clone()),
            );
        }
        let expected = Expected::of(schema);
        if !expected.accepts(value) {
            return Err(wrong_value(name, value, &expected));
        }
    }
    Err(Problem::new(
        Code::InvalidQuery,
        "the query parameters do not fit together",
    ))
}

/// Name and schema of each parameter of a type.
fn parameters<T: IntoParams>() -> Vec<(String, Value)> {
    let described = T::into_params(|| Some(ParameterIn::Query));
    described
        .into_iter()
        .map(|parameter| {
            let schema = serde_json::to_value(&parameter.schema).unwrap_or_default();
            (parameter.name, schema)
        })
        .collect()
}

fn unknown(name: &str, known: &[(String, Value)]) -> Problem {
    let names: Vec<&str> = known.iter().map(|(name, _)| name.as_str()).collect();
    let shown = shortened(name);
    Problem::new(
        Code::InvalidQuery,
        format!(
            "there is no query parameter '{shown}' here; there are {}",
            names.join(", ")
        ),
    )
    .with("name", shown)
}

fn wrong_value(name: &str, value: &str, expected: &Expected) -> Problem {
    let expected = expected.to_string();
    Problem::new(
        Code::InvalidQuery,
        format!("{name} must be {expected}, got '{}'", shortened(value)),
    )
    .with("name", name.to_owned())
    .with("expected", expected)
}

fn shortened(text: &str) -> String {
    text.chars().take(MAX_SHOWN).collect()
}

/// What a parameter may be.
#[derive(Debug, PartialEq)]
enum Expected {
    Integer { least: Option<u64>, most: Option<u64> },
    Boolean,
    OneOf(Vec<String>),
    Text,
}

impl Expected {
    /// Reads a schema; an optional parameter's is one of `null` and its own.
    fn of(schema: &Value) -> Self {
        let variants = ["oneOf", "anyOf"].iter().find_map(|key| schema[*key].as_array());
        if let Some(variants) = variants {
            let own = variants.iter().find(|variant| variant["type"] != "null");
            return own.map_or(Self::Text, Self::of);
        }
        if let Some(values) = schema["enum"].as_array() {
            let values = values.iter().filter_map(Value::as_str);
            return Self::OneOf(values.map(str::to_owned).collect());
        }
        let is = |kind: &str| match &schema["type"] {
            Value::String(found) => found == kind,
            Value::Array(found) => found.iter().any(|one| one == kind),
            _ => false,
        };
        if is("integer") {
            let bound = |key: &str| {
                schema[key]
                    .as_f64()
                    .filter(|bound| *bound >= 0.0)
                    .map(|bound| bound as u64)
            };
            Self::Integer {
                least: bound("minimum"),
                most: bound("maximum"),
            }
        } else if is("boolean") {
            Self::Boolean
        } else {
            Self::Text
        }
    }

    fn accepts(&self, value: &str) -> bool {
        match self {
            Self::Integer { least, most } => value
                .parse()
                .is_ok_and(|found: u64| least.is_none_or(|l| found >= l) && most.is_none_or(|m| found <= m)),
            Self::Boolean => matches!(value, "true" | "false"),
            Self::OneOf(values) => values.iter().any(|one| one == value),
            Self::Text => true,
        }
    }
}

impl std::fmt::Display for Expected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Integer {
                least: Some(least),
                most: Some(most),
            } => write!(f, "a whole number from {least} to {most}"),
            Self::Integer { least, .. } => write!(f, "a whole number, {} or more", least.unwrap_or(0)),
            Self::Boolean => f.write_str("true or false"),
            Self::OneOf(values) if values.len() == 1 => f.write_str(&values[0]),
            Self::OneOf(values) => write!(f, "one of {}", values.join(", ")),
            Self::Text => f.write_str("text"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::dto::PageQuery;
    use crate::http::dto::query::QueryOptions;

    fn refused<T: DeserializeOwned + IntoParams>(query: &str) -> String {
        let uri: Uri = format!("/v1/x?{query}").parse().unwrap();
        let problem = parse::<T>(&uri).map(drop).unwrap_err();
        assert_eq!(problem.code, Code::InvalidQuery);
        problem.detail
    }

    #[test]
    fn a_problem_names_the_parameter_its_value_and_what_it_may_be() {
        assert_eq!(
            refused::<PageQuery>("limit=ten"),
            "limit must be a whole number from 1 to 1000, got 'ten'"
        );
        assert_eq!(
            refused::<PageQuery>("limit=-1&cursor=x"),
            "limit must be a whole number from 1 to 1000, got '-1'"
        );
        assert_eq!(
            refused::<PageQuery>("page=2"),
            "there is no query parameter 'page' here; there are limit, cursor"
        );
        assert_eq!(
            refused::<PageQuery>("limit=1&limit=2"),
            "limit is given more than once"
        );
        assert_eq!(
            refused::<QueryOptions>("top=1.5"),
            "top must be a whole number, 1 or more, got '1.5'"
        );
        let detail = refused::<QueryOptions>("rank_by=best");
        assert!(
            detail.starts_with("rank_by must be one of objective, "),
            "{detail}"
        );
        assert!(detail.ends_with("got 'best'"), "{detail}");
    }

    #[test]
    fn no_problem_speaks_of_deserialising() {
        for query in [
            "limit=",
            "limit=%ff",
            "limit=99999999999999999999",
            "=",
            "&&a",
            "cursor=a&cursor=b",
        ] {
            let detail = refused::<PageQuery>(query);
            assert!(!detail.contains("eserialize"), "{query}: {detail}");
        }
    }
}
