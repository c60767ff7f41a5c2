//! A snapshot's file → a data directory beside the one in use, everything checked on the way.
//!
//! The manifest says what follows. A member of another name, kind, length or contents than it says ends the reading,
//! so no path, link or bomb of somebody else's making reaches the disk.

use super::super::backend::{Backend, Batch, Entry};
use super::super::failure::Failure;
use super::super::layout::{ORIGINALS, RECORDS as ENGINE};
use super::super::sled_backend::SledBackend;
use super::super::{StoreError, StoreOptions, files, record};
use super::manifest::{CHECKSUM, MANIFEST, MAX_BYTES, Manifest, Member, RECORDS};
use super::write::Hashing;
use crate::model::{ContentHash, Snapshot};
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// Most memory the decoder takes for looking back: zstd's own limit, 128 MiB.
const WINDOW_LOG: u32 = 27;
/// Records written per batch, in bytes.
const BATCH_BYTES: usize = 4 << 20;
/// Longest key.
const MAX_KEY: usize = 4 << 10;
/// Longest record: a thousand times the default dictionary.
const MAX_RECORD: usize = 256 << 20;

type Entries<'a, R> = tar::Entries<'a, R>;

fn bad(error: &std::io::Error) -> StoreError {
    match error.kind() {
        // The reader's own failures, as of a client that goes away, look the same as damage in the file.
        std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
            StoreError::io("unpack a snapshot", error)
        }
        _ => StoreError::bad_snapshot(error.to_string()),
    }
}

/// Unpacks a snapshot into an empty directory, which holds `originals` and `sled` then. At most `limit` bytes.
pub(super) fn unpack(
    archive: impl Read,
    into: &Path,
    limit: u64,
    options: &StoreOptions,
) -> Result<Manifest, StoreError> {
    let mut decoder = zstd::Decoder::new(archive).map_err(|e| bad(&e))?;
    decoder.window_log_max(WINDOW_LOG).map_err(|e| bad(&e))?;
    let mut archive = tar::Archive::new(decoder);
    // Members as they are: no name of ours is long enough to come in a member before its own, which would be taken into
    // memory whatever its length.
    let mut entries = archive.entries().map_err(|e| bad(&e))?.raw(true);
    let manifest = read_manifest(&mut entries)?;
    if manifest.unpacked_bytes() > limit {
        return Err(StoreError::bad_snapshot(format!(
            "it unpacks to {} bytes, the limit is {limit}",
            manifest.unpacked_bytes()
        )));
    }
    let records = into.join(RECORDS);
    let mut entry = next(&mut entries, RECORDS, Some(manifest.records.bytes))?;
    save(&mut entry, &records, &manifest.records)?;
    let directory = into.join(ORIGINALS);
    make(&directory)?;
    for member in &manifest.originals {
        let name = member.hash.to_string();
        let path = format!("{}/{name}", ORIGINALS);
        let mut entry = next(&mut entries, &path, Some(member.bytes))?;
        let folder = directory.join(&name[..2]);
        make(&folder)?;
        save(&mut entry, &folder.join(&name), member)?;
    }
    if entries.next().is_some() {
        return Err(StoreError::bad_snapshot(
            "there is more in it than its manifest lists",
        ));
    }
    // To the end, where zstd's own checksum is; what is left are tar's closing zeros.
    let left = std::io::copy(&mut archive.into_inner().take(1 << 20), &mut std::io::sink());
    if left.map_err(|e| bad(&e))? >= 1 << 20 {
        return Err(StoreError::bad_snapshot("something follows its end"));
    }
    sync_folders(&directory)?;
    load(&records, &into.join(ENGINE), options)?;
    files::remove(&records)?;
    Ok(manifest)
}

/// Describes a snapshot's file from what is in it.
pub(super) fn describe(file: &Path) -> Result<Snapshot, StoreError> {
    let fail = |e: std::io::Error| StoreError::io(format!("read {}", file.display()), &e);
    let mut decoder = zstd::Decoder::new(File::open(file).map_err(fail)?).map_err(|e| bad(&e))?;
    decoder.window_log_max(WINDOW_LOG).map_err(|e| bad(&e))?;
    let mut archive = tar::Archive::new(decoder);
    let manifest = read_manifest(&mut archive.entries().map_err(|e| bad(&e))?.raw(true))?;
    let mut whole = Hashing::new(BufReader::new(File::open(file).map_err(fail)?));
    let bytes = std::io::copy(&mut whole, &mut std::io::sink()).map_err(fail)?;
    Ok(manifest.describe(bytes, whole.hash()))
}

fn read_manifest<R: Read>(entries: &mut Entries<'_, R>) -> Result<Manifest, StoreError> {
    let mut text = Vec::new();
    let entry = next(entries, MANIFEST, None)?;
    if entry.size() > MAX_BYTES {
        return Err(StoreError::bad_snapshot("its manifest is too long"));
    }
    entry
        .take(MAX_BYTES)
        .read_to_end(&mut text)
        .map_err(|e| bad(&e))?;
    let mut checksum = String::new();
    let entry = next(entries, CHECKSUM, Some(64))?;
    entry
        .take(64)
        .read_to_string(&mut checksum)
        .map_err(|e| bad(&e))?;
    if checksum != ContentHash::of(&text).to_string() {
        return Err(StoreError::bad_snapshot(
            "its manifest does not have the checksum it should",
        ));
    }
    Manifest::parse(&text)
}

/// The next member, which must be a plain file of this name and length.
fn next<'a, R: Read>(
    entries: &mut Entries<'a, R>,
    name: &str,
    bytes: Option<u64>,
) -> Result<tar::Entry<'a, R>, StoreError> {
    let entry = match entries.next() {
        Some(entry) => entry.map_err(|e| bad(&e))?,
        None => return Err(StoreError::bad_snapshot(format!("it ends before '{name}'"))),
    };
    let found = entry.path_bytes();
    if *found != *name.as_bytes() {
        return Err(StoreError::bad_snapshot(format!(
            "it holds '{}' where '{name}' belongs",
            String::from_utf8_lossy(&found)
                .chars()
                .take(200)
                .collect::<String>()
        )));
    }
    if entry.header().entry_type() != tar::EntryType::Regular {
        return Err(StoreError::bad_snapshot(format!(
            "'{name}' is no plain file in it"
        )));
    }
    if bytes.is_some_and(|bytes| entry.size() != bytes) {
        return Err(StoreError::bad_snapshot(format!(
            "'{name}' has {} bytes in it, not those its manifest says",
            entry.size()
        )));
    }
    Ok(entry)
}

/// Writes a member to the disk and checks its contents.
fn save(entry: &mut impl Read, path: &Path, member: &Member) -> Result<(), StoreError> {
    let fail = |e: std::io::Error| StoreError::io(format!("write {}", path.display()), &e);
    let mut file = BufWriter::new(
        files::options()
            .write(true)
            .create(true)
            .truncate(true)
            .open(path)
            .map_err(fail)?,
    );
    let mut reader = Hashing::new(entry);
    let mut buffer = vec![0_u8; 128 << 10];
    let mut written = 0_u64;
    loop {
        let read = reader.read(&mut buffer).map_err(|e| bad(&e))?;
        if read == 0 {
            break;
        }
        written += read as u64;
        file.write_all(&buffer[..read]).map_err(fail)?;
    }
    if written != member.bytes || reader.hash() != member.hash {
        return Err(StoreError::bad_snapshot(format!(
            "'{}' is not what its manifest says",
            path.file_name().unwrap_or_default().to_string_lossy()
        )));
    }
    let file = file.into_inner().map_err(|e| fail(e.into_error()))?;
    file.sync_all().map_err(fail)
}

fn make(directory: &Path) -> Result<(), StoreError> {
    files::create_directory(directory)
        .map_err(|e| StoreError::io(format!("make {}", directory.display()), &e))
}

fn sync_folders(directory: &Path) -> Result<(), StoreError> {
    for folder in super::list(directory)? {
        files::sync_directory(&folder)?;
    }
    files::sync_directory(directory)
}

/// Puts the copied records into an engine of their own, each checked.
fn load(records: &Path, sled: &Path, options: &StoreOptions) -> Result<(), StoreError> {
    let fail = |e: std::io::Error| StoreError::io("read the records of a snapshot", &e);
    let backend = SledBackend::open(sled, options.cache_bytes, Arc::new(Failure::none(sled)))?;
    let mut reader = BufReader::new(File::open(records).map_err(fail)?);
    let (mut batch, mut bytes) = (Batch::default(), 0);
    while let Some((key, value)) = read_record(&mut reader)? {
        record::check(&key, &value).map_err(|e| StoreError::bad_snapshot(e.to_string()))?;
        bytes += key.len() + value.len();
        batch.put(key, value);
        if bytes > BATCH_BYTES {
            backend.apply(&std::mem::take(&mut batch))?;
            bytes = 0;
        }
    }
    backend.apply(&batch)?;
    backend.flush()
}

fn read_record(reader: &mut impl Read) -> Result<Option<Entry>, StoreError> {
    let cut = |_| StoreError::bad_snapshot("its records are cut short");
    let mut lengths = [0_u8; 8];
    let mut filled = 0;
    while filled < lengths.len() {
        match reader.read(&mut lengths[filled..]).map_err(cut)? {
            0 if filled == 0 => return Ok(None),
            0 => return Err(StoreError::bad_snapshot("its records are cut short")),
            read => filled += read,
        }
    }
    let [a, b, c, d, e, f, g, h] = lengths;
    let key = u32::from_le_bytes([a, b, c, d]) as usize;
    let value = u32::from_le_bytes([e, f, g, h]) as usize;
    if key > MAX_KEY || value > MAX_RECORD {
        return Err(StoreError::bad_snapshot("a record in it is too long"));
    }
    let mut take = |length: usize| -> Result<Vec<u8>, StoreError> {
        let mut bytes = Vec::new();
        // Grows with what is there, so that a length alone takes no memory.
        reader.take(length as u64).read_to_end(&mut bytes).map_err(cut)?;
        if bytes.len() == length {
            Ok(bytes)
        } else {
            Err(StoreError::bad_snapshot("its records are cut short"))
        }
    };
    Ok(Some((take(key)?, take(value)?)))
}
