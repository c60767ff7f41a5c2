//! Zip, tar and tar.gz uploads → their files, in memory and within limits.
//!
//! Nothing is ever written to disk under a name from an archive. Limits hold for what comes out while it comes out, so
//! a declared size is never believed, and memory is reserved for it as it does.

use super::archive_path::{is_clutter, safe_path};
use super::arriving::Arriving;
use super::problem::{Code, Problem};
use shapelex_core::cancel::Cancel;
use shapelex_core::memory::{MemoryBudget, MemoryError, Reservation};
use std::cell::Cell;
use std::io::{Cursor, Read};

/// What an archive may hold at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArchiveLimits {
    /// Files and folders together.
    pub max_members: usize,
    /// Bytes of all files, unpacked.
    pub max_bytes: usize,
}

/// A file that came out of an archive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its path inside the archive, with forward slashes.
    pub path: String,
    /// Its contents.
    pub bytes: Vec<u8>,
}

/// An archive format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArchiveKind {
    /// Zip.
    Zip,
    /// Tar, POSIX or GNU.
    Tar,
    /// Gzip, with a tar inside.
    TarGz,
}

/// Which archive these bytes are, if any, by their magic numbers.
pub fn detect(bytes: &[u8]) -> Option<ArchiveKind> {
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06") {
        Some(ArchiveKind::Zip)
    } else if bytes.starts_with(&[0x1f, 0x8b]) {
        Some(ArchiveKind::TarGz)
    } else if bytes.get(257..262) == Some(b"ustar") {
        Some(ArchiveKind::Tar)
    } else {
        None
    }
}

/// What an archive is unpacked within.
#[derive(Clone, Copy, Debug)]
pub struct Unpacking<'a> {
    /// Set when the files are no longer wanted.
    pub cancel: &'a Cancel,
    /// The memory of the request the archive came with; its files count as a part of the body.
    pub memory: &'a Reservation,
}

/// The regular files of an archive, in its order. Folders, links, hidden files and the resource forks macOS adds are
/// left out.
///
/// # Errors
/// `invalid_archive`, `unsafe_archive_path`, `nested_archive`, `too_many_files` and `archive_too_large`.
pub fn unpack(kind: ArchiveKind, bytes: &[u8], limits: &ArchiveLimits) -> Result<Vec<Member>, Problem> {
    let unpacking = Unpacking {
        cancel: &Cancel::new(),
        memory: &MemoryBudget::unlimited().reservation(),
    };
    unpack_within(kind, bytes, &mut limits.clone(), &unpacking)
}

/// As [`unpack`], within the memory of a request and until it is stopped. Takes off the limits what the archive had, files
/// that are passed over included: they cost their unpacking too.
///
/// # Errors
/// Those of [`unpack`]; `archive_too_large` where the files never fit the memory, `overloaded` where they do not at the
/// moment; `cancelled`.
pub fn unpack_within(
    kind: ArchiveKind,
    bytes: &[u8],
    limits: &mut ArchiveLimits,
    unpacking: &Unpacking<'_>,
) -> Result<Vec<Member>, Problem> {
    let mut collected = Collector::new(limits, unpacking);
    match kind {
        ArchiveKind::Zip => unpack_zip(bytes, &mut collected)?,
        ArchiveKind::Tar => unpack_tar(Cursor::new(bytes), &mut collected)?,
        ArchiveKind::TarGz => {
            // Headers, padding and folders come out of the gzip too, so its own ceiling lies above that of the files.
            let ceiling = limits
                .max_bytes
                .saturating_add(limits.max_members.saturating_mul(2048));
            let inflated = flate2::read::MultiGzDecoder::new(bytes).take(ceiling as u64 + 1);
            unpack_tar(inflated, &mut collected)?;
        }
    }
    let (members, left) = (collected.members, collected.left);
    *limits = left;
    Ok(members)
}

fn unpack_zip(bytes: &[u8], collected: &mut Collector<'_>) -> Result<(), Problem> {
    let broken = |error: zip::result::ZipError| broken("zip", error);
    // The iterable reader parses one entry at a time: a directory of a million entries costs nothing before its
    // count is seen.
    let mut archive =
        zip::unstable::read::ZipIterable::try_new(Cursor::new(bytes), zip::read::Config::default())
            .map_err(broken)?;
    collected.check_count(archive.len())?;
    let mut files = archive
        .files_with_cloned_reader(zip::read::ZipReadOptions::new())
        .map_err(broken)?;
    while let Some(file) = files.next() {
        let file = file.map_err(broken)?;
        let path = file.name().map_err(broken)?.into_owned();
        if file.is_file() {
            let declared = file.size();
            collected.take(&path, declared, file)?;
        } else {
            collected.count()?;
        }
    }
    Ok(())
}

/// Bytes one member of a tar may have before its contents: its header, and names and attributes too long for that.
const MAX_TAR_HEADERS: u64 = 1 << 20;

/// Reads no more than it has been given; the rest of the archive is there for the next who gives.
struct Rationed<'a, R> {
    reader: R,
    left: &'a Cell<u64>,
    cancel: &'a Cancel,
}

impl<R: Read> Read for Rationed<'_, R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        // Most reads are of a few KiB; the contents of a member that is passed over are read here and nowhere else.
        self.cancel.check().map_err(std::io::Error::other)?;
        let most = usize::try_from(self.left.get())
            .unwrap_or(usize::MAX)
            .min(into.len());
        if most == 0 && !into.is_empty() {
            return Err(std::io::Error::other(format!(
                "a member has more than {MAX_TAR_HEADERS} bytes of names and attributes"
            )));
        }
        let read = self.reader.read(&mut into[..most])?;
        self.left.set(self.left.get() - read as u64);
        Ok(read)
    }
}

fn unpack_tar(reader: impl Read, collected: &mut Collector<'_>) -> Result<(), Problem> {
    let left = Cell::new(MAX_TAR_HEADERS);
    let cancel = collected.unpacking.cancel;
    let broken = |error: std::io::Error| match cancel.check() {
        Ok(()) => broken("tar", error),
        Err(stopped) => Problem::new(Code::Cancelled, stopped.to_string()),
    };
    let mut archive = tar::Archive::new(Rationed {
        reader,
        left: &left,
        cancel,
    });
    for entry in archive.entries().map_err(broken)? {
        let mut entry = entry.map_err(broken)?;
        // The contents have limits of their own.
        left.set(u64::MAX);
        if entry.header().entry_type().is_file() {
            let path = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
            let declared = entry.size();
            collected.take(&path, declared, &mut entry)?;
        } else {
            collected.count()?;
        }
        // What was not taken is passed over here, since the next entry would do so at the expense of its own headers.
        let passed = std::io::copy(&mut entry, &mut std::io::sink()).map_err(broken)?;
        collected.pass(passed)?;
        left.set(MAX_TAR_HEADERS);
    }
    left.set(u64::MAX);
    // The entries end before the stream does; what follows may be where a compressed one turns out to be cut short.
    let passed = std::io::copy(&mut archive.into_inner(), &mut std::io::sink()).map_err(broken)?;
    collected.pass(passed)
}

fn broken(kind: &str, error: impl std::fmt::Display) -> Problem {
    Problem::new(
        Code::InvalidArchive,
        format!("not a readable {kind} archive: {error}"),
    )
}

/// Bytes that are unpacked between two looks at the stop flag.
const PIECE: usize = 64 << 10;

/// The problem of files for which there is no memory: for good, or at the moment.
fn no_room(error: MemoryError) -> Problem {
    match error {
        MemoryError::NeverFits { limit, .. } => Problem::new(
            Code::ArchiveTooLarge,
            format!("the archive and its files do not fit the memory for bodies, {limit} bytes; send fewer at a time"),
        )
        .with("limit_bytes", limit),
        MemoryError::NotNow { .. } => error.into(),
    }
}

struct Collector<'a> {
    limits: ArchiveLimits,
    /// What is left of the limits.
    left: ArchiveLimits,
    unpacking: &'a Unpacking<'a>,
    piece: Vec<u8>,
    members: Vec<Member>,
}

impl<'a> Collector<'a> {
    fn new(limits: &ArchiveLimits, unpacking: &'a Unpacking<'a>) -> Self {
        Self {
            limits: *limits,
            left: *limits,
            unpacking,
            piece: vec![0; PIECE],
            members: Vec::new(),
        }
    }

    fn check_count(&self, found: usize) -> Result<(), Problem> {
        if found > self.limits.max_members {
            return Err(Problem::new(
                Code::TooManyFiles,
                format!(
                    "the archive has {found} or more members, the limit is {}",
                    self.limits.max_members
                ),
            )
            .with("limit_files", self.limits.max_members));
        }
        Ok(())
    }

    fn too_large(&self) -> Problem {
        Problem::new(
            Code::ArchiveTooLarge,
            format!("the archive unpacks to more than {} bytes", self.limits.max_bytes),
        )
        .with("limit_bytes", self.limits.max_bytes)
    }

    fn count(&mut self) -> Result<(), Problem> {
        match self.left.max_members.checked_sub(1) {
            Some(left) => self.left.max_members = left,
            None => self.check_count(self.limits.max_members + 1)?,
        }
        Ok(())
    }

    /// Counts bytes that were unpacked and not taken.
    fn pass(&mut self, bytes: u64) -> Result<(), Problem> {
        let left = (self.left.max_bytes as u64).checked_sub(bytes);
        let left = left.and_then(|left| usize::try_from(left).ok());
        self.left.max_bytes = left.ok_or_else(|| self.too_large())?;
        Ok(())
    }

    /// Adds a file. Its declared size can refuse it before anything is unpacked, but never let it in.
    fn take(&mut self, path: &str, declared: u64, mut reader: impl Read) -> Result<(), Problem> {
        self.count()?;
        let path = safe_path(path)?;
        if is_clutter(&path) {
            return Ok(());
        }
        let left = self.left.max_bytes;
        if declared > left as u64 {
            return Err(self.too_large());
        }
        let path_bytes = (path.len() + size_of::<Member>()) as u64;
        self.unpacking.memory.grow_body(path_bytes).map_err(no_room)?;
        let mut contents = Arriving::new(left, self.unpacking.memory);
        loop {
            self.unpacking
                .cancel
                .check()
                .map_err(|stopped| Problem::new(Code::Cancelled, stopped.to_string()))?;
            let read = reader
                .read(&mut self.piece)
                .map_err(|e| broken("archive", format!("{path}: {e}")))?;
            if read == 0 {
                break;
            }
            if contents.len() + read > left {
                return Err(self.too_large());
            }
            contents.push(&self.piece[..read]).map_err(no_room)?;
        }
        let bytes = contents.finish();
        if detect(&bytes).is_some() {
            return Err(Problem::new(
                Code::NestedArchive,
                format!("'{path}' is an archive inside the archive; send it by itself"),
            )
            .with("member", path));
        }
        self.left.max_bytes -= bytes.len();
        self.members.push(Member { path, bytes });
        Ok(())
    }
}

#[cfg(test)]
mod tests;
