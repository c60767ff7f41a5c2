//! `shapelex serve`: the service.

use super::{CliError, output, service};
use crate::config::Settings;
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
    let file = match &args.config {
        Some(path) => Settings::from_file(path).map_err(|error| usage(&error))?,
        None => Settings::default(),
    };
    let config = args
        .settings
        .clone()
        .or(file)
        .resolve()
        .map_err(|error| usage(&error))?;
    let collector = Some(config.otlp_endpoint.as_str()).filter(|endpoint| !endpoint.is_empty());
    let _export =
        telemetry::init(&config.log, config.log_format, collector).map_err(|error| usage(&error))?;
    telemetry::log_panics();
    tracing::info!(
        version = env!("CARGO_PKG_VERSION"),
        data = %config.data.display(),
        "starting"
    );
    let service = config.service();
    let secure = service.tls_cert.is_some();
    service::run_until(service, service::interrupted(), |address| {
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
