//! Logs: to stderr, as text for people or as one JSON object per line for machines. Traces: to an OpenTelemetry
//! collector, where one is named and the feature `otlp` was built in.

#[cfg(feature = "otlp")]
mod otlp;

use serde::{Deserialize, Serialize};
use std::io::IsTerminal;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, Registry};

/// How log lines are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// One readable line per event.
    #[default]
    Text,
    /// One JSON object per event.
    Json,
}

/// Logging could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum TelemetryError {
    /// The filter is not understood.
    #[error("'{filter}' is no log filter ({reason}); use a level such as info, or info,shapelex=debug")]
    Filter {
        /// What was given.
        filter: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The process has a subscriber already.
    #[error("logging was set up twice")]
    AlreadySet,
    /// This build cannot.
    #[error("this shapelex was built without traces; build it with `--features otlp`")]
    NotBuilt,
    /// Traces cannot be sent there.
    #[error("traces cannot be sent to {endpoint}: {reason}")]
    Collector {
        /// Where they were to go.
        endpoint: String,
        /// Why not.
        reason: String,
    },
}

/// Keeps traces going out. What has not been sent when it is dropped is sent then.
#[derive(Default)]
#[must_use = "traces end when this is dropped"]
pub struct Export {
    #[cfg(feature = "otlp")]
    _traces: Option<otlp::Traces>,
}

type BoxedLayer = Box<dyn Layer<Registry> + Send + Sync>;

/// Installs the process's log output. `filter` is a level (`error`, `warn`, `info`, `debug`, `trace`, `off`) or a list
/// of `target=level`. `collector` is the address of an OpenTelemetry collector that gets our spans, whatever the filter
/// says about logs.
///
/// # Errors
/// [`TelemetryError::Filter`] for a filter that cannot be read; [`TelemetryError::AlreadySet`] on a second call;
/// [`TelemetryError::NotBuilt`] and [`TelemetryError::Collector`] where traces cannot be sent.
pub fn init(filter: &str, format: LogFormat, collector: Option<&str>) -> Result<Export, TelemetryError> {
    let filter = parse(filter)?;
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal());
    let mut layers: Vec<BoxedLayer> = vec![match format {
        LogFormat::Text => lines.with_filter(filter).boxed(),
        // The list of spans ends with the current one.
        LogFormat::Json => lines
            .json()
            .flatten_event(true)
            .with_current_span(false)
            .with_filter(filter)
            .boxed(),
    }];
    let export = match collector {
        None => Export::default(),
        Some(endpoint) => export_to(endpoint, &mut layers)?,
    };
    tracing_subscriber::registry()
        .with(layers)
        .try_init()
        .map_err(|_| TelemetryError::AlreadySet)?;
    Ok(export)
}

#[cfg(feature = "otlp")]
fn export_to(endpoint: &str, layers: &mut Vec<BoxedLayer>) -> Result<Export, TelemetryError> {
    let (traces, layer) = otlp::export_to(endpoint)?;
    layers.push(layer);
    Ok(Export {
        _traces: Some(traces),
    })
}

#[cfg(not(feature = "otlp"))]
fn export_to(_: &str, _: &mut Vec<BoxedLayer>) -> Result<Export, TelemetryError> {
    Err(TelemetryError::NotBuilt)
}

/// Logs every panic with its place, thread and message, within the span it happened in, instead of printing it.
pub fn log_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map(ToString::to_string).unwrap_or_default();
        let said = panic.payload();
        let message = said
            .downcast_ref::<&str>()
            .copied()
            .or_else(|| said.downcast_ref::<String>().map(String::as_str))
            .unwrap_or("without a message");
        let thread = std::thread::current();
        let thread = thread.name().unwrap_or_default();
        tracing::error!(place, thread, message, "panic");
    }));
}

/// A bare level filters everything that is ours and the warnings of everybody else.
fn parse(filter: &str) -> Result<EnvFilter, TelemetryError> {
    let bare = filter.parse::<tracing_subscriber::filter::LevelFilter>();
    let directives = match bare {
        Ok(level) if level > tracing_subscriber::filter::LevelFilter::WARN => {
            format!("warn,shapelex={filter},tower_http={filter}")
        }
        _ => filter.to_owned(),
    };
    EnvFilter::try_new(directives).map_err(|error| TelemetryError::Filter {
        filter: filter.to_owned(),
        reason: error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_and_directives_are_filters_and_other_text_is_not() {
        for good in ["info", "off", "shapelex=debug,warn", "TRACE"] {
            assert!(parse(good).is_ok(), "{good}");
        }
        let error = parse("shapelex=loud").unwrap_err();
        assert!(error.to_string().contains("shapelex=loud"), "{error}");
    }
}
