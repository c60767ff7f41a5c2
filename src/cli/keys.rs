//! `shapelex keys`: who may use a service.

use super::client::{Client, OperatorArgs, Payload};
use super::encode::encode;
use super::output::note_line;
use super::{CliError, listing, output};
use crate::model::KeyName;
use jiff::{SignedDuration, Timestamp};
use serde_json::{Map, Value, json};

/// Arguments of `keys`.
#[derive(Debug, clap::Args)]
pub struct KeysArgs {
    /// What to do.
    #[command(subcommand)]
    pub command: KeysCommand,
}

/// The subcommands of `keys`.
#[derive(Debug, clap::Subcommand)]
pub enum KeysCommand {
    /// Make a key and print its secret, once
    Create(CreateArgs),
    /// List the keys, without their secrets
    List(OperatorArgs),
    /// Make a key useless, at once and for good
    Revoke(RevokeArgs),
}

/// Arguments of `keys create`.
#[derive(Debug, clap::Args)]
pub struct CreateArgs {
    /// What the key is called: letters, digits, '.', '_' and '-'
    #[arg(value_name = "NAME")]
    pub name: String,
    /// What it allows: read (query, list), write (also classes, shapes, reindex), admin (also keys, snapshots)
    #[arg(long, value_name = "SCOPE", value_parser = ["read", "write", "admin"])]
    pub scope: String,
    /// When it stops working: a duration such as 90d or 12h, or a time such as 2027-01-31T12:00:00Z [default: never]
    #[arg(long, value_name = "WHEN")]
    pub expires: Option<String>,
    /// Meshes it may query per minute [default: the service's setting]
    #[arg(long, value_name = "COUNT")]
    pub queries_per_minute: Option<u32>,
    /// Size of the shapes it may have uploaded at a time, in MiB [default: the service's setting]
    #[arg(long, value_name = "MIB")]
    pub max_stored_mib: Option<u64>,
    /// Classes it may have made at a time [default: the service's setting]
    #[arg(long, value_name = "COUNT")]
    pub max_classes: Option<u64>,
    /// Where the keys are kept.
    #[command(flatten)]
    pub target: OperatorArgs,
}

/// Arguments of `keys revoke`.
#[derive(Debug, clap::Args)]
pub struct RevokeArgs {
    /// The key's name or id
    #[arg(value_name = "NAME")]
    pub key: String,
    /// Where the keys are kept.
    #[command(flatten)]
    pub target: OperatorArgs,
}

/// Runs the subcommand, on a data directory or a running service.
///
/// # Errors
/// [`CliError::Usage`] for a time that is none; [`CliError::Failed`] where the service refuses.
pub fn run(args: &KeysArgs, json: bool) -> Result<(), CliError> {
    match &args.command {
        KeysCommand::Create(args) => create(args, json),
        KeysCommand::List(target) => list(&target.client()?, json),
        KeysCommand::Revoke(args) => revoke(args, json),
    }
}

fn create(args: &CreateArgs, json: bool) -> Result<(), CliError> {
    let mut body = Map::new();
    body.insert("name".to_owned(), json!(args.name));
    body.insert("scope".to_owned(), json!(args.scope));
    let optional = [
        (
            "expires_at",
            args.expires
                .as_deref()
                .map(|text| end(text, Timestamp::now()))
                .transpose()?
                .map(Value::from),
        ),
        ("queries_per_minute", args.queries_per_minute.map(Value::from)),
        (
            "max_stored_bytes",
            args.max_stored_mib.map(|mib| mib.saturating_mul(1 << 20).into()),
        ),
        ("max_classes", args.max_classes.map(Value::from)),
    ];
    for (name, value) in optional {
        if let Some(value) = value {
            body.insert(name.to_owned(), value);
        }
    }
    KeyName::new(&args.name).map_err(|error| CliError::Usage(format!("{}: {error}", args.name)))?;
    let made = args
        .target
        .client_or_new()?
        .call("POST", "/v1/keys", Payload::Json(Value::Object(body)))?;
    if json {
        return output::json(&made);
    }
    note_line!("shapelex: this is the only time the key is shown");
    output::line(made["secret"].as_str().unwrap_or_default())
}

fn list(client: &Client, json: bool) -> Result<(), CliError> {
    let keys = listing::all(client, "/v1/keys")?;
    if json {
        return keys.iter().try_for_each(output::json);
    }
    if keys.is_empty() {
        return output::line("there are no API keys");
    }
    let rows: Vec<Vec<String>> = keys.iter().map(row).collect();
    output::line(&output::table(&["name", "scope", "made", "expires", "id"], &rows))
}

fn row(key: &Value) -> Vec<String> {
    let text = |name: &str| key[name].as_str().unwrap_or_default().to_owned();
    let expires = match (key["expires_at"].as_str(), key["expired"] == true) {
        (None, _) => "never".to_owned(),
        (Some(end), false) => end.to_owned(),
        (Some(end), true) => format!("{end} (expired)"),
    };
    vec![
        text("name"),
        text("scope"),
        text("created_at"),
        expires,
        text("id"),
    ]
}

fn revoke(args: &RevokeArgs, json: bool) -> Result<(), CliError> {
    let path = format!("/v1/keys/{}", encode(&args.key));
    args.target.client()?.call("DELETE", &path, Payload::Empty)?;
    if json {
        output::json(&json!({ "revoked": args.key }))
    } else {
        output::line(&format!("revoked {}", args.key))
    }
}

/// A time, also as a number of days, hours or minutes from now.
fn end(text: &str, now: Timestamp) -> Result<String, CliError> {
    let wrong = || {
        CliError::Usage(format!(
            "--expires {text}: expected a duration such as 90d, 12h or 30m, or a time such as 2027-01-31T12:00:00Z"
        ))
    };
    if let Ok(time) = text.parse::<Timestamp>() {
        return Ok(time.to_string());
    }
    let unit = text.chars().last().ok_or_else(wrong)?;
    let minutes = match unit {
        'd' => 24 * 60,
        'h' => 60,
        'm' => 1,
        _ => return Err(wrong()),
    };
    let count: i64 = text[..text.len() - 1].parse().map_err(|_| wrong())?;
    let seconds = count.checked_mul(minutes * 60).ok_or_else(wrong)?;
    let time = now
        .checked_add(SignedDuration::from_secs(seconds))
        .map_err(|_| wrong())?;
    Ok(time.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_times_or_durations() {
        let now: Timestamp = "2027-01-01T00:00:00Z".parse().unwrap();
        for (text, time) in [
            ("90d", "2027-04-01T00:00:00Z"),
            ("12h", "2027-01-01T12:00:00Z"),
            ("30m", "2027-01-01T00:30:00Z"),
            ("2027-05-01T00:00:00Z", "2027-05-01T00:00:00Z"),
        ] {
            assert_eq!(end(text, now).unwrap(), time, "{text}");
        }
        for wrong in ["", "d", "soon", "5y", "9999999999999999d", "1.5d"] {
            assert!(end(wrong, now).is_err(), "{wrong}");
        }
    }
}
