//! `shapelex health`: whether a service answers, for container health checks.

use super::client::{Client, Payload};
use super::{CliError, output};
use crate::config::DEFAULT_LISTEN;
use std::path::PathBuf;

/// Arguments of `health`.
#[derive(Debug, clap::Args)]
pub struct HealthArgs {
    /// The service's address
    #[arg(long, env = "SHAPELEX_SERVER", value_name = "URL", default_value_t = format!("http://{DEFAULT_LISTEN}"))]
    pub server: String,
    /// Certificates (PEM) to trust a https:// service by, instead of the well-known ones
    #[arg(long, env = "SHAPELEX_CA_CERT", value_name = "FILE")]
    pub ca_cert: Option<PathBuf>,
    /// Ask whether it is ready for requests, not only whether it lives
    #[arg(long)]
    pub ready: bool,
}

/// Asks once.
///
/// # Errors
/// [`CliError::Failed`] where the service does not answer, or says that it is not well.
pub fn run(args: &HealthArgs, json: bool) -> Result<(), CliError> {
    let path = if args.ready { "/readyz" } else { "/healthz" };
    let answer = Client::remote(&args.server, args.ca_cert.as_deref())?.call("GET", path, Payload::Empty)?;
    if json {
        output::json(&answer)
    } else {
        output::line(if args.ready { "ready" } else { "alive" })
    }
}
