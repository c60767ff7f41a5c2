//! Archives, whole and hostile.

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
fn what_comes_out_is_reserved_while_it_does_and_stops_when_asked() {
    let files: &[(&str, &[u8])] = &[("a.off", &[b'x'; 600]), ("b.off", &[b'y'; 300])];
    let roomy = ArchiveLimits {
        max_members: 10,
        max_bytes: 1 << 20,
    };
    for archive in [zip_of(files), tar_of(files), gzip(&tar_of(files))] {
        let kind = detect(&archive).unwrap();
        let attempt = |budget: &MemoryBudget, cancel: &Cancel| {
            let memory = budget.reservation();
            let unpacking = Unpacking {
                cancel,
                memory: &memory,
            };
            let unpacked = unpack_within(kind, &archive, &mut roomy.clone(), &unpacking);
            (unpacked.map_err(|p| p.code), memory.bytes())
        };
        let (unpacked, reserved) = attempt(&MemoryBudget::new(1 << 20), &Cancel::new());
        assert_eq!(unpacked.unwrap().len(), 2);
        assert!((900..2000).contains(&reserved), "{kind:?}: {reserved}");
        let (refused, _) = attempt(&MemoryBudget::new(1500), &Cancel::new());
        assert_eq!(refused, Err(Code::ArchiveTooLarge), "{kind:?}");
        let others = MemoryBudget::new(1 << 20);
        let held = others.reservation();
        held.grow_body((1 << 19) - 500).unwrap();
        assert_eq!(
            attempt(&others, &Cancel::new()).0,
            Err(Code::Overloaded),
            "{kind:?}"
        );
        let stopped = Cancel::new();
        stopped.cancel();
        assert_eq!(
            attempt(&MemoryBudget::unlimited(), &stopped).0,
            Err(Code::Cancelled),
            "{kind:?}"
        );
    }
}

#[test]
fn what_is_passed_over_counts_against_the_limits_of_all_archives_of_a_request() {
    let archive = gzip(&tar_of(&[(".hidden", &[b'x'; 6000]), ("a.off", &[b'y'; 300])]));
    let mut left = ArchiveLimits {
        max_members: 10,
        max_bytes: 40_000,
    };
    let unpacking = Unpacking {
        cancel: &Cancel::new(),
        memory: &MemoryBudget::unlimited().reservation(),
    };
    let mut unpacked = || unpack_within(ArchiveKind::TarGz, &archive, &mut left, &unpacking);
    assert_eq!(unpacked().unwrap().len(), 1);
    let refused = (0..20).find_map(|_| unpacked().err().map(|problem| problem.code));
    assert!(
        matches!(refused, Some(Code::ArchiveTooLarge | Code::TooManyFiles)),
        "{refused:?}"
    );
    assert!(left.max_members <= 8 && left.max_bytes < 34_000, "{left:?}");
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
