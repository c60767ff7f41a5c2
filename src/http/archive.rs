//! Zip, tar and tar.gz uploads → their files, in memory and within limits.
//!
//! Nothing is ever written to disk under a name from an archive. Limits hold for what comes out while it comes out, so
//! a declared size is never believed.

use super::problem::{Code, Problem};
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

/// The regular files of an archive, in its order. Folders, links, hidden files and the resource forks macOS adds are
/// left out.
///
/// # Errors
/// `invalid_archive`, `unsafe_archive_path`, `nested_archive`, `too_many_files` and `archive_too_large`.
pub fn unpack(kind: ArchiveKind, bytes: &[u8], limits: &ArchiveLimits) -> Result<Vec<Member>, Problem> {
    match kind {
        ArchiveKind::Zip => unpack_zip(bytes, limits),
        ArchiveKind::Tar => unpack_tar(Cursor::new(bytes), limits),
        ArchiveKind::TarGz => {
            // Headers, padding and folders come out of the gzip too, so its own ceiling lies above that of the files.
            let ceiling = limits
                .max_bytes
                .saturating_add(limits.max_members.saturating_mul(2048));
            let inflated = flate2::read::MultiGzDecoder::new(bytes).take(ceiling as u64 + 1);
            unpack_tar(inflated, limits)
        }
    }
}

fn unpack_zip(bytes: &[u8], limits: &ArchiveLimits) -> Result<Vec<Member>, Problem> {
    let broken = |error: zip::result::ZipError| broken("zip", error);
    // The iterable reader parses one entry at a time: a directory of a million entries costs nothing before its
    // count is seen.
    let mut archive =
        zip::unstable::read::ZipIterable::try_new(Cursor::new(bytes), zip::read::Config::default())
            .map_err(broken)?;
    let mut collected = Collector::new(limits);
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
    Ok(collected.members)
}

/// Bytes one member of a tar may have before its contents: its header, and names and attributes too long for that.
const MAX_TAR_HEADERS: u64 = 1 << 20;

/// Reads no more than it has been given; the rest of the archive is there for the next who gives.
struct Rationed<'a, R> {
    reader: R,
    left: &'a Cell<u64>,
}

impl<R: Read> Read for Rationed<'_, R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
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

fn unpack_tar(reader: impl Read, limits: &ArchiveLimits) -> Result<Vec<Member>, Problem> {
    let left = Cell::new(MAX_TAR_HEADERS);
    let mut archive = tar::Archive::new(Rationed { reader, left: &left });
    let mut collected = Collector::new(limits);
    for entry in archive.entries().map_err(|e| broken("tar", e))? {
        let mut entry = entry.map_err(|e| broken("tar", e))?;
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
        std::io::copy(&mut entry, &mut std::io::sink()).map_err(|e| broken("tar", e))?;
        left.set(MAX_TAR_HEADERS);
    }
    left.set(u64::MAX);
    // The entries end before the stream does; what follows may be where a compressed one turns out to be cut short.
    std::io::copy(&mut archive.into_inner(), &mut std::io::sink()).map_err(|e| broken("tar", e))?;
    Ok(collected.members)
}

fn broken(kind: &str, error: impl std::fmt::Display) -> Problem {
    Problem::new(
        Code::InvalidArchive,
        format!("not a readable {kind} archive: {error}"),
    )
}

struct Collector<'a> {
    limits: &'a ArchiveLimits,
    members: Vec<Member>,
    seen: usize,
    bytes: usize,
}

impl<'a> Collector<'a> {
    fn new(limits: &'a ArchiveLimits) -> Self {
        Self {
            limits,
            members: Vec::new(),
            seen: 0,
            bytes: 0,
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
        self.seen += 1;
        self.check_count(self.seen)
    }

    /// Adds a file. Its declared size can refuse it before anything is unpacked, but never let it in.
    fn take(&mut self, path: &str, declared: u64, mut reader: impl Read) -> Result<(), Problem> {
        self.count()?;
        let path = safe_path(path)?;
        if is_clutter(&path) {
            return Ok(());
        }
        let left = self.limits.max_bytes - self.bytes;
        if declared > left as u64 {
            return Err(self.too_large());
        }
        // Room for what is promised, so that growing does not hold a file twice; pages nobody writes to cost nothing.
        let mut bytes = Vec::with_capacity(usize::try_from(declared).unwrap_or(0));
        reader
            .by_ref()
            .take(left as u64 + 1)
            .read_to_end(&mut bytes)
            .map_err(|e| broken("archive", format!("{path}: {e}")))?;
        if bytes.len() > left {
            return Err(self.too_large());
        }
        bytes.shrink_to_fit();
        if detect(&bytes).is_some() {
            return Err(Problem::new(
                Code::NestedArchive,
                format!("'{path}' is an archive inside the archive; send it by itself"),
            )
            .with("member", path));
        }
        self.bytes += bytes.len();
        self.members.push(Member { path, bytes });
        Ok(())
    }
}

/// Longest path of a member, in bytes; no file system takes a longer one.
const MAX_PATH: usize = 4096;

/// The path with forward slashes and without `.` parts. Absolute paths, drive letters, `..`, control characters and
/// endless names are refused: no honest archive of meshes has them.
fn safe_path(path: &str) -> Result<String, Problem> {
    let unsafe_path = || {
        Problem::new(
            Code::UnsafeArchivePath,
            format!(
                "'{}' is not a path inside the archive",
                path.chars().take(200).collect::<String>().escape_debug()
            ),
        )
    };
    if path.len() > MAX_PATH {
        return Err(unsafe_path());
    }
    let path = path.replace('\\', "/");
    let drive = path.as_bytes().get(1) == Some(&b':') && path.as_bytes()[0].is_ascii_alphabetic();
    if path.starts_with('/') || drive || path.chars().any(char::is_control) {
        return Err(unsafe_path());
    }
    let mut parts = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => return Err(unsafe_path()),
            other => parts.push(other),
        }
    }
    if parts.is_empty() {
        return Err(unsafe_path());
    }
    Ok(parts.join("/"))
}

fn is_clutter(path: &str) -> bool {
    path.split('/')
        .any(|part| part.starts_with('.') || part == "__MACOSX" || part == "Thumbs.db")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    const LIMITS: ArchiveLimits = ArchiveLimits {
        max_members: 3,
        max_bytes: 1000,
    };

    fn zip_of(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in files {
            writer
                .start_file(*name, zip::write::SimpleFileOptions::default())
                .unwrap();
            writer.write_all(bytes).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    fn tar_of(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut builder = tar::Builder::new(Vec::new());
        for (name, bytes) in files {
            let mut header = tar::Header::new_ustar();
            header.set_size(bytes.len() as u64);
            header.set_mode(0o644);
            // Written by hand: the builder itself refuses the unsafe names these tests need.
            header.as_old_mut().name[..name.len()].copy_from_slice(name.as_bytes());
            header.set_cksum();
            builder.append(&header, *bytes).unwrap();
        }
        builder.into_inner().unwrap()
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn open(bytes: &[u8]) -> Result<Vec<Member>, Code> {
        let kind = detect(bytes).expect("an archive");
        unpack(kind, bytes, &LIMITS).map_err(|p| p.code)
    }

    #[test]
    fn the_three_kinds_give_the_same_files() {
        let files: &[(&str, &[u8])] = &[
            ("a/one.off", b"OFF"),
            ("__MACOSX/._x", b"x"),
            ("./two.obj", b"v 0 0 0"),
        ];
        let expected = vec![
            Member {
                path: "a/one.off".into(),
                bytes: b"OFF".to_vec(),
            },
            Member {
                path: "two.obj".into(),
                bytes: b"v 0 0 0".to_vec(),
            },
        ];
        assert_eq!(open(&zip_of(files)), Ok(expected.clone()));
        assert_eq!(open(&tar_of(files)), Ok(expected.clone()));
        assert_eq!(open(&gzip(&tar_of(files))), Ok(expected));
    }

    #[test]
    fn hostile_archives_are_refused_by_name() {
        for path in [
            "../x.off",
            "/etc/x.off",
            "a/../../x.off",
            "C:/x.off",
            "a\\..\\..\\x.off",
        ] {
            assert_eq!(
                open(&tar_of(&[(path, b"OFF")])),
                Err(Code::UnsafeArchivePath),
                "{path}"
            );
            assert_eq!(
                open(&zip_of(&[(path, b"OFF")])),
                Err(Code::UnsafeArchivePath),
                "{path}"
            );
        }
        let inner = zip_of(&[("x.off", b"OFF")]);
        assert_eq!(open(&zip_of(&[("inner.zip", &inner)])), Err(Code::NestedArchive));
        let many: &[(&str, &[u8])] = &[("1", b""), ("2", b""), ("3", b""), ("4", b"")];
        assert_eq!(open(&zip_of(many)), Err(Code::TooManyFiles));
        assert_eq!(open(&tar_of(many)), Err(Code::TooManyFiles));
        let bomb = vec![0u8; 100_000];
        assert_eq!(open(&zip_of(&[("bomb.off", &bomb)])), Err(Code::ArchiveTooLarge));
        assert_eq!(
            open(&gzip(&tar_of(&[("bomb.off", &bomb)]))),
            Err(Code::ArchiveTooLarge)
        );
    }

    #[test]
    fn damaged_archives_are_refused_at_every_length() {
        let whole = zip_of(&[("a.off", b"OFF 1 2 3"), ("b.off", b"OFF 4 5 6")]);
        for length in 4..whole.len() {
            assert_eq!(
                open(&whole[..length]),
                Err(Code::InvalidArchive),
                "zip cut at {length}"
            );
        }
        let whole = gzip(&tar_of(&[("a.off", b"OFF 1 2 3")]));
        for length in 2..whole.len() {
            assert!(open(&whole[..length]).is_err(), "tar.gz cut at {length}");
        }
    }
}
