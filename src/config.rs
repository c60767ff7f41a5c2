//! Configuration of the service: flags, then environment, then a TOML file, then defaults.
//!
//! One struct, [`Settings`], is both what clap reads and what the file holds, so a setting has one name in three
//! spellings: `--query-timeout-seconds`, `SHAPELEX_QUERY_TIMEOUT_SECONDS`, `query_timeout_seconds = 60`. The table in
//! `docs/configuration.md` is checked against it by a test.

pub use crate::http::config::DEFAULT_LISTEN;

use crate::http::ServiceConfig;
use crate::model::KeyLimits;
use crate::store::StoreOptions;
use crate::telemetry::LogFormat;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::{Deserialize, Serialize};
use shapelex_core::mesh::Limits;
use shapelex_core::parameters::Preset;
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Where the service and the local commands keep their data, unless told otherwise.
pub const DEFAULT_DATA: &str = "shapelex-data";

/// The configuration file or a setting is wrong.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("configuration file {path}: {reason}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The file is not TOML, or a key or value is not known.
    #[error("configuration file {path}: {reason}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Where and why.
        reason: String,
    },
    /// A value is outside its range.
    #[error("{name} must be {expected}, got {found}")]
    OutOfRange {
        /// The setting, as the file spells it.
        name: &'static str,
        /// What it may be.
        expected: &'static str,
        /// What it was.
        found: String,
    },
}

impl ConfigError {
    /// The setting it is about, as the file spells it.
    pub fn name(&self) -> Option<&'static str> {
        match self {
            Self::OutOfRange { name, .. } => Some(name),
            _ => None,
        }
    }

    /// The same about a value that a file has, with its line.
    #[must_use]
    pub fn in_file(self, path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let is_about = |line: &str| {
            let key = line.split_once('=').map(|(key, _)| key.trim());
            key.is_some() && key == self.name()
        };
        let reason = match text.lines().position(is_about) {
            Some(line) => format!("line {}: {self}", line + 1),
            None => self.to_string(),
        };
        Self::Invalid {
            path: path.to_owned(),
            reason,
        }
    }
}

macro_rules! settings {
    ($($(#[doc = $help:literal])+ $field:ident : $type:ty = $default:expr, $env:literal, $value:literal $(, $extra:ident = $setting:expr)*;)*) => {
        /// Settings of one source; `None` where it is silent.
        #[derive(Clone, Debug, Default, PartialEq, clap::Args, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        #[command(next_help_heading = "Settings")]
        pub struct Settings {
            $($(#[doc = $help])+ #[arg(long, env = $env, value_name = $value $(, $extra = $setting)*)] pub $field: Option<$type>,)*
        }

        /// The configuration in force.
        #[derive(Clone, Debug, PartialEq, Serialize)]
        pub struct Config {
            $($(#[doc = $help])+ pub $field: $type,)*
        }

        impl Default for Config {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl Settings {
            /// These settings, and where they are silent those of a weaker source.
            #[must_use]
            pub fn or(self, weaker: Self) -> Self {
                Self { $($field: self.$field.or(weaker.$field),)* }
            }

            /// Whether this source has the setting of that name.
            pub fn has(&self, name: &str) -> bool {
                match name {
                    $(stringify!($field) => self.$field.is_some(),)*
                    _ => false,
                }
            }

            /// These settings, and where they are silent the defaults.
            ///
            /// # Errors
            /// [`ConfigError::OutOfRange`] where a value makes no sense.
            pub fn resolve(self) -> Result<Config, ConfigError> {
                let default = Config::default();
                let config = Config { $($field: self.$field.unwrap_or(default.$field),)* };
                config.validate()?;
                Ok(config)
            }
        }
    };
}

settings! {
    /// Directory that holds everything the service must not forget
    data: PathBuf = PathBuf::from(DEFAULT_DATA), "SHAPELEX_DATA", "DIR";
    /// Serve the catalogue only: no index is loaded, no job runs, nothing is changed
    recovery_mode: bool = false, "SHAPELEX_RECOVERY_MODE", "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true";
    /// Address and port to listen on; port 0 takes a free one and says which
    listen: SocketAddr = DEFAULT_LISTEN, "SHAPELEX_LISTEN", "ADDRESS";
    /// Name or address clients call the service by, beside those of loopback and the listen address, such as shapes.example; * for any
    host: Vec<String> = Vec::new(), "SHAPELEX_HOST", "NAME", value_delimiter = ',', action = clap::ArgAction::Append;
    /// Answer requests without an API key beyond loopback too, as long as no key exists
    allow_anonymous: bool = false, "SHAPELEX_ALLOW_ANONYMOUS", "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true";
    /// Certificate chain (PEM) for HTTPS by the service itself, with --tls-key; none for HTTP
    tls_cert: PathBuf = PathBuf::new(), "SHAPELEX_TLS_CERT", "FILE";
    /// Private key (PEM) of the certificate
    tls_key: PathBuf = PathBuf::new(), "SHAPELEX_TLS_KEY", "FILE";
    /// Origins whose pages may call the API from a browser, such as https://viewer.example, or * for all
    cors_origin: Vec<String> = Vec::new(), "SHAPELEX_CORS_ORIGIN", "ORIGIN", value_delimiter = ',', action = clap::ArgAction::Append;
    /// Connections served at a time, as far as the system lets files be open; for one more the longest idle one goes
    max_connections: usize = 1024, "SHAPELEX_MAX_CONNECTIONS", "COUNT";
    /// Connections of one address served at a time; 0 for a quarter of all
    max_connections_per_address: usize = 0, "SHAPELEX_MAX_CONNECTIONS_PER_ADDRESS", "COUNT";
    /// Time the head of a request may take to arrive, and a connection may idle, in seconds
    header_timeout_seconds: u64 = 20, "SHAPELEX_HEADER_TIMEOUT_SECONDS", "SECONDS";
    /// Longest head of a request, its line and at most 100 headers, in KiB
    max_header_kib: usize = 32, "SHAPELEX_MAX_HEADER_KIB", "KIB";
    /// Meshes an API key may query per minute, where it does not say itself; 0 for no limit
    key_queries_per_minute: u32 = 0, "SHAPELEX_KEY_QUERIES_PER_MINUTE", "COUNT";
    /// Size of the shapes an API key may have uploaded at a time, in MiB, where it does not say itself; 0 for no limit
    key_max_stored_mib: u64 = 0, "SHAPELEX_KEY_MAX_STORED_MIB", "MIB";
    /// Classes an API key may have made at a time, where it does not say itself; 0 for no limit
    key_max_classes: u64 = 0, "SHAPELEX_KEY_MAX_CLASSES", "COUNT";
    /// Log queries that take this long or longer, in milliseconds; 0 for none
    slow_query_ms: u64 = 0, "SHAPELEX_SLOW_QUERY_MS", "MILLISECONDS";
    /// Log level (error, warn, info, debug, trace, off), or a list of target=level
    log: String = "info".to_owned(), "SHAPELEX_LOG", "FILTER";
    /// OpenTelemetry collector that gets traces (OTLP over HTTP), such as http://127.0.0.1:4318; none for no traces
    otlp_endpoint: String = String::new(), "SHAPELEX_OTLP_ENDPOINT", "URL";
    /// How log lines are written
    log_format: LogFormat = LogFormat::Text, "SHAPELEX_LOG_FORMAT", "FORMAT";
    /// Preset the first reindex starts from, where it names none
    preset: Preset = Preset::Default, "SHAPELEX_PRESET", "PRESET", value_parser = preset_values();
    /// Longest request body, in MiB
    max_body_mib: usize = 128, "SHAPELEX_MAX_BODY_MIB", "MIB";
    /// Files in one upload, or members of its archive, at most
    max_upload_files: usize = 2048, "SHAPELEX_MAX_UPLOAD_FILES", "COUNT";
    /// Size of an archive's members once unpacked, at most, in MiB
    max_unpacked_mib: usize = 256, "SHAPELEX_MAX_UNPACKED_MIB", "MIB";
    /// Vertices of one mesh, at most
    max_vertices: usize = 2_000_000, "SHAPELEX_MAX_VERTICES", "COUNT";
    /// Triangles of one mesh, at most
    max_faces: usize = 4_000_000, "SHAPELEX_MAX_FACES", "COUNT";
    /// Poses sampled from one animated file, at most
    max_poses: usize = 64, "SHAPELEX_MAX_POSES", "COUNT";
    /// Memory for requests and for learning, all together, in MiB: bodies, what is unpacked of them, computing, answers, the index
    memory_mib: u64 = 2048, "SHAPELEX_MEMORY_MIB", "MIB";
    /// What of it learning and the index may take, in MiB; 0 takes a quarter
    indexing_memory_mib: u64 = 0, "SHAPELEX_INDEXING_MEMORY_MIB", "MIB";
    /// Threads that answer queries; 0 takes one per core
    query_threads: usize = 0, "SHAPELEX_QUERY_THREADS", "COUNT";
    /// Queries that may wait for a thread before more are refused
    query_queue: usize = 64, "SHAPELEX_QUERY_QUEUE", "COUNT";
    /// Time a query waits for a thread before it is refused, in seconds
    query_wait_seconds: u64 = 10, "SHAPELEX_QUERY_WAIT_SECONDS", "SECONDS";
    /// Time a query may compute before it is stopped, in seconds
    query_timeout_seconds: u64 = 60, "SHAPELEX_QUERY_TIMEOUT_SECONDS", "SECONDS";
    /// Time a request's body may take to arrive, in seconds
    upload_timeout_seconds: u64 = 120, "SHAPELEX_UPLOAD_TIMEOUT_SECONDS", "SECONDS";
    /// Threads that learn dictionaries in the background; 0 leaves one core to queries
    indexing_threads: usize = 0, "SHAPELEX_INDEXING_THREADS", "COUNT";
    /// Jobs that may wait before more are refused
    job_queue: usize = 1000, "SHAPELEX_JOB_QUEUE", "COUNT";
    /// Time running requests get to finish at shutdown, in seconds
    shutdown_timeout_seconds: u64 = 10, "SHAPELEX_SHUTDOWN_TIMEOUT_SECONDS", "SECONDS";
    /// Time between snapshots made by themselves, in minutes; 0 makes none
    snapshot_every_minutes: u64 = 0, "SHAPELEX_SNAPSHOT_EVERY_MINUTES", "MINUTES";
    /// Snapshots made by themselves that are kept; older ones are removed
    snapshot_keep: usize = 7, "SHAPELEX_SNAPSHOT_KEEP", "COUNT";
    /// Size of a snapshot that is restored, packed and unpacked, at most, in MiB
    snapshot_max_mib: u64 = 16_384, "SHAPELEX_SNAPSHOT_MAX_MIB", "MIB";
    /// Time between checks of all stored files and records, in hours; 0 makes none
    scrub_every_hours: u64 = 168, "SHAPELEX_SCRUB_EVERY_HOURS", "HOURS";
    /// Most that is read per second while stored files and records are checked, in MiB
    scrub_mib_per_second: u64 = 16, "SHAPELEX_SCRUB_MIB_PER_SECOND", "MIB";
    /// Page cache of the key-value store, in MiB
    cache_mib: u64 = 64, "SHAPELEX_CACHE_MIB", "MIB";
}

impl Settings {
    /// Reads a TOML file.
    ///
    /// # Errors
    /// [`ConfigError::Unreadable`] or [`ConfigError::Invalid`], with the place in the file.
    pub fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path).map_err(|error| ConfigError::Unreadable {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
        toml::from_str(&text).map_err(|error| ConfigError::Invalid {
            path: path.to_owned(),
            reason: one_line(&error, &text),
        })
    }
}

/// The presets by their names, which the help lists.
pub fn preset_values() -> impl TypedValueParser<Value = Preset> {
    let name = |preset: Preset| match preset {
        Preset::Default => "default",
        Preset::Paper => "paper",
        Preset::Robust => "robust",
        Preset::Fast => "fast",
    };
    PossibleValuesParser::new(Preset::ALL.map(name)).try_map(move |text| {
        let found = Preset::ALL.into_iter().find(|&preset| name(preset) == text);
        found.ok_or("there is no such preset")
    })
}

fn given(path: &Path) -> Option<PathBuf> {
    (!path.as_os_str().is_empty()).then(|| path.to_owned())
}

/// `*`, or what a browser sends as `origin`: scheme, host and perhaps a port.
fn is_origin(text: &str) -> bool {
    let host = text
        .strip_prefix("https://")
        .or_else(|| text.strip_prefix("http://"));
    let inside = |c: char| c.is_ascii_alphanumeric() || "-._:[]".contains(c);
    text == "*" || host.is_some_and(|host| !host.is_empty() && host.chars().all(inside))
}

/// `*`, a name as DNS has it, or an IP address.
fn is_host(text: &str) -> bool {
    let bare = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    let part = |part: &str| {
        let inside = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        (1..=63).contains(&part.len()) && part.chars().all(inside)
    };
    let name = text.strip_suffix('.').unwrap_or(text);
    text == "*" || bare.unwrap_or(text).parse::<IpAddr>().is_ok() || name.split('.').all(part)
}

/// The parser's message with the line it is about, on one line.
fn one_line(error: &toml::de::Error, text: &str) -> String {
    let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
    match error.span() {
        Some(span) => {
            let line = text.bytes().take(span.start).filter(|&b| b == b'\n').count();
            let written = text.lines().nth(line).unwrap_or_default();
            // An unknown key is named by the message; a wrong value is not told whose it is.
            let key = written.split_once('=').map(|(key, _)| key.trim());
            let key = key.filter(|key| !message.contains(&format!("`{key}`")));
            let key = key.map(|key| format!("{key}: ")).unwrap_or_default();
            format!("line {}: {key}{message}", line + 1)
        }
        None => message,
    }
}

impl Config {
    fn validate(&self) -> Result<(), ConfigError> {
        let at_least_one: [(&'static str, u64); 18] = [
            ("max_body_mib", self.max_body_mib as u64),
            ("max_upload_files", self.max_upload_files as u64),
            ("max_unpacked_mib", self.max_unpacked_mib as u64),
            ("max_vertices", self.max_vertices as u64),
            ("max_faces", self.max_faces as u64),
            ("max_poses", self.max_poses as u64),
            ("memory_mib", self.memory_mib),
            ("query_queue", self.query_queue as u64),
            ("query_wait_seconds", self.query_wait_seconds),
            ("query_timeout_seconds", self.query_timeout_seconds),
            ("upload_timeout_seconds", self.upload_timeout_seconds),
            ("job_queue", self.job_queue as u64),
            ("snapshot_keep", self.snapshot_keep as u64),
            ("snapshot_max_mib", self.snapshot_max_mib),
            ("scrub_mib_per_second", self.scrub_mib_per_second),
            ("cache_mib", self.cache_mib),
            ("max_connections", self.max_connections as u64),
            ("header_timeout_seconds", self.header_timeout_seconds),
        ];
        if let Some(origin) = self.cors_origin.iter().find(|o| !is_origin(o)) {
            return Err(ConfigError::OutOfRange {
                name: "cors_origin",
                expected: "* or a scheme and host without a path, such as https://viewer.example",
                found: origin.clone(),
            });
        }
        if !self.otlp_endpoint.is_empty() && !self.otlp_endpoint.starts_with("http://") {
            return Err(ConfigError::OutOfRange {
                name: "otlp_endpoint",
                expected: "an address that begins with http://",
                found: self.otlp_endpoint.clone(),
            });
        }
        if let Some(name) = self.host.iter().find(|name| !is_host(name)) {
            return Err(ConfigError::OutOfRange {
                name: "host",
                expected: "* or a name or address without scheme and port, such as shapes.example",
                found: name.clone(),
            });
        }
        if self.indexing_mib() >= self.memory_mib {
            return Err(ConfigError::OutOfRange {
                name: "indexing_memory_mib",
                expected: "less than memory_mib",
                found: self.indexing_memory_mib.to_string(),
            });
        }
        if !(1..=1024).contains(&self.max_header_kib) {
            return Err(ConfigError::OutOfRange {
                name: "max_header_kib",
                expected: "between 1 and 1024",
                found: self.max_header_kib.to_string(),
            });
        }
        match at_least_one.iter().find(|(_, value)| *value == 0) {
            Some(&(name, value)) => Err(ConfigError::OutOfRange {
                name,
                expected: "1 or more",
                found: value.to_string(),
            }),
            None => Ok(()),
        }
    }

    fn indexing_mib(&self) -> u64 {
        match self.indexing_memory_mib {
            0 => self.memory_mib / 4,
            given => given,
        }
    }

    /// The same in the service's own units.
    pub fn service(&self) -> ServiceConfig {
        let default = ServiceConfig::default();
        let or_default = |threads: usize, default: usize| if threads == 0 { default } else { threads };
        ServiceConfig {
            listen: self.listen,
            hosts: self.host.clone(),
            allow_anonymous: self.allow_anonymous,
            check_keys: true,
            tls_cert: given(&self.tls_cert),
            tls_key: given(&self.tls_key),
            max_connections: self.max_connections,
            max_connections_per_address: Some(self.max_connections_per_address).filter(|&n| n > 0),
            header_timeout: Duration::from_secs(self.header_timeout_seconds),
            max_header_bytes: self.max_header_kib << 10,
            cors_origins: self.cors_origin.clone(),
            key_limits: KeyLimits {
                queries_per_minute: Some(self.key_queries_per_minute).filter(|&n| n > 0),
                stored_bytes: Some(self.key_max_stored_mib << 20).filter(|&n| n > 0),
                classes: Some(self.key_max_classes).filter(|&n| n > 0),
            },
            slow_query: Some(Duration::from_millis(self.slow_query_ms)).filter(|d| !d.is_zero()),
            data_dir: self.data.clone(),
            recovery_mode: self.recovery_mode,
            store: StoreOptions {
                cache_bytes: self.cache_mib << 20,
            },
            max_body_bytes: self.max_body_mib << 20,
            max_upload_files: self.max_upload_files,
            max_unpacked_bytes: self.max_unpacked_mib << 20,
            limits: Limits {
                max_vertices: self.max_vertices,
                max_faces: self.max_faces,
                max_poses: self.max_poses,
                ..Limits::default()
            },
            memory_bytes: (self.memory_mib - self.indexing_mib()) << 20,
            indexing_memory_bytes: self.indexing_mib() << 20,
            query_threads: or_default(self.query_threads, default.query_threads),
            query_queue: self.query_queue,
            query_wait: Duration::from_secs(self.query_wait_seconds),
            query_timeout: Duration::from_secs(self.query_timeout_seconds),
            upload_timeout: Duration::from_secs(self.upload_timeout_seconds),
            indexing_threads: or_default(self.indexing_threads, default.indexing_threads),
            job_queue: self.job_queue,
            preset: self.preset,
            snapshot_every: (self.snapshot_every_minutes > 0)
                .then(|| Duration::from_secs(60 * self.snapshot_every_minutes)),
            snapshot_keep: self.snapshot_keep,
            snapshot_max_bytes: self.snapshot_max_mib << 20,
            scrub_every: (self.scrub_every_hours > 0)
                .then(|| Duration::from_secs(3600 * self.scrub_every_hours)),
            scrub_bytes_per_second: self.scrub_mib_per_second << 20,
            shutdown_timeout: Duration::from_secs(self.shutdown_timeout_seconds),
        }
    }
}

#[cfg(test)]
mod tests;
