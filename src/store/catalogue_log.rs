//! The catalogue log: every event in order, one line each, beside the key-value store and independent of it.
//!
//! A line is the CRC-32 of its JSON text as eight hexadecimal digits, a space, and the JSON text
//! `{"sequence": …, "event": …}`. Lines are only ever appended, each followed by an fsync before the event is applied
//! to the records. What the records missed in a crash is replayed from here at the next start.

use super::event::Event;
use super::{StoreError, files};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct LineOut<'a> {
    sequence: u64,
    event: &'a Event,
}

#[derive(Deserialize)]
pub(super) struct LineIn {
    sequence: u64,
    event: Event,
}

/// What reading a log found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogScan {
    /// Events read.
    pub events: u64,
    /// The last event's number, 0 where there is none.
    pub last: u64,
    /// Lines that could not be read, with the reason; the numbers count from 1.
    pub damaged: Vec<(u64, String)>,
    /// Bytes up to the end of the last good line.
    pub good_length: u64,
    /// Whether something follows that.
    pub torn: bool,
}

/// Reads a log from the start and hands every event to `each`, with its number. A log that does not exist is empty.
///
/// # Errors
/// A failure of the file system, or whatever `each` returns.
pub fn read(
    path: &Path,
    mut each: impl FnMut(u64, Event) -> Result<(), StoreError>,
) -> Result<LogScan, StoreError> {
    let mut scan = LogScan::default();
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(scan),
        Err(error) => return Err(StoreError::io(format!("open {}", path.display()), &error)),
    };
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let (mut line, mut number, mut at) = (Vec::new(), 0, 0_u64);
    loop {
        line.clear();
        let length = reader
            .read_until(b'\n', &mut line)
            .map_err(|e| StoreError::io(format!("read {}", path.display()), &e))?;
        if length == 0 {
            break;
        }
        number += 1;
        at += length as u64;
        match parse(&line) {
            Ok(entry) => {
                scan.events += 1;
                scan.last = scan.last.max(entry.sequence);
                scan.good_length = at;
                each(entry.sequence, entry.event)?;
            }
            Err(detail) => scan.damaged.push((number, detail)),
        }
    }
    scan.torn = scan.good_length < at;
    // A bad last line is a write that was cut off, and was never acknowledged.
    if scan.torn && scan.damaged.last().is_some_and(|(n, _)| *n == number) {
        scan.damaged.pop();
    }
    Ok(scan)
}

pub(super) fn parse(line: &[u8]) -> Result<LineIn, String> {
    let line = line.strip_suffix(b"\n").ok_or("the line has no end")?;
    let (crc, rest) = line.split_at_checked(9).ok_or("the line is too short")?;
    let crc = std::str::from_utf8(&crc[..8])
        .ok()
        .and_then(|text| u32::from_str_radix(text, 16).ok())
        .ok_or("the line does not begin with a checksum")?;
    if crc32fast::hash(rest) != crc {
        return Err("the checksum does not match".to_owned());
    }
    serde_json::from_slice(rest).map_err(|e| e.to_string())
}

fn format(sequence: u64, event: &Event) -> Result<Vec<u8>, StoreError> {
    let json = serde_json::to_vec(&LineOut { sequence, event }).map_err(|e| StoreError::Io {
        what: "encode a catalogue event".to_owned(),
        detail: e.to_string(),
    })?;
    let mut line = format!("{:08x} ", crc32fast::hash(&json)).into_bytes();
    line.extend_from_slice(&json);
    line.push(b'\n');
    Ok(line)
}

/// The open log.
pub struct CatalogueLog {
    path: PathBuf,
    /// `None` where nothing may be written.
    file: Option<File>,
    length: u64,
}

/// Why an event is not in the log.
pub struct AppendError {
    /// The failure.
    pub error: StoreError,
    /// Whether the log may hold part of the event, so that nothing more may be appended.
    pub in_doubt: bool,
}

impl CatalogueLog {
    /// Opens the log for appending and cuts it to its good length.
    ///
    /// # Errors
    /// A failure of the file system.
    pub fn open(path: &Path, good_length: u64) -> Result<Self, StoreError> {
        let fail = |e: std::io::Error| StoreError::io(format!("open {}", path.display()), &e);
        let file = files::options()
            .create(true)
            .append(true)
            .open(path)
            .map_err(fail)?;
        if file.metadata().map_err(fail)?.len() != good_length {
            file.set_len(good_length).map_err(fail)?;
        }
        file.sync_all().map_err(fail)?;
        if let Some(directory) = path.parent() {
            files::sync_directory(directory)?;
        }
        Ok(Self {
            path: path.to_owned(),
            file: Some(file),
            length: good_length,
        })
    }

    /// A log that takes no events, of a store that takes no writes.
    pub fn closed(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            file: None,
            length: 0,
        }
    }

    /// Appends an event and waits until it is on the disk.
    ///
    /// # Errors
    /// [`AppendError`]; where it is not in doubt, the log is as it was.
    pub fn append(&mut self, sequence: u64, event: &Event) -> Result<(), AppendError> {
        let line = format(sequence, event).map_err(|error| AppendError {
            error,
            in_doubt: false,
        })?;
        let at = self.path.display();
        let Some(file) = &mut self.file else {
            return Err(AppendError {
                error: StoreError::ReadOnly {
                    why: format!("{at} is not open for writing"),
                },
                in_doubt: false,
            });
        };
        if let Err(error) = file.write_all(&line) {
            let undone = file.set_len(self.length).is_ok();
            return Err(AppendError {
                error: StoreError::io(format!("append to {at}"), &error),
                in_doubt: !undone,
            });
        }
        // After a failed fsync nobody knows what is on the disk, and trying again may report success wrongly.
        file.sync_data().map_err(|error| AppendError {
            error: StoreError::io(format!("sync {at}"), &error),
            in_doubt: true,
        })?;
        self.length += line.len() as u64;
        Ok(())
    }

    /// Takes back the event appended last, whose line began at `length`. Says whether it is gone for good.
    pub fn take_back(&mut self, length: u64) -> bool {
        let cut = |file: &File| file.set_len(length).and_then(|()| file.sync_data());
        let gone = self.file.as_ref().is_some_and(|file| cut(file).is_ok());
        if gone {
            self.length = length;
        }
        gone
    }

    /// Bytes of the log.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Replaces the log by one that holds just these events, numbered from `first`.
    ///
    /// # Errors
    /// A failure of the file system; the old log is in place then.
    pub fn rewrite(&mut self, first: u64, events: &[Event]) -> Result<(), StoreError> {
        let fail = |e: std::io::Error| StoreError::io(format!("rewrite {}", self.path.display()), &e);
        let mut text = Vec::new();
        for (sequence, event) in (first..).zip(events) {
            text.extend_from_slice(&format(sequence, event)?);
        }
        files::write_durably(&self.path, &text)?;
        let file = files::options().append(true).open(&self.path).map_err(fail)?;
        self.file = Some(file);
        self.length = text.len() as u64;
        Ok(())
    }
}
