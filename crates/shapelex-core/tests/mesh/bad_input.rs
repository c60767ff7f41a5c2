//! What is refused, and that nothing panics.

use crate::encode::*;
use proptest::prelude::*;
use shapelex_core::mesh::{Format, Limits, MeshError, Source};

fn every_file() -> Vec<(Format, Vec<u8>)> {
    vec![
        (Format::Obj, fixture("tetra.obj")),
        (Format::Off, fixture("tetra.off")),
        (Format::Ply, fixture("tetra.ply")),
        (Format::Ply, binary_ply(false)),
        (Format::Ply, binary_ply(true)),
        (Format::Stl, fixture("tetra.stl")),
        (Format::Stl, binary_stl(b"")),
        (Format::Gltf, Gltf::tetra().embedded()),
        (Format::Glb, Gltf::tetra().glb()),
    ]
}

#[test]
fn empty_and_unknown() {
    assert_eq!(read(b""), Err(MeshError::Empty));
    assert_eq!(read(b"Dear sir or madam"), Err(MeshError::UnknownFormat));
    assert_eq!(read(&[0; 300]), Err(MeshError::UnknownFormat));
}

#[test]
fn text_declared_as_something_else_says_what_was_expected() {
    for (format, expected) in [
        (Format::Glb, "`glTF`"),
        (Format::Gltf, "JSON"),
        (Format::Ply, "`ply`"),
        (Format::Stl, "`solid …`"),
        (Format::Off, "number of vertices"),
        (Format::Obj, "`v`"),
    ] {
        let error = read_as(b"Dear sir or madam", Some(format)).expect_err("not a mesh");
        assert!(error.to_string().contains(expected), "{format}: {error}");
        assert!(
            matches!(error, MeshError::Malformed { format: f, .. } | MeshError::Truncated { format: f, .. } if f == format)
        );
    }
}

#[test]
fn truncated_files_are_refused_or_read_but_never_panic() {
    for (format, bytes) in every_file() {
        let mut refused = 0;
        for k in 0..16 {
            let cut = &bytes[..bytes.len() * k / 16];
            match read_as(cut, Some(format)) {
                Err(MeshError::Empty) => assert_eq!(k, 0),
                Err(MeshError::Truncated { .. } | MeshError::Malformed { .. }) => refused += 1,
                // A text without counts may lose its end and still be whole lines.
                Err(MeshError::NoFaces { .. } | MeshError::IndexOutOfRange { .. }) | Ok(_)
                    if format == Format::Obj => {}
                other => panic!("{format} cut at {k}/16: {other:?}"),
            }
        }
        assert!(refused == 15 || format == Format::Obj, "{format}: {refused}");
    }
    for bytes in [
        binary_stl(b""),
        binary_ply(true),
        Gltf::tetra().glb(),
        fixture("tetra.off"),
    ] {
        let cut = &bytes[..bytes.len() - 12];
        let name = Format::ALL.into_iter().find(
            |&f| matches!(read_as(cut, Some(f)), Err(MeshError::Truncated { format, .. }) if format == f),
        );
        assert!(name.is_some(), "cut short, but not said so");
    }
}

#[test]
fn indices_out_of_range() {
    let out = |index, vertices| {
        Err(MeshError::IndexOutOfRange {
            face: 1,
            index,
            vertices,
        })
    };
    let obj = |f: &str| read(format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{f}").as_bytes()).map(|r| r.1);
    assert_eq!(obj("f 1 2 4"), out(4, 3));
    assert_eq!(obj("f 1 2 0"), out(0, 3));
    assert_eq!(obj("f -1 -2 -4"), out(-4, 3));
    assert_eq!(obj("f 1 2 9999999999"), out(9_999_999_999, 3));
    let off = |f: &str| read(format!("OFF 3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n{f}").as_bytes()).map(|r| r.1);
    assert_eq!(off("3 0 1 3"), out(3, 3));
    assert_eq!(off("3 0 1 -1"), out(-1, 3));
    let ply = |f: &str| {
        let head =
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
        let body = "element face 2\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        read(format!("{head}{body}{f}").as_bytes()).map(|r| r.1)
    };
    assert_eq!(ply("3 0 1 3"), out(3, 3));
    assert_eq!(ply("3 0 1 -7"), out(-7, 3));
    let mut gltf = Gltf::tetra();
    let indices = gltf.shorts(&[0, 1, 2, 0, 1, 4]);
    gltf.primitive()["indices"] = indices.into();
    assert_eq!(read(&gltf.glb()).map(|r| r.1), out(4, 4));
}

#[test]
fn coordinates_that_are_no_numbers() {
    for x in ["nan", "inf", "-Infinity", "1e400"] {
        let refused = Err(MeshError::NotFinite { vertex: 1 });
        let obj = format!("v 0 0 0\nv 1 {x} 0\nv 0 1 0\nf 1 2 3\n");
        assert_eq!(read(obj.as_bytes()).map(|r| r.1), refused, "OBJ {x}");
        let off = format!("OFF 3 1 0\n0 0 0\n1 {x} 0\n0 1 0\n3 0 1 2\n");
        assert_eq!(read(off.as_bytes()).map(|r| r.1), refused, "OFF {x}");
        let ply = String::from_utf8(fixture("tetra.ply")).expect("text");
        let ply = ply.replace("255 1 -1 -1", &format!("255 1 {x} -1"));
        assert_eq!(read(ply.as_bytes()).map(|r| r.1), refused, "PLY {x}");
        let stl = String::from_utf8(fixture("tetra.stl")).expect("text");
        let stl = stl.replace("vertex 1 -1 -1", &format!("vertex 1 {x} -1"));
        assert_eq!(read(stl.as_bytes()).map(|r| r.1), refused, "STL {x}");
    }
    let mut gltf = Gltf::tetra();
    gltf.buffer[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    let refused = Err(MeshError::NotFinite { vertex: 1 });
    assert_eq!(read(&gltf.glb()).map(|r| r.1), refused);
    let mut stl = binary_stl(b"");
    stl[84 + 24..84 + 28].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert_eq!(read(&stl).map(|r| r.1), refused);
    // Finite, but the square of an area would overflow.
    let error = read(b"v 0 0 0\nv 1e200 0 0\nv 0 1 0\nf 1 2 3\n").expect_err("huge");
    assert!(error.to_string().contains("vertex 1 is at (1e200"), "{error}");
}

#[test]
fn points_without_faces() {
    let none = |vertices| Err(MeshError::NoFaces { vertices });
    assert_eq!(
        read(b"v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\nl 1 2 3\nf 1 2\n").map(|r| r.1),
        none(3)
    );
    assert_eq!(read(b"OFF\n2 0 0\n0 0 0\n1 1 1\n").map(|r| r.1), none(2));
    let cloud = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
    assert_eq!(read(cloud).map(|r| r.1), none(1));
    assert_eq!(read(b"solid nothing\nendsolid nothing\n").map(|r| r.1), none(0));
    let mut gltf = Gltf::tetra();
    gltf.primitive()["mode"] = 0.into();
    assert_eq!(read(&gltf.glb()).map(|r| r.1), none(4));
}

#[test]
fn limits_are_checked_before_anything_is_loaded() {
    let read_within = |bytes: &[u8], limits: Limits| {
        let source = Source {
            bytes,
            ..Source::default()
        };
        shapelex_core::mesh::read(&source, &limits).map(|r| r.1)
    };
    let few = Limits {
        max_vertices: 3,
        ..Limits::default()
    };
    let flat = Limits {
        max_faces: 3,
        ..Limits::default()
    };
    for (format, bytes) in every_file() {
        let too_many = |what, limit| {
            Err(MeshError::TooLarge {
                what,
                found: 4,
                limit,
            })
        };
        assert_eq!(read_within(&bytes, few), too_many("vertices", 3), "{format}");
        assert_eq!(read_within(&bytes, flat), too_many("faces", 3), "{format}");
        let short = Limits {
            max_bytes: 100,
            ..Limits::default()
        };
        let error = read_within(&bytes, short).expect_err("too long");
        assert!(
            matches!(
                error,
                MeshError::TooLarge {
                    what: "bytes",
                    limit: 100,
                    ..
                }
            ),
            "{error}"
        );
    }
    // Promises of billions in a few bytes.
    let promises: [&[u8]; 5] = [
        b"OFF\n4000000000 4000000000 0\n0 0 0\n",
        b"OFF\n1000000 1000000 0\n0 0 0\n",
        b"ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 1000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n123",
        b"ply\nformat ascii 1.0\nelement dust 18000000000000000000\nproperty float x\nend_header\n",
    ];
    for bytes in promises {
        let error = read(bytes).expect_err("a promise");
        assert!(
            matches!(error, MeshError::TooLarge { .. } | MeshError::Truncated { .. }),
            "{error}"
        );
    }
    let list = b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uint int vertex_index\nend_header\n\xff\xff\xff\xff....";
    assert!(matches!(read(list), Err(MeshError::Truncated { .. })));
    let mut stl = binary_stl(b"");
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let error = read_as(&stl, Some(Format::Stl)).expect_err("a promise");
    assert!(
        matches!(
            error,
            MeshError::TooLarge {
                found: 4_294_967_295,
                ..
            }
        ),
        "{error}"
    );
    stl[80..84].copy_from_slice(&1_000_000u32.to_le_bytes());
    let error = read_as(&stl, Some(Format::Stl)).expect_err("a promise");
    assert!(
        error
            .to_string()
            .contains("1000000 triangles, but there are bytes for 4"),
        "{error}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), format in 0..6usize) {
        let _ = read_as(&bytes, Some(Format::ALL[format]));
    }

    #[test]
    fn random_words_never_panic(
        words in prop::collection::vec(prop::sample::select(vec![
            "v", "f", "vn", "l", "1", "-1", "0", "2.5", "nan", "1/2/3", "1//", "\n", "\n", "\\\n", "OFF", "3", "4",
            "ply\n", "format ascii 1.0\n", "element vertex 3\n", "element face 2\n", "property float x\n",
            "property float y\n", "property float z\n", "property list uchar int vertex_index\n", "end_header\n",
            "solid", "facet", "vertex", "endloop", "endsolid", "#", "\r", "é",
        ]), 0..80),
        format in 0..6usize,
    ) {
        let _ = read_as(words.join(" ").as_bytes(), Some(Format::ALL[format]));
    }

    /// A valid file with a few bytes changed: whatever is read keeps the soup's promise.
    #[test]
    fn changed_bytes_never_panic(
        which in 0..9usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let (format, mut bytes) = every_file().swap_remove(which);
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Ok((_, soup)) = read_as(&bytes, Some(format)) {
            prop_assert!(soup.faces.iter().flatten().all(|&k| (k as usize) < soup.vertices.len()));
            prop_assert!(soup.vertices.iter().flatten().all(|x| x.is_finite()));
        }
    }
}
