//! The formats other than glTF, as they are meant to be read.

use crate::encode::*;
use shapelex_core::mesh::{Format, Limits, MeshError, Source};

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
    let soup = shapelex_core::mesh::read(&source, &Limits::default())
        .expect("valid")
        .1;
    assert_eq!(soup.faces.len(), 2);
    for head in ["nOFF 4\n4 1 0\n", "OFF BINARY\n"] {
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
