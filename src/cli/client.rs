//! The service's API as the commands use it: over HTTP to a running service, or to one inside this process.
//!
//! Local commands call the very routes a client calls, without a socket in between, so there is one implementation of
//! uploading, indexing and querying.

use super::outcome::{CallError, outcome, refusal, unreachable};
use super::output::note_line;
use super::wording::Place;
use super::{CliError, data_dir, trust};
use crate::config::{Config, DEFAULT_LISTEN};
use crate::http::host::canonical;
use crate::http::local_access::LocalAccess;
use crate::http::{AppState, OpenError, router};
use crate::store::StoreError;
use axum::Router;
use axum::body::Body;
use axum::http::{Request, Uri};
use serde_json::Value;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tower::ServiceExt;
use ureq::tls::TlsConfig;

/// Longest answer that is read; a ranking of ten thousand classes has a few megabytes.
const MAX_ANSWER_BYTES: u64 = 256 << 20;
/// How long the in-process service gets to put its work down.
const CLOSE_WITHIN: Duration = Duration::from_secs(30);

/// Where a command works.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct TargetArgs {
    /// Data directory to work in, when no service runs on it [default: shapelex-data]
    #[arg(long, env = "SHAPELEX_DATA", value_name = "DIR", conflicts_with = "server")]
    pub data: Option<PathBuf>,
    /// Running service to work with, such as http://127.0.0.1:7345 or https://shapes.example
    #[arg(long, env = "SHAPELEX_SERVER", value_name = "URL")]
    pub server: Option<String>,
    /// API key for a running service that asks for one; the environment keeps it out of the process list
    #[arg(long, env = "SHAPELEX_API_KEY", value_name = "KEY", hide_env_values = true)]
    pub api_key: Option<String>,
    /// Certificates (PEM) to trust a https:// service by, instead of the well-known ones
    #[arg(long, env = "SHAPELEX_CA_CERT", value_name = "FILE")]
    pub ca_cert: Option<PathBuf>,
}

/// Where a command works that only an operator may give.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct OperatorArgs {
    /// Data directory to work in, or of the service to work with: its token is there [default: shapelex-data]
    #[arg(long, env = "SHAPELEX_DATA", value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Running service to work with, such as http://127.0.0.1:7345 or https://shapes.example
    #[arg(long, env = "SHAPELEX_SERVER", value_name = "URL")]
    pub server: Option<String>,
    /// API key for a running service that asks for one; the environment keeps it out of the process list
    #[arg(long, env = "SHAPELEX_API_KEY", value_name = "KEY", hide_env_values = true)]
    pub api_key: Option<String>,
    /// Certificates (PEM) to trust a https:// service by, instead of the well-known ones
    #[arg(long, env = "SHAPELEX_CA_CERT", value_name = "FILE")]
    pub ca_cert: Option<PathBuf>,
}

impl TargetArgs {
    /// Connects, or opens the data directory, which has to be there.
    ///
    /// # Errors
    /// As [`Client::remote`], [`Client::local`] and [`data_dir::require`].
    pub fn client(&self) -> Result<Client, CliError> {
        if self.server.is_none() {
            data_dir::require(&data_dir::chosen(self.data.as_deref()))?;
        }
        self.client_or_new()
    }

    /// The same; a data directory that is not there is made, and said to be.
    ///
    /// # Errors
    /// As [`Client::remote`] and [`Client::local`].
    pub fn client_or_new(&self) -> Result<Client, CliError> {
        if let Some(url) = &self.server {
            return Ok(Client::remote(url, self.ca_cert.as_deref())?.with_key(self.api_key.clone()));
        }
        let data = data_dir::chosen(self.data.as_deref());
        data_dir::require_place(&data)?;
        let is_new = !data_dir::exists(&data);
        let client = Client::local(&data)?;
        if is_new {
            data_dir::say_made(&data);
        }
        Ok(client)
    }
}

impl OperatorArgs {
    /// As [`TargetArgs::client`]. On a data directory that a service runs on it is that service's client, also where it
    /// speaks TLS. Without an API key it brings the token that the service keeps in its data directory.
    ///
    /// # Errors
    /// As [`TargetArgs::client`].
    pub fn client(&self) -> Result<Client, CliError> {
        if self.server.is_none() {
            data_dir::require(&data_dir::chosen(self.data.as_deref()))?;
        }
        self.client_or_new()
    }

    /// The same; a data directory that is not there is made, and said to be.
    ///
    /// # Errors
    /// As [`TargetArgs::client_or_new`].
    pub fn client_or_new(&self) -> Result<Client, CliError> {
        let data = data_dir::chosen(self.data.as_deref());
        let access = || LocalAccess::read(&data);
        let remote = |url: &str, token: Option<String>| {
            let client = Client::remote(url, self.ca_cert.as_deref())?;
            Ok(client.with_key(self.api_key.clone().or(token)))
        };
        if let Some(url) = &self.server {
            let access = access().filter(|access| same_place(&access.url, url));
            return remote(url, access.map(|access| access.token));
        }
        data_dir::require_place(&data)?;
        let is_new = !data_dir::exists(&data);
        let locked = match Client::open(&data) {
            Ok(client) => {
                if is_new {
                    data_dir::say_made(&data);
                }
                return Ok(client);
            }
            Err(error @ OpenError::Store(StoreError::Locked { .. })) => error,
            Err(error) => return Err(opening_failed(&error)),
        };
        let Some(access) = access() else {
            return Err(opening_failed(&locked));
        };
        note_line!(
            "shapelex: a service runs on {}; asking it at {}",
            data.display(),
            access.url
        );
        let client = Client::with_trust(&access.url, trust::this_machine())?;
        Ok(client.with_key(self.api_key.clone().or(Some(access.token))))
    }
}

fn opening_failed(error: &OpenError) -> CliError {
    match error {
        OpenError::Store(store) => data_dir::open_error(store),
        other => CliError::Failed(other.to_string()),
    }
}

/// Whether two addresses are of the same service on this machine: the token must reach no other.
fn same_place(one: &str, other: &str) -> bool {
    let place = |url: &str| {
        let uri: Uri = url.trim_end_matches('/').parse().ok()?;
        let host = canonical(uri.host()?);
        let loopback = host == "localhost"
            || host
                .parse::<IpAddr>()
                .is_ok_and(|ip| ip.to_canonical().is_loopback());
        let host = if loopback { "localhost".to_owned() } else { host };
        Some((uri.scheme_str()?.to_owned(), host, uri.port_u16()))
    };
    place(one).is_some_and(|one| place(other) == Some(one))
}

/// A body to send.
pub enum Payload {
    /// None.
    Empty,
    /// JSON.
    Json(Value),
    /// Bytes with their content type.
    Bytes(String, Vec<u8>),
}

impl Payload {
    /// Its content type and bytes.
    pub(super) fn parts(self) -> (Option<String>, Vec<u8>) {
        match self {
            Self::Empty => (None, Vec::new()),
            Self::Json(value) => (
                Some("application/json".to_owned()),
                value.to_string().into_bytes(),
            ),
            Self::Bytes(content_type, bytes) => (Some(content_type), bytes),
        }
    }
}

/// A service to talk to.
pub struct Client(pub(super) Transport);

pub(super) enum Transport {
    Remote {
        agent: ureq::Agent,
        base: String,
        key: Option<String>,
    },
    Local {
        runtime: tokio::runtime::Runtime,
        router: Router,
        state: AppState,
        data: PathBuf,
    },
}

impl Client {
    /// A running service, trusted by the certificates in a file, or by the well-known ones. Nothing is sent yet.
    ///
    /// # Errors
    /// [`CliError::Usage`] where the address is neither `http://…` nor `https://…`, or the file is not usable.
    pub fn remote(url: &str, ca_cert: Option<&Path>) -> Result<Self, CliError> {
        Self::with_trust(url, trust::config(ca_cert)?)
    }

    fn with_trust(url: &str, trust: TlsConfig) -> Result<Self, CliError> {
        let base = url.trim_end_matches('/').to_owned();
        if !["http://", "https://"].iter().any(|scheme| {
            base.strip_prefix(scheme)
                .is_some_and(|host| !host.is_empty() && host.parse::<ureq::http::uri::Authority>().is_ok())
        }) {
            return Err(CliError::Usage(format!(
                "--server {url}: expected an address such as http://{DEFAULT_LISTEN} or https://shapes.example"
            )));
        }
        let agent = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .timeout_connect(Some(Duration::from_secs(10)))
            .tls_config(trust)
            .build()
            .new_agent();
        Ok(Self(Transport::Remote {
            agent,
            base,
            key: None,
        }))
    }

    /// Where it works.
    pub(super) fn place(&self) -> Place {
        match &self.0 {
            Transport::Remote { base, .. } => Place::Server(base.clone()),
            Transport::Local { data, .. } => Place::Data(data.clone()),
        }
    }

    /// The same with an API key.
    #[must_use]
    pub fn with_key(mut self, secret: Option<String>) -> Self {
        if let Transport::Remote { key, .. } = &mut self.0 {
            *key = secret;
        }
        self
    }

    /// The service inside this process, on a data directory nobody else uses.
    ///
    /// # Errors
    /// [`CliError::Failed`] where the directory cannot be opened.
    pub fn local(data: &Path) -> Result<Self, CliError> {
        Self::open(data).map_err(|error| opening_failed(&error))
    }

    fn open(data: &Path) -> Result<Self, OpenError> {
        let config = Config {
            data: data.to_owned(),
            ..Config::default()
        };
        // One person waits for one answer: every core learns, and no query is cut short.
        let mut service = config.service();
        service.indexing_threads = service.query_threads;
        service.query_timeout = Duration::from_secs(24 * 3600);
        service.check_keys = false;
        service.query_wait = service.query_timeout;
        service.max_body_bytes = service.limits.max_bytes;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .map_err(OpenError::Runtime)?;
        let state = {
            let _inside = runtime.enter();
            AppState::open(service)?
        };
        let router = router(state.clone());
        Ok(Self(Transport::Local {
            runtime,
            router,
            state,
            data: data.to_owned(),
        }))
    }

    /// Sends a request. `path` begins with `/` and is encoded already.
    ///
    /// # Errors
    /// [`CallError::Refused`] for every status but 2xx, [`CallError::Unreachable`] where nobody answers.
    pub fn call(&self, method: &str, path: &str, payload: Payload) -> Result<Value, CallError> {
        let (content_type, body) = payload.parts();
        let (status, bytes) = self.send(method, path, content_type, body)?;
        outcome(status, &bytes).map_err(|error| error.worded(&self.place()))
    }

    pub(super) fn send(
        &self,
        method: &str,
        path: &str,
        content_type: Option<String>,
        body: Vec<u8>,
    ) -> Result<(u16, Vec<u8>), CallError> {
        match &self.0 {
            Transport::Remote { agent, base, key } => {
                let mut request = ureq::http::Request::builder()
                    .method(method)
                    .uri(format!("{base}{path}"));
                if let Some(content_type) = content_type {
                    request = request.header("content-type", content_type);
                }
                if let Some(key) = key {
                    request = request.header("authorization", format!("Bearer {key}"));
                }
                let unreachable = |error: ureq::Error| unreachable(base, &error);
                let request = request
                    .body(body)
                    .map_err(|error| CallError::Unreachable(format!("{base}{path}: {error}")))?;
                let mut response = agent.run(request).map_err(unreachable)?;
                let status = response.status().as_u16();
                let bytes = response
                    .body_mut()
                    .with_config()
                    .limit(MAX_ANSWER_BYTES)
                    .read_to_vec()
                    .map_err(unreachable)?;
                Ok((status, bytes))
            }
            Transport::Local { runtime, router, .. } => {
                let mut request = Request::builder().method(method).uri(path);
                if let Some(content_type) = content_type {
                    request = request.header("content-type", content_type);
                }
                let request = request
                    .header("content-length", body.len())
                    .body(Body::from(body))
                    .map_err(|error| CallError::Unreachable(error.to_string()))?;
                runtime.block_on(async {
                    let response = match router.clone().oneshot(request).await {
                        Ok(response) => response,
                        Err(never) => match never {},
                    };
                    let status = response.status().as_u16();
                    let bytes = axum::body::to_bytes(response.into_body(), MAX_ANSWER_BYTES as usize)
                        .await
                        .map_err(|error| CallError::Unreachable(error.to_string()))?;
                    Ok((status, bytes.to_vec()))
                })
            }
        }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        if let Transport::Local { state, .. } = &self.0 {
            state.stopping.cancel();
            state.jobs.shutdown(CLOSE_WITHIN);
            // Everything acknowledged is on disk already; this only spares the next start some work.
            if let Err(error) = state.store.flush() {
                tracing::warn!(%error, "the last flush failed");
            }
        }
    }
}

impl Client {
    /// Sends a request whose answer is lines of JSON.
    ///
    /// # Errors
    /// As [`Client::call`]; [`CallError::Unreachable`] where a line is no JSON.
    pub(super) fn lines(&self, method: &str, path: &str, payload: Payload) -> Result<Vec<Value>, CallError> {
        let (content_type, body) = payload.parts();
        let (status, bytes) = self.send(method, path, content_type, body)?;
        if !(200..300).contains(&status) {
            let refused = outcome(status, &bytes).map(|_| Vec::new());
            return refused.map_err(|error| error.worded(&self.place()));
        }
        bytes
            .split(|byte| *byte == b'\n')
            .filter(|line| !line.is_empty())
            .map(|line| {
                let cut = |_| CallError::Unreachable("the answer was cut short; ask again".to_owned());
                serde_json::from_slice(line).map_err(cut)
            })
            .collect()
    }

    /// The refusal that a problem document within an answer stands for.
    pub(super) fn refusal_of(&self, problem: &Value) -> CallError {
        refusal(problem, "unknown").worded(&self.place())
    }
}

#[cfg(test)]
mod tests {
    use super::same_place;

    #[test]
    fn the_token_goes_to_the_service_that_wrote_it_only() {
        let written = "http://127.0.0.1:7345";
        for same in [
            "http://127.0.0.1:7345",
            "http://localhost:7345/",
            "http://[::1]:7345",
        ] {
            assert!(same_place(written, same), "{same}");
        }
        for other in [
            "http://127.0.0.1:7346",
            "http://10.0.0.1:7345",
            "http://localhost",
            "https://127.0.0.1:7345",
            "x",
        ] {
            assert!(!same_place(written, other), "{other}");
        }
        assert!(same_place("http://10.0.0.1:80", "http://10.0.0.1:80"));
    }
}
