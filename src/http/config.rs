//! The service's settings: plain values, filled by whoever starts it.

use super::archive::ArchiveLimits;
use super::connections::ConnectionLimits;
use crate::jobs::JobOptions;
use crate::model::KeyLimits;
use crate::store::StoreOptions;
use shapelex_core::mesh::Limits;
use shapelex_core::parameters::Preset;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

/// Where the service listens, and where clients look for it, unless told otherwise.
pub const DEFAULT_LISTEN: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 7345);

/// What an upload may hold at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UploadLimits {
    /// Bytes of the whole body.
    pub max_body_bytes: usize,
    /// Members of an archive and their bytes; a multipart body has no more parts than that either.
    pub archive: ArchiveLimits,
}

/// Everything the service can be told.
#[derive(Clone, Debug, PartialEq)]
pub struct ServiceConfig {
    /// Where it listens.
    pub listen: SocketAddr,
    /// Names and addresses clients call it by, beside those of loopback and of `listen`; `*` for all.
    pub hosts: Vec<String>,
    /// Whether requests without a key are answered also where `listen` is not loopback, as long as no key exists.
    pub allow_anonymous: bool,
    /// Whether keys, names and origins are looked at. Not so for callers inside this process, who have the data directory anyway.
    pub check_keys: bool,
    /// The certificate chain of HTTPS, PEM.
    pub tls_cert: Option<PathBuf>,
    /// Its private key, PEM.
    pub tls_key: Option<PathBuf>,
    /// Connections served at a time.
    pub max_connections: usize,
    /// Connections of one address served at a time; `None` for a quarter of all.
    pub max_connections_per_address: Option<usize>,
    /// How long the head of a request may take to arrive, and a connection may idle.
    pub header_timeout: Duration,
    /// Longest head of a request, in bytes.
    pub max_header_bytes: usize,
    /// Origins whose pages may call the API; `*` for all.
    pub cors_origins: Vec<String>,
    /// How much an API key may do that does not say otherwise.
    pub key_limits: KeyLimits,
    /// Queries that take longer are logged.
    pub slow_query: Option<Duration>,
    /// Where it keeps everything.
    pub data_dir: PathBuf,
    /// Whether only the catalogue is served and nothing is changed.
    pub recovery_mode: bool,
    /// How the store is opened.
    pub store: StoreOptions,
    /// Longest request body, in bytes.
    pub max_body_bytes: usize,
    /// Files of one upload, or members of its archive, at most.
    pub max_upload_files: usize,
    /// Bytes of all members of an archive, unpacked, at most.
    pub max_unpacked_bytes: usize,
    /// What reading one mesh may build at most.
    pub limits: Limits,
    /// Bytes of memory that requests may take, all together: bodies, what is unpacked of them, computing, answers.
    pub memory_bytes: u64,
    /// Bytes of memory that a reindex may take, the index that is served included.
    pub indexing_memory_bytes: u64,
    /// Threads that answer queries and check uploads.
    pub query_threads: usize,
    /// Queries that may wait for a thread.
    pub query_queue: usize,
    /// How long a query waits for a thread before it is turned away.
    pub query_wait: Duration,
    /// How long a query may compute.
    pub query_timeout: Duration,
    /// How long a request's body may take to arrive.
    pub upload_timeout: Duration,
    /// Threads that learn dictionaries.
    pub indexing_threads: usize,
    /// Jobs that may wait.
    pub job_queue: usize,
    /// What the first reindex starts from, where it names no preset.
    pub preset: Preset,
    /// How often a snapshot is made by itself; `None` for never.
    pub snapshot_every: Option<Duration>,
    /// Snapshots made by themselves that are kept.
    pub snapshot_keep: usize,
    /// Bytes of a snapshot that is restored, packed and unpacked, at most.
    pub snapshot_max_bytes: u64,
    /// How often all stored files and records are checked; `None` for never.
    pub scrub_every: Option<Duration>,
    /// Bytes read per second while they are checked.
    pub scrub_bytes_per_second: u64,
    /// How long running work may go on when the service is asked to stop.
    pub shutdown_timeout: Duration,
}

impl Default for ServiceConfig {
    /// [`DEFAULT_LISTEN`], `./shapelex-data`, bodies up to 128 MiB, 2048 files or 256 MiB unpacked per upload, a query
    /// thread per core, 64 waiting queries for at most 10 s each, 60 s per query, 120 s per body.
    fn default() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let jobs = JobOptions::default();
        Self {
            listen: DEFAULT_LISTEN,
            hosts: Vec::new(),
            allow_anonymous: false,
            check_keys: true,
            tls_cert: None,
            tls_key: None,
            max_connections: 1024,
            max_connections_per_address: None,
            header_timeout: Duration::from_secs(20),
            max_header_bytes: 32 << 10,
            cors_origins: Vec::new(),
            key_limits: KeyLimits::default(),
            slow_query: None,
            data_dir: PathBuf::from("shapelex-data"),
            recovery_mode: false,
            store: StoreOptions::default(),
            max_body_bytes: 128 << 20,
            max_upload_files: 2048,
            max_unpacked_bytes: 256 << 20,
            limits: Limits::default(),
            memory_bytes: 1536 << 20,
            indexing_memory_bytes: jobs.memory_bytes,
            query_threads: cores,
            query_queue: 64,
            query_wait: Duration::from_secs(10),
            query_timeout: Duration::from_secs(60),
            upload_timeout: Duration::from_secs(120),
            indexing_threads: jobs.indexing_threads,
            job_queue: jobs.queue_limit,
            preset: Preset::Default,
            snapshot_every: None,
            snapshot_keep: 7,
            snapshot_max_bytes: 16 << 30,
            scrub_every: Some(Duration::from_secs(168 * 3600)),
            scrub_bytes_per_second: 16 << 20,
            shutdown_timeout: Duration::from_secs(10),
        }
    }
}

impl ServiceConfig {
    /// How many connections there may be.
    pub fn connection_limits(&self) -> ConnectionLimits {
        let quarter = self.max_connections.div_ceil(4);
        ConnectionLimits {
            total: self.max_connections,
            per_address: self.max_connections_per_address.unwrap_or(quarter),
        }
    }

    /// What an upload may hold.
    pub fn upload_limits(&self) -> UploadLimits {
        UploadLimits {
            max_body_bytes: self.max_body_bytes,
            archive: ArchiveLimits {
                max_members: self.max_upload_files,
                max_bytes: self.max_unpacked_bytes,
            },
        }
    }

    /// How jobs are run.
    pub fn job_options(&self) -> JobOptions {
        JobOptions {
            indexing_threads: self.indexing_threads,
            queue_limit: self.job_queue,
            limits: self.limits,
            memory_bytes: self.indexing_memory_bytes,
        }
    }
}
