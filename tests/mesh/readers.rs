//! The formats other than glTF, as they are meant to be read.

use crate::encode::*;
use proptest::prelude::*;
use shapelex::mesh::{Format, Limits, MeshError, Source, TriangleSoup};

#[test]
fn the_tetrahedron_reads_the_same_from_every_format() {
    let cases = [
        (Format::Obj, fixture("tetra.obj")),
        (Format::Off, fixture("tetra.off")),
        (Format::Ply, fixture("tetra.ply")),
        (Format::Ply, binary_ply(false)),
        (Format::Ply, binary_ply(true)),
        (Format::Stl, fixture("tetra.stl")),
        (Format::Stl, binary_stl(b"exported")),
        (Format::Stl, binary_stl(b"solid exported, but binary")),
        (Format::Gltf, Gltf::tetra().embedded()),
        (Format::Glb, Gltf::tetra().glb()),
    ];
    for (expected, bytes) in cases {
        let (format, soup) = read(&bytes).expect("a valid file");
        assert_eq!(format, expected);
        assert_eq!(soup.vertices.len(), 4, "{format}");
        assert_eq!(corners(&soup), tetra_corners(), "{format}");
    }
}

#[test]
fn text_reads_the_same_with_other_line_ends() {
    for name in ["tetra.obj", "tetra.off", "tetra.ply", "tetra.stl"] {
        let text = String::from_utf8(fixture(name)).expect("text");
        for end in ["\r\n", "\r"] {
            let soup = read(text.replace('\n', end).as_bytes()).expect("a valid file").1;
            assert_eq!(corners(&soup), tetra_corners(), "{name} {end:?}");
        }
    }
}

#[test]
fn obj_keeps_file_order_and_unused_vertices() {
    let soup = read(b"v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 2 3 4 5\n")
        .expect("valid")
        .1;
    assert_eq!(soup.vertices.len(), 5);
    assert_eq!(soup.faces, [[1, 2, 3], [1, 3, 4]]);
}

#[test]
fn obj_faces_may_come_before_their_vertices() {
    let soup = read(b"g a\nv 0 0 0\nf 1 2 3\nv 1 0 0\nv 1 1 0\n")
        .expect("valid")
        .1;
    assert_eq!(soup.faces, [[0, 1, 2]]);
}

#[test]
fn obj_names_may_be_in_any_encoding() {
    let soup = read(b"o caf\xe9\nv 0 0 0\nv 1 0 0\nusemtl \xff\xfe\nv 1 1 0\nf 1 2 3\n")
        .expect("valid")
        .1;
    assert_eq!(soup.faces.len(), 1);
}

#[test]
fn off_header_variants() {
    let body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    for head in [
        "OFF\n4 1 0\n",
        "OFF 4 1 0\n",
        "OFF4 1 0\n",
        "OFF\n4 1\n",
        "# x\nNOFF\n\n# y\n4 1 4 # z\n",
        "\u{feff}OFF\n4 1 0\n",
    ] {
        let soup = read(format!("{head}{body}").as_bytes()).expect(head).1;
        assert_eq!(soup.faces, [[0, 1, 2], [0, 2, 3]], "{head}");
    }
    // Without the keyword only a name or a type tells.
    let bare = format!("4 1 0\n{body}");
    let source = Source {
        bytes: bare.as_bytes(),
        name: Some("quad.off"),
        ..Source::default()
    };
    let soup = shapelex::mesh::read(&source, &Limits::default())
        .expect("valid")
        .1;
    assert_eq!(soup.faces.len(), 2);
    for head in ["4OFF\n4 1 0\n", "nOFF 3\n4 1 0\n", "OFF BINARY\n"] {
        let error = read(format!("{head}{body}").as_bytes()).expect_err(head);
        assert!(matches!(error, MeshError::Unsupported { .. }), "{head}: {error}");
    }
}

#[test]
fn ply_strips_and_polygons() {
    let head = "ply\nformat ascii 1.0\nelement vertex 5\nproperty int x\nproperty int y\nproperty int z\n";
    let points = "0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n";
    let strips = format!(
        "{head}element tristrips 1\nproperty list int int vertex_indices\nend_header\n{points}8 0 1 2 3 -1 2 3 4\n"
    );
    let soup = read(strips.as_bytes()).expect("valid").1;
    assert_eq!(soup.faces, [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    let polygons = format!(
        "{head}element face 3\nproperty list uchar uint vertex_index\nend_header\n{points}4 0 1 3 2\n2 0 1\n0\n"
    );
    let soup = read(polygons.as_bytes()).expect("valid").1;
    assert_eq!(soup.faces, [[0, 1, 3], [0, 3, 2]]);
}

#[test]
fn ply_comments_may_be_in_any_encoding() {
    let text = String::from_utf8(fixture("tetra.ply")).expect("text");
    let (before, after) = text.split_once("made by hand").expect("the comment");
    let bytes = [before.as_bytes(), b"caf\xe9", after.as_bytes()].concat();
    assert_eq!(corners(&read(&bytes).expect("valid").1), tetra_corners());
}

/// What ply-rs-bw makes of a file with float positions and int faces.
fn read_with_ply_rs(bytes: &[u8]) -> TriangleSoup {
    use ply_rs_bw::parser::Parser;
    use ply_rs_bw::ply::{DefaultElement, Property};
    let ply = Parser::<DefaultElement>::new()
        .read_ply(&mut &bytes[..])
        .expect("well-formed");
    let number = |p: &Property| match p {
        Property::Float(x) => f64::from(*x),
        other => panic!("unexpected {other:?}"),
    };
    let mut soup = TriangleSoup::default();
    for v in &ply.payload["vertex"] {
        soup.vertices.push(["x", "y", "z"].map(|axis| number(&v[axis])));
    }
    for f in &ply.payload["face"] {
        let indices = f["vertex_indices"].to_u32_list().expect("a list");
        soup.faces
            .extend(indices[1..].windows(2).map(|w| [indices[0], w[0], w[1]]));
    }
    soup
}

proptest! {
    #[test]
    fn ply_payload_agrees_with_ply_rs(
        points in prop::collection::vec(prop::array::uniform3(-1e3f32..1e3), 3..30),
        polygons in prop::collection::vec(prop::collection::vec(any::<u16>(), 3..6), 1..20),
        encoding in 0..3usize,
    ) {
        let name = ["ascii", "binary_little_endian", "binary_big_endian"][encoding];
        let mut bytes = format!(
            "ply\nformat {name} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            points.len(), polygons.len()
        ).into_bytes();
        for p in &points {
            match encoding {
                0 => bytes.extend(format!("{} {} {}\n", p[0], p[1], p[2]).bytes()),
                1 => bytes.extend(p.iter().flat_map(|x| x.to_le_bytes())),
                _ => bytes.extend(p.iter().flat_map(|x| x.to_be_bytes())),
            }
        }
        for polygon in &polygons {
            let indices: Vec<i32> = polygon.iter().map(|&k| i32::from(k) % points.len() as i32).collect();
            match encoding {
                0 => {
                    let words: Vec<String> = indices.iter().map(i32::to_string).collect();
                    bytes.extend(format!("{} {}\n", words.len(), words.join(" ")).bytes());
                }
                1 => {
                    bytes.push(indices.len() as u8);
                    bytes.extend(indices.iter().flat_map(|k| k.to_le_bytes()));
                }
                _ => {
                    bytes.push(indices.len() as u8);
                    bytes.extend(indices.iter().flat_map(|k| k.to_be_bytes()));
                }
            }
        }
        // Ascii floats are read as doubles here and as singles there.
        let single = |soup: TriangleSoup| TriangleSoup {
            vertices: soup.vertices.iter().map(|v| v.map(|x| f64::from(x as f32))).collect(),
            ..soup
        };
        prop_assert_eq!(single(read(&bytes).expect("well-formed").1), read_with_ply_rs(&bytes));
    }
}
