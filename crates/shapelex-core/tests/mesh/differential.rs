//! A second reader agrees: tobj on OBJ, ply-rs-bw on PLY, stl_io on STL. (`differential.py`, beside this file, asks
//! trimesh about all four formats.)
//!
//! Readers split polygons differently. What does not depend on that is compared for each polygon: its corners, and the
//! sum of its triangles' area vectors.

use crate::encode::read_as;
use proptest::prelude::*;
use shapelex_core::mesh::{Format, TriangleSoup};
use std::collections::BTreeSet;
use std::io::Cursor;

type Point = [f64; 3];

fn sub(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| a[k] - b[k])
}

/// The doubled area vector of a polygon.
fn area_vector(polygon: &[Point]) -> Point {
    let fan = polygon[1..].windows(2).map(|w| {
        let (u, v) = (sub(w[0], polygon[0]), sub(w[1], polygon[0]));
        [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ]
    });
    fan.fold([0.0; 3], |s, x| std::array::from_fn(|k| s[k] + x[k]))
}

fn bits(point: &Point) -> [u64; 3] {
    point.map(f64::to_bits)
}

/// Whether a soup has these polygons, in this order and with nothing else.
fn assert_same(soup: &TriangleSoup, polygons: &[Vec<Point>], context: &str) {
    let mut faces = soup.faces.iter();
    for polygon in polygons.iter().filter(|p| p.len() > 2) {
        let triangles: Vec<[Point; 3]> = faces
            .by_ref()
            .take(polygon.len() - 2)
            .map(|f| f.map(|k| soup.vertices[k as usize]))
            .collect();
        assert_eq!(triangles.len(), polygon.len() - 2, "{context}");
        let ours: BTreeSet<_> = triangles.iter().flatten().map(bits).collect();
        assert_eq!(ours, polygon.iter().map(bits).collect(), "{context}");
        if polygon.len() == 3 {
            assert_eq!(triangles[0].as_slice(), polygon.as_slice(), "{context}");
        }
        let expected = area_vector(polygon);
        let sum = triangles.iter().map(|t| area_vector(t));
        let sum = sum.fold([0.0; 3], |s, x| std::array::from_fn(|k| s[k] + x[k]));
        let size = polygon.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
        for k in 0..3 {
            assert!((sum[k] - expected[k]).abs() <= 1e-12 * size * size, "{context}");
        }
    }
    assert_eq!(faces.next(), None, "{context}");
}

/// One line of an OBJ file. Corners are numbers reduced to the vertices so far, negative or not, in one of four forms.
#[derive(Clone, Debug)]
enum Statement {
    Vertex([f64; 3], Option<f64>, bool),
    Texture,
    Normal,
    Face(Vec<(u16, bool, u8)>),
    Noise(&'static str),
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![-1e3..1e3f64, -1e-9..1e-9f64, any::<f32>().prop_map(f64::from)]
        .prop_filter("finite", |x| x.is_finite())
}

fn statement() -> impl Strategy<Value = Statement> {
    let weight = prop::option::weighted(0.2, 0.5..2.0f64);
    let corner = (any::<u16>(), any::<bool>(), 0..4u8);
    let noise = vec![
        "g left paw",
        "o cat",
        "s off",
        "usemtl fur",
        "mtllib a.mtl",
        "",
        "# v 1 2 3",
        "  ",
        "s 1",
        "# f 1 2 3 \\",
    ];
    prop_oneof![
        6 => ([number(), number(), number()], weight, any::<bool>()).prop_map(|(p, w, e)| Statement::Vertex(p, w, e)),
        1 => Just(Statement::Texture),
        1 => Just(Statement::Normal),
        4 => prop::collection::vec(corner, 3..9).prop_map(Statement::Face),
        2 => prop::sample::select(noise).prop_map(Statement::Noise),
    ]
}

fn write_obj(statements: &[Statement]) -> String {
    let (mut v, mut t, mut n) = (0usize, 0usize, 0usize);
    let mut text = String::new();
    for s in statements {
        match s {
            Statement::Vertex(p, w, exponent) => {
                v += 1;
                text += &match exponent {
                    true => format!("v {:e} {:e} {:e}", p[0], p[1], p[2]),
                    false => format!("v  {} {}\t{}", p[0], p[1], p[2]),
                };
                text += &w.map(|w| format!(" {w}")).unwrap_or_default();
            }
            Statement::Texture => {
                t += 1;
                text += "vt 0.5 0.5";
            }
            Statement::Normal => {
                n += 1;
                text += "vn 0 0 1";
            }
            Statement::Face(corners) if v > 0 => {
                text += "f";
                for &(k, negative, form) in corners {
                    let k = k as usize % v;
                    let index = if negative {
                        k as i64 - v as i64
                    } else {
                        k as i64 + 1
                    };
                    text += &match form {
                        1 if t > 0 => format!(" {index}/{t}"),
                        2 if n > 0 => format!(" {index}//{n}"),
                        3 if t > 0 && n > 0 => format!(" {index}/-1/-1"),
                        _ => format!(" {index}"),
                    };
                }
            }
            Statement::Face(_) => {}
            Statement::Noise(line) => text += line,
        }
        text += "\n";
    }
    text
}

/// What tobj makes of a file, polygon by polygon.
fn read_with_tobj(text: &str) -> Vec<Vec<Point>> {
    let options = tobj::LoadOptions {
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| {
        Err(tobj::LoadError::OpenFileFailed)
    })
    .expect("well-formed");
    let mut polygons = Vec::new();
    for mesh in models.into_iter().map(|m| m.mesh) {
        let corner = |&k: &u32| {
            let at = 3 * k as usize;
            [mesh.positions[at], mesh.positions[at + 1], mesh.positions[at + 2]]
        };
        let mut indices = mesh.indices.as_slice();
        let triangles = vec![3; indices.len() / 3];
        let arities = if mesh.face_arities.is_empty() {
            &triangles
        } else {
            &mesh.face_arities
        };
        for &n in arities {
            let (polygon, rest) = indices.split_at(n as usize);
            polygons.push(polygon.iter().map(corner).collect());
            indices = rest;
        }
    }
    polygons
}

proptest! {
    #[test]
    fn obj_agrees_with_tobj(statements in prop::collection::vec(statement(), 1..60)) {
        let text = write_obj(&statements);
        let polygons = read_with_tobj(&text);
        let ours = read_as(text.as_bytes(), Some(Format::Obj));
        if polygons.is_empty() {
            prop_assert!(ours.is_err());
        } else {
            let ours = ours.expect("well-formed").1;
            assert_same(&ours, &polygons, &text);
            // Other line ends, and statements over several lines, are the same file.
            for other in [text.replace('\n', "\r\n"), text.replace('\t', "\\\n")] {
                let again = read_as(other.as_bytes(), Some(Format::Obj)).expect("well-formed").1;
                prop_assert_eq!(&ours, &again);
            }
        }
    }

    #[test]
    fn stl_agrees_with_stl_io(
        triangles in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-100i32..100)), 1..40),
        binary in any::<bool>(),
    ) {
        let mut text = String::from("solid a name facet\n");
        let mut bytes = [b'x'; 80].to_vec();
        bytes.extend((triangles.len() as u32).to_le_bytes());
        for t in &triangles {
            text += "facet normal 0 0 1\nouter loop\n";
            bytes.extend([0; 12]);
            for v in t {
                text += &format!("vertex {} {:e} {}\n", f64::from(v[0]) / 8.0, f64::from(v[1]), v[2]);
                let floats = [v[0] as f32 / 8.0, v[1] as f32, v[2] as f32];
                bytes.extend(floats.iter().flat_map(|x| x.to_le_bytes()));
            }
            text += "endloop\nendfacet\n";
            bytes.extend([0; 2]);
        }
        text += "endsolid a name facet\n";
        let file = if binary { bytes } else { text.into_bytes() };
        let ours = read_as(&file, Some(Format::Stl)).expect("well-formed").1;
        let theirs = stl_io::read_stl(&mut Cursor::new(&file)).expect("well-formed");
        let vertices: Vec<_> = theirs.vertices.iter().map(|v| v.0.map(f64::from)).collect();
        let faces: Vec<_> = theirs.faces.iter().map(|f| f.vertices.map(|k| k as u32)).collect();
        prop_assert_eq!((ours.vertices, ours.faces), (vertices, faces));
    }
}

/// A PLY type: its name, whether it is a float, its size.
const TYPES: [(&str, bool, usize); 8] = [
    ("char", false, 1),
    ("uchar", false, 1),
    ("short", false, 2),
    ("ushort", false, 2),
    ("int", false, 4),
    ("uint", false, 4),
    ("float", true, 4),
    ("double", true, 8),
];

/// Appends a small whole number as a type, in an encoding: 0 ascii, 1 little-endian, 2 big-endian.
fn put(bytes: &mut Vec<u8>, value: i64, (_, float, size): (&str, bool, usize), encoding: usize) {
    if encoding == 0 {
        bytes.extend(format!("{value} ").bytes());
        return;
    }
    let mut raw = match (float, size) {
        (true, 4) => (value as f32).to_le_bytes().to_vec(),
        (true, _) => (value as f64).to_le_bytes().to_vec(),
        (false, size) => value.to_le_bytes()[..size].to_vec(),
    };
    if encoding == 2 {
        raw.reverse();
    }
    bytes.extend(raw);
}

fn read_with_ply_rs(bytes: &[u8]) -> Vec<Vec<Point>> {
    use ply_rs_bw::parser::Parser;
    use ply_rs_bw::ply::{DefaultElement, Property};
    let ply = Parser::<DefaultElement>::new()
        .read_ply(&mut &bytes[..])
        .expect("well-formed");
    let number = |p: &Property| match *p {
        Property::Char(x) => f64::from(x),
        Property::UChar(x) => f64::from(x),
        Property::Short(x) => f64::from(x),
        Property::UShort(x) => f64::from(x),
        Property::Int(x) => f64::from(x),
        Property::UInt(x) => f64::from(x),
        Property::Float(x) => f64::from(x),
        Property::Double(x) => x,
        ref list => panic!("unexpected {list:?}"),
    };
    let indices = |p: &Property| -> Vec<usize> {
        let of = |list: &[u32]| list.iter().map(|&k| k as usize).collect();
        match p {
            Property::ListFloat(list) => list.iter().map(|&k| k as usize).collect(),
            Property::ListDouble(list) => list.iter().map(|&k| k as usize).collect(),
            other => of(&other.to_u32_list().expect("a list")),
        }
    };
    let vertices: Vec<Point> = ply.payload["vertex"]
        .iter()
        .map(|v| ["x", "y", "z"].map(|axis| number(&v[axis])))
        .collect();
    let faces = ply.payload["face"].iter();
    faces
        .map(|f| {
            indices(&f["vertex_indices"])
                .into_iter()
                .map(|k| vertices[k])
                .collect()
        })
        .collect()
}

proptest! {
    #[test]
    fn ply_agrees_with_ply_rs(
        points in prop::collection::vec(prop::array::uniform3(0..120i64), 3..30),
        polygons in prop::collection::vec(prop::collection::vec(any::<u16>(), 0..7), 1..20),
        types in prop::array::uniform4(0..8usize),
        count in 0..6usize,
        encoding in 0..3usize,
        extras in prop::collection::vec((0..8usize, any::<bool>()), 0..4),
    ) {
        let name = ["ascii", "binary_little_endian", "binary_big_endian"][encoding];
        let mut head = format!("ply\nformat {name} 1.0\ncomment x\nelement dust 2\nproperty short s\nelement vertex {}\n", points.len());
        for (axis, t) in ["x", "y", "z"].iter().zip(types) {
            head += &format!("property {} {axis}\n", TYPES[t].0);
        }
        for (k, (t, list)) in extras.iter().enumerate() {
            let list = if *list { "list uchar " } else { "" };
            head += &format!("property {list}{} extra{k}\n", TYPES[*t].0);
        }
        head += &format!("obj_info y\nelement face {}\nproperty uchar flag\n", polygons.len());
        head += &format!("property list {} {} vertex_indices\nend_header\n", TYPES[count].0, TYPES[types[3]].0);
        let mut bytes = head.clone().into_bytes();
        let end = |bytes: &mut Vec<u8>| if encoding == 0 { bytes.push(b'\n') };
        for dust in [-3, 4] {
            put(&mut bytes, dust, TYPES[2], encoding);
            end(&mut bytes);
        }
        for p in &points {
            for (x, t) in p.iter().zip(types) {
                put(&mut bytes, *x, TYPES[t], encoding);
            }
            for (t, list) in &extras {
                if *list {
                    put(&mut bytes, 2, TYPES[1], encoding);
                    put(&mut bytes, 5, TYPES[*t], encoding);
                }
                put(&mut bytes, 6, TYPES[*t], encoding);
            }
            end(&mut bytes);
        }
        for polygon in &polygons {
            put(&mut bytes, 1, TYPES[1], encoding);
            put(&mut bytes, polygon.len() as i64, TYPES[count], encoding);
            for k in polygon {
                put(&mut bytes, i64::from(*k) % points.len() as i64, TYPES[types[3]], encoding);
            }
            end(&mut bytes);
        }
        let theirs = read_with_ply_rs(&bytes);
        let ours = read_as(&bytes, Some(Format::Ply));
        if theirs.iter().all(|polygon| polygon.len() < 3) {
            prop_assert!(ours.is_err());
        } else {
            let ours = ours.expect("well-formed").1;
            prop_assert_eq!(ours.vertices.len(), points.len());
            assert_same(&ours, &theirs, &head);
        }
    }
}
