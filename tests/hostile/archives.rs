//! Archives that unpack to more than they weigh, or to somewhere else.

use crate::Case;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::{Cursor, Write};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

pub const CASES: &[fn() -> Case] = &[
    || {
        (
            "zip bomb",
            "application/zip",
            zip_bomb(),
            413,
            "archive_too_large",
        )
    },
    || {
        (
            "many small bombs",
            "application/zip",
            many_bombs(),
            413,
            "archive_too_large",
        )
    },
    || {
        (
            "tar.gz bomb",
            "application/gzip",
            gzip_bomb(),
            413,
            "archive_too_large",
        )
    },
    || {
        (
            "gzip in gzip",
            "application/gzip",
            gzip_in_gzip(),
            422,
            "invalid_archive",
        )
    },
    || {
        (
            "a million entries",
            "application/zip",
            million_entries(),
            413,
            "too_many_files",
        )
    },
    || {
        (
            "a million entries, unsaid",
            "application/zip",
            unsaid_entries(),
            400,
            "no_files",
        )
    },
    || {
        (
            "a million folders",
            "application/gzip",
            million_folders(),
            413,
            "too_many_files",
        )
    },
    || {
        (
            "a name of 200 MB",
            "application/gzip",
            endless_name(tar::EntryType::GNULongName),
            422,
            "invalid_archive",
        )
    },
    || {
        (
            "attributes of 200 MB",
            "application/gzip",
            endless_name(tar::EntryType::XHeader),
            422,
            "invalid_archive",
        )
    },
    || {
        (
            "a name of 100 kB",
            "application/x-tar",
            long_name(),
            422,
            "unsafe_archive_path",
        )
    },
    || {
        (
            "a way out",
            "application/zip",
            zip_of("../../x.off"),
            422,
            "unsafe_archive_path",
        )
    },
    || {
        (
            "a root",
            "application/zip",
            zip_of("/etc/x.off"),
            422,
            "unsafe_archive_path",
        )
    },
    || {
        (
            "a drive",
            "application/zip",
            zip_of("C:\\x.off"),
            422,
            "unsafe_archive_path",
        )
    },
];

static ZEROS: [u8; 1 << 20] = [0; 1 << 20];

fn zip_bomb() -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    writer
        .start_file("bomb.off", SimpleFileOptions::default())
        .unwrap();
    for _ in 0..300 {
        writer.write_all(&ZEROS).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// Each below the limit, all of them beyond.
fn many_bombs() -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for i in 0..300 {
        writer
            .start_file(format!("{i}.off"), SimpleFileOptions::default())
            .unwrap();
        writer.write_all(&ZEROS).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn zip_of(name: &str) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    writer.start_file(name, SimpleFileOptions::default()).unwrap();
    writer.write_all(b"OFF").unwrap();
    writer.finish().unwrap().into_inner()
}

fn header(name: &str, size: u64, kind: tar::EntryType) -> tar::Header {
    let mut header = tar::Header::new_ustar();
    header.set_path(name).unwrap();
    header.set_size(size);
    header.set_mode(0o644);
    header.set_entry_type(kind);
    header.set_cksum();
    header
}

fn gzip_bomb() -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    let header = header("bomb.off", 300 << 20, tar::EntryType::Regular);
    encoder.write_all(header.as_bytes()).unwrap();
    for _ in 0..301 {
        encoder.write_all(&ZEROS).unwrap();
    }
    encoder.finish().unwrap()
}

fn gzip_in_gzip() -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&gzip_bomb()).unwrap();
    encoder.finish().unwrap()
}

/// A member whose name comes in a member of its own before it, as the tar programs do where it is long.
fn endless_name(kind: tar::EntryType) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder
        .write_all(header("long", 200 << 20, kind).as_bytes())
        .unwrap();
    let letters = vec![b'a'; 1 << 20];
    for _ in 0..200 {
        encoder.write_all(&letters).unwrap();
    }
    encoder
        .write_all(header("x.off", 0, tar::EntryType::Regular).as_bytes())
        .unwrap();
    encoder.write_all(&[0; 1024]).unwrap();
    encoder.finish().unwrap()
}

fn long_name() -> Vec<u8> {
    let mut builder = tar::Builder::new(Vec::new());
    let mut header = tar::Header::new_gnu();
    header.set_size(3);
    header.set_mode(0o644);
    let name = "a".repeat(100_000) + ".off";
    builder.append_data(&mut header, name, b"OFF".as_slice()).unwrap();
    builder.into_inner().unwrap()
}

fn million_folders() -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    let header = header("d/", 0, tar::EntryType::Directory);
    for _ in 0..100_000 {
        encoder.write_all(header.as_bytes()).unwrap();
    }
    encoder.finish().unwrap()
}

/// A directory of a million entries that all point at one file of one byte.
fn entries(count: u32) -> (Vec<u8>, u32) {
    let mut bytes = Vec::new();
    let fields = |crc: u32| {
        let mut fields = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        for number in [crc, 1, 1] {
            fields.extend(u32::to_le_bytes(number));
        }
        fields.extend([1, 0, 0, 0]);
        fields
    };
    let fields = fields(0x83dc_efb7);
    bytes.extend(b"PK\x03\x04");
    bytes.extend(&fields);
    bytes.extend(b"a1");
    let start = bytes.len() as u32;
    for _ in 0..count {
        bytes.extend(b"PK\x01\x02\x14\0");
        bytes.extend(&fields);
        bytes.extend([0; 14]);
        bytes.push(b'a');
    }
    (bytes, start)
}

fn million_entries() -> Vec<u8> {
    let (mut bytes, start) = entries(1_000_000);
    let end = bytes.len() as u64;
    bytes.extend(b"PK\x06\x06");
    bytes.extend(44u64.to_le_bytes());
    bytes.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    for number in [1_000_000, 1_000_000, end - u64::from(start), u64::from(start)] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(b"PK\x06\x07\0\0\0\0");
    bytes.extend(end.to_le_bytes());
    bytes.extend(1u32.to_le_bytes());
    bytes.extend(b"PK\x05\x06\0\0\0\0\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\0\0");
    bytes
}

/// The same directory under an end record that speaks of one entry.
fn unsaid_entries() -> Vec<u8> {
    let (mut bytes, start) = entries(1_000_000);
    let size = bytes.len() as u32 - start;
    bytes.extend(b"PK\x05\x06\0\0\0\0\x01\0\x01\0");
    bytes.extend(size.to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend([0, 0]);
    bytes
}
