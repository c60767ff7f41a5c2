//! `shapelex serve`: the service.

use super::{CliError, data_dir, output, service};
use crate::config::{Config, Settings};
use crate::http::check_tls;
use crate::telemetry;
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `serve`.
#[derive(Debug, clap::Args)]
pub struct ServeArgs {
    /// TOML file with settings; flags and environment win over it
    #[arg(long, env = "SHAPELEX_CONFIG", value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// The settings.
    #[command(flatten)]
    pub settings: Settings,
}

/// Serves until it is interrupted.
///
/// # Errors
/// [`CliError::Usage`] for a wrong configuration; [`CliError::Failed`] where the service cannot start or fails.
pub fn run(args: &ServeArgs, json: bool) -> Result<(), CliError> {
    let usage = |error: &dyn std::fmt::Display| CliError::Usage(error.to_string());
    let config = config(args)?;
    let service = config.service();
    check_tls(&service).map_err(|error| usage(&error))?;
    data_dir::require_place(&config.data)?;
    if config.recovery_mode {
        data_dir::require(&config.data)?;
    }
    let is_new = !data_dir::exists(&config.data);
    let collector = Some(config.otlp_endpoint.as_str()).filter(|endpoint| !endpoint.is_empty());
    let _export =
        telemetry::init(&config.log, config.log_format, collector).map_err(|error| usage(&error))?;
    telemetry::log_panics();
    tracing::info!(
        version = env!("CARGO_PKG_VERSION"),
        data = %config.data.display(),
        "starting"
    );
    let secure = service.tls_cert.is_some();
    service::run_until(service, service::interrupted(), |address| {
        if is_new {
            tracing::info!("{}", data_dir::made(&config.data));
        }
        tracing::info!(%address, "listening");
        let scheme = if secure { "https" } else { "http" };
        let url = format!("{scheme}://{address}");
        let told = if json {
            output::json(&json!({ "listening": url }))
        } else {
            output::line(&format!("listening on {url}"))
        };
        // A service whose stdout nobody reads serves all the same.
        told.or_else(|error| match error {
            CliError::OutputClosed => Ok(()),
            other => Err(other),
        })
    })?;
    tracing::info!("stopped");
    Ok(())
}

/// The settings of flags, environment and file together.
fn config(args: &ServeArgs) -> Result<Config, CliError> {
    let usage = |error: &dyn std::fmt::Display| CliError::Usage(error.to_string());
    let file = match &args.config {
        Some(path) => Settings::from_file(path).map_err(|error| usage(&error))?,
        None => Settings::default(),
    };
    args.settings.clone().or(file).resolve().map_err(|error| {
        let Some(name) = error.name() else {
            return usage(&error);
        };
        let flag = name.replace('_', "-");
        // The weakest source that has the value is to blame only where no stronger one has.
        match &args.config {
            _ if args.settings.has(name) => CliError::Usage(match environment(&flag, name) {
                Some(variable) => format!("{variable}: {error}"),
                None => format!("--{flag}: {error}"),
            }),
            Some(path) => usage(&error.in_file(path)),
            None => usage(&error),
        }
    })
}

/// The environment variable a setting came from, where no flag gave it.
fn environment(flag: &str, name: &str) -> Option<String> {
    let flag = format!("--{flag}");
    let given = std::env::args().any(|arg| arg == flag || arg.starts_with(&format!("{flag}=")));
    let variable = format!("SHAPELEX_{}", name.to_uppercase());
    (!given && std::env::var_os(&variable).is_some()).then_some(variable)
}
