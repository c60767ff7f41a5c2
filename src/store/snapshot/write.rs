//! Making a snapshot.

use super::super::entry::get;
use super::super::layout::ORIGINALS;
use super::super::payload::Number;
use super::super::{Store, StoreError, files, keys, migrate};
use super::manifest::{ARRANGEMENT, CHECKSUM, MANIFEST, Manifest, Member, RECORDS};
use crate::model::{ContentHash, Generation, Snapshot, SnapshotId, SnapshotOrigin};
use jiff::Timestamp;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;

/// Records read per scan.
const CHUNK: usize = 256;
/// zstd's own default: meshes as text come out at about a third, at some hundred megabytes per second.
const LEVEL: i32 = 3;

/// The records of one moment, in a file, and what they refer to.
struct Dump {
    file: tempfile::NamedTempFile,
    member: Member,
    contents: BTreeSet<ContentHash>,
    classes: u64,
    shapes: u64,
    generation: Option<u64>,
}

impl Store {
    /// Makes a snapshot of this moment. The catalogue waits while the records are copied, which takes milliseconds
    /// for thousands of shapes; everything else goes on while the files are packed.
    ///
    /// # Errors
    /// [`StoreError::SnapshotRunning`] where another is being made or restored; [`StoreError::Full`];
    /// [`StoreError::ReadOnly`]; [`StoreError::Damaged`]; a failure of the file system. Nothing is left behind then.
    pub fn create_snapshot(&self, origin: SnapshotOrigin) -> Result<Snapshot, StoreError> {
        let _alone = self.one_at_a_time()?;
        self.inner.writable()?;
        let directory = self.snapshot_directory();
        files::create_directory(&directory)
            .map_err(|e| StoreError::io(format!("make {}", directory.display()), &e))?;
        files::sync_directory(self.path())?;
        let _files_stay = self.pin();
        let created_at = Timestamp::now();
        let dump = self.dump_records(&directory)?;
        let (present, missing) = self.take_stock(&dump.contents)?;
        let manifest = Manifest {
            arrangement: ARRANGEMENT,
            shapelex: env!("CARGO_PKG_VERSION").to_owned(),
            id: SnapshotId::new(),
            origin,
            created_at,
            data_format: migrate::FORMAT,
            classes: dump.classes,
            shapes: dump.shapes,
            generation: dump.generation,
            records: dump.member.clone(),
            originals: present,
            missing,
        };
        let (bytes, hash) = self.pack(&directory, &manifest, dump.file.path())?;
        let snapshot = manifest.describe(bytes, hash);
        write_note(&self.snapshot_note(snapshot.id), &snapshot).inspect_err(|_| {
            // What is not described is not there, and the next start removes it.
            let _ = files::remove(&self.snapshot_path(snapshot.id));
        })?;
        Ok(snapshot)
    }

    /// Copies the records of one moment. Holding the writer keeps catalogue and generation as they are, and with the
    /// generation the dictionaries it names.
    fn dump_records(&self, directory: &Path) -> Result<Dump, StoreError> {
        let fail = |e: std::io::Error| {
            StoreError::io(
                format!("copy the records for a snapshot into {}", directory.display()),
                &e,
            )
        };
        let backend = &*self.inner.backend;
        let file = tempfile::Builder::new()
            .prefix(".writing-")
            .tempfile_in(directory)
            .map_err(fail)?;
        let mut out = Counted::new(BufWriter::new(file.as_file()));
        let _writer = self.inner.writer();
        let generation: Option<Number> = get(backend, keys::META_GENERATION)?;
        let record: Option<Generation> = match generation {
            Some(Number(number)) => get(backend, &keys::generation(number))?,
            None => None,
        };
        let dictionaries: BTreeSet<Vec<u8>> = record
            .iter()
            .flat_map(Generation::dictionary_keys)
            .map(keys::dictionary)
            .collect();
        let current = generation.map(|Number(number)| keys::generation(number));
        let (mut contents, mut classes, mut shapes) = (BTreeSet::new(), 0, 0);
        let mut after: Option<Vec<u8>> = None;
        loop {
            let entries = backend.scan(b"", after.as_deref(), CHUNK)?;
            let Some((last, _)) = entries.last() else { break };
            after = Some(last.clone());
            for (key, value) in entries {
                let stays = if key.starts_with(keys::JOB) || key.starts_with(keys::QUEUE) {
                    false
                } else if key.starts_with(keys::DICTIONARY) {
                    dictionaries.contains(&key)
                } else if key.starts_with(keys::GENERATION) {
                    current.as_ref() == Some(&key)
                } else {
                    true
                };
                if !stays {
                    continue;
                }
                classes += u64::from(key.starts_with(keys::CLASS));
                shapes += u64::from(key.starts_with(keys::SHAPE));
                if let Some(content) = keys::content_of_reference(&key) {
                    contents.insert(content);
                }
                write_record(&mut out, &key, &value).map_err(fail)?;
            }
        }
        let member = out.finish().map_err(fail)?;
        Ok(Dump {
            file,
            member,
            contents,
            classes,
            shapes,
            generation: record.map(|g| g.number),
        })
    }

    /// Reads every file once: those that are what they are named after, and those that are not or are gone.
    fn take_stock(
        &self,
        contents: &BTreeSet<ContentHash>,
    ) -> Result<(Vec<Member>, Vec<ContentHash>), StoreError> {
        let (mut present, mut missing) = (Vec::new(), Vec::new());
        for content in contents {
            match self.open_original(*content) {
                Ok(checked) => present.push(Member {
                    hash: *content,
                    bytes: checked.length,
                }),
                Err(StoreError::Original { .. }) => missing.push(*content),
                Err(other) => return Err(other),
            }
        }
        if !missing.is_empty() {
            tracing::warn!(
                files = missing.len(),
                "a snapshot is made without files that are gone or damaged"
            );
        }
        Ok((present, missing))
    }

    /// Writes the archive and puts it in place. Returns its length and hash.
    fn pack(
        &self,
        directory: &Path,
        manifest: &Manifest,
        records: &Path,
    ) -> Result<(u64, ContentHash), StoreError> {
        let fail =
            |e: std::io::Error| StoreError::io(format!("write a snapshot into {}", directory.display()), &e);
        let file = tempfile::Builder::new()
            .prefix(".writing-")
            .tempfile_in(directory)
            .map_err(fail)?;
        let mut encoder =
            zstd::Encoder::new(Counted::new(BufWriter::new(file.as_file())), LEVEL).map_err(fail)?;
        encoder.include_checksum(true).map_err(fail)?;
        let mut archive = tar::Builder::new(encoder);
        let text = serde_json::to_vec(manifest).map_err(|e| encoding(&e))?;
        append(&mut archive, MANIFEST, text.len() as u64, &text[..]).map_err(fail)?;
        let checksum = ContentHash::of(&text).to_string();
        append(&mut archive, CHECKSUM, checksum.len() as u64, checksum.as_bytes()).map_err(fail)?;
        let dump = File::open(records).map_err(fail)?;
        append(
            &mut archive,
            RECORDS,
            manifest.records.bytes,
            BufReader::new(dump),
        )
        .map_err(fail)?;
        for member in &manifest.originals {
            let file = File::open(self.original_path(member.hash)).map_err(fail)?;
            let mut reader = Hashing::new(BufReader::new(file));
            let name = format!("{}/{}", ORIGINALS, member.hash);
            append(
                &mut archive,
                &name,
                member.bytes,
                (&mut reader).take(member.bytes),
            )
            .map_err(fail)?;
            if reader.hash() != member.hash {
                return Err(StoreError::damaged(
                    format!("original {}", member.hash),
                    "it changed while a snapshot was made",
                ));
            }
        }
        let counted = archive
            .into_inner()
            .and_then(zstd::Encoder::finish)
            .map_err(fail)?;
        let Member { hash, bytes } = counted.finish().map_err(fail)?;
        file.as_file().sync_all().map_err(fail)?;
        file.persist(self.snapshot_path(manifest.id))
            .map_err(|e| fail(e.error))?;
        files::sync_directory(directory)?;
        Ok((bytes, hash))
    }
}

/// Writes a snapshot's description, after its file: what is not described is not there.
pub(super) fn write_note(path: &Path, snapshot: &Snapshot) -> Result<(), StoreError> {
    let note = serde_json::to_vec_pretty(snapshot).map_err(|e| encoding(&e))?;
    files::write_durably(path, &note)
}

fn encoding(error: &serde_json::Error) -> StoreError {
    StoreError::Io {
        what: "describe a snapshot".to_owned(),
        detail: error.to_string(),
    }
}

fn write_record(out: &mut impl Write, key: &[u8], value: &[u8]) -> std::io::Result<()> {
    let length = |part: &[u8]| u32::try_from(part.len()).map_err(std::io::Error::other);
    out.write_all(&length(key)?.to_le_bytes())?;
    out.write_all(&length(value)?.to_le_bytes())?;
    out.write_all(key)?;
    out.write_all(value)
}

fn append(
    archive: &mut tar::Builder<impl Write>,
    name: &str,
    bytes: u64,
    contents: impl Read,
) -> std::io::Result<()> {
    let mut header = tar::Header::new_ustar();
    header.set_size(bytes);
    header.set_mode(0o644);
    header.set_mtime(0);
    archive.append_data(&mut header, name, contents)
}

/// Counts and hashes what is written through it.
struct Counted<W> {
    inner: W,
    hasher: blake3::Hasher,
    bytes: u64,
}

impl<W: Write> Counted<W> {
    fn new(inner: W) -> Self {
        Self {
            inner,
            hasher: blake3::Hasher::new(),
            bytes: 0,
        }
    }

    fn finish(mut self) -> std::io::Result<Member> {
        self.inner.flush()?;
        Ok(Member {
            hash: ContentHash::from_bytes(*self.hasher.finalize().as_bytes()),
            bytes: self.bytes,
        })
    }
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, buffer: &[u8]) -> std::io::Result<usize> {
        let written = self.inner.write(buffer)?;
        self.hasher.update(&buffer[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}

/// Hashes what is read through it.
pub(super) struct Hashing<R> {
    inner: R,
    hasher: blake3::Hasher,
}

impl<R: Read> Hashing<R> {
    pub fn new(inner: R) -> Self {
        Self {
            inner,
            hasher: blake3::Hasher::new(),
        }
    }

    pub fn hash(&self) -> ContentHash {
        ContentHash::from_bytes(*self.hasher.finalize().as_bytes())
    }
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let read = self.inner.read(buffer)?;
        self.hasher.update(&buffer[..read]);
        Ok(read)
    }
}
