//! What the service asks of the system for its process: that its files are its owner's alone, and as many open ones as
//! it may have.

use crate::http::ServiceConfig;

/// Open files beside connections: the store, logs, libraries, what jobs read and write.
const OWN_FILES: u64 = 128;
/// Open files a connection may need: its socket, and the file it is answered with or that is being received.
const FILES_PER_CONNECTION: u64 = 2;

/// Sets the process up for a service, and lowers its number of connections to what the system lets it have open.
pub fn prepare(config: &mut ServiceConfig) {
    keep_files_private();
    let Some(limit) = raise_open_files() else { return };
    let most = fitting(config.max_connections, limit);
    if most < config.max_connections {
        tracing::warn!(
            open_files = limit,
            wanted = config.max_connections,
            max_connections = most,
            "the system lets too few files be open for max_connections, so fewer are served; raise the limit of open files (ulimit -n)"
        );
        config.max_connections = most;
    }
}

/// As many connections as are wanted and fit.
fn fitting(wanted: usize, open_files: u64) -> usize {
    let fit = open_files.saturating_sub(OWN_FILES) / FILES_PER_CONNECTION;
    wanted.min(usize::try_from(fit).unwrap_or(usize::MAX)).max(1)
}

/// Files that libraries make, the key-value store's too, are readable by their owner only, whatever the umask was.
#[cfg(target_os = "linux")]
fn keep_files_private() {
    rustix::process::umask(rustix::fs::Mode::RWXG | rustix::fs::Mode::RWXO);
}

/// Left to the umask; the data directory itself is private.
#[cfg(not(target_os = "linux"))]
fn keep_files_private() {}

/// Raises the soft limit of open files to the hard one; returns the limit in force, `None` where there is none or the
/// system does not say.
#[cfg(target_os = "linux")]
fn raise_open_files() -> Option<u64> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    if limit.current == limit.maximum {
        return limit.current;
    }
    let raised = Rlimit {
        current: limit.maximum,
        maximum: limit.maximum,
    };
    match setrlimit(Resource::Nofile, raised) {
        Ok(()) => limit.maximum,
        Err(error) => {
            tracing::warn!(%error, "the limit of open files was not raised");
            limit.current
        }
    }
}

/// Not known elsewhere.
#[cfg(not(target_os = "linux"))]
fn raise_open_files() -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_fit_the_files_that_may_be_open() {
        assert_eq!(fitting(1024, 1 << 20), 1024);
        assert_eq!(fitting(1024, 1024), 448);
        assert_eq!(fitting(1024, 100), 1);
    }
}
