//! The audit log: who changed what, when, and how it ended. One JSON object per line in `audit.log` of the data
//! directory; no secret is ever in it.

use super::caller::Caller;
use jiff::Timestamp;
use serde::Serialize;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The file's name in the data directory; the one before it has `.1` at its end.
pub const FILE: &str = "audit.log";
/// A file of this length makes place for a new one, in bytes.
const MAX_BYTES: u64 = 64 << 20;

/// The open log.
pub struct Audit {
    path: PathBuf,
    max_bytes: u64,
    /// `None` where it could not be opened yet.
    file: Mutex<Option<Open>>,
}

struct Open {
    file: File,
    length: u64,
}

/// Which request an entry is about.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Its id.
    pub id: &'a str,
    /// Its operation.
    pub operation: &'a str,
    /// Its address.
    pub path: &'a str,
}

/// One request that changed something, or was kept from it.
#[derive(Serialize)]
pub struct Entry<'a> {
    /// When it was answered.
    pub at: Timestamp,
    /// Its id, as in the response and the service's log.
    pub request_id: &'a str,
    /// The key's name, or `anonymous`.
    pub who: &'a str,
    /// The key's id.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// The operation, as `openapi.yaml` names it.
    pub operation: &'a str,
    /// What it was about.
    pub path: &'a str,
    /// The response's status.
    pub status: u16,
    /// `done`, or the problem's code.
    pub outcome: &'a str,
}

impl<'a> Entry<'a> {
    /// An entry of now.
    pub fn new(request: &Request<'a>, caller: &'a Caller, status: u16, outcome: &'a str) -> Self {
        Self {
            at: Timestamp::now(),
            request_id: request.id,
            who: caller.name(),
            key: caller.key.as_ref().map(|key| key.id.to_string()),
            operation: request.operation,
            path: request.path,
            status,
            outcome,
        }
    }
}

impl Audit {
    /// Opens the log of a data directory for appending.
    ///
    /// # Errors
    /// A failure of the file system.
    pub fn open(data: &Path) -> std::io::Result<Self> {
        Self::with_limit(data, MAX_BYTES)
    }

    /// A log that is opened at its first entry.
    pub fn later(data: &Path) -> Self {
        Self {
            path: data.join(FILE),
            max_bytes: MAX_BYTES,
            file: Mutex::new(None),
        }
    }

    fn with_limit(data: &Path, max_bytes: u64) -> std::io::Result<Self> {
        let path = data.join(FILE);
        let file = Mutex::new(Some(Open::at(&path)?));
        Ok(Self {
            path,
            max_bytes,
            file,
        })
    }

    /// Writes an entry. A log that cannot be written stops no request; the service's log says so.
    pub fn write(&self, entry: &Entry<'_>) {
        let written = serde_json::to_vec(entry)
            .map_err(std::io::Error::other)
            .and_then(|line| self.append(line));
        if let Err(error) = written {
            tracing::error!(%error, operation = entry.operation, request_id = entry.request_id, "an audit entry was lost");
        }
    }

    fn append(&self, mut line: Vec<u8>) -> std::io::Result<()> {
        line.push(b'\n');
        let mut place = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let mut open = match place.take() {
            Some(open) => open,
            None => Open::at(&self.path)?,
        };
        if open.length > 0 && open.length + line.len() as u64 > self.max_bytes {
            std::fs::rename(&self.path, self.path.with_extension("log.1"))?;
            open = Open::at(&self.path)?;
        }
        open.file.write_all(&line)?;
        open.length += line.len() as u64;
        *place = Some(open);
        Ok(())
    }
}

impl Open {
    fn at(path: &Path) -> std::io::Result<Self> {
        let mut options = OpenOptions::new();
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let file = options.create(true).append(true).open(path)?;
        let length = file.metadata()?.len();
        Ok(Self { file, length })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_lines_and_a_full_file_makes_place() {
        let directory = tempfile::tempdir().unwrap();
        let audit = Audit::with_limit(directory.path(), 400).unwrap();
        let caller = Caller::default();
        for i in 0..4 {
            let id = format!("r{i}");
            let request = Request {
                id: &id,
                operation: "create_class",
                path: "/v1/classes",
            };
            audit.write(&Entry::new(&request, &caller, 201, "done"));
        }
        let read = |name: &str| std::fs::read_to_string(directory.path().join(name)).unwrap();
        let (old, new) = (read("audit.log.1"), read("audit.log"));
        assert!(new.len() <= 400 && old.len() <= 400);
        let lines: Vec<serde_json::Value> = old
            .lines()
            .chain(new.lines())
            .map(|l| serde_json::from_str(l).unwrap())
            .collect();
        assert_eq!(lines.last().unwrap()["request_id"], "r3");
        assert_eq!(lines[0]["who"], "anonymous");
    }
}
