//! Meshes that promise more than they hold, run in circles, or have no spectrum worth the name.

use crate::Case;
use serde_json::{Value, json};
use std::fmt::Write;

pub const CASES: &[fn() -> Case] = &[
    || {
        (
            "STL of 50 million",
            "model/stl",
            stl(50_000_000),
            413,
            "mesh_too_large",
        )
    },
    || {
        (
            "STL of 4 billion",
            "model/stl",
            stl(u32::MAX),
            413,
            "mesh_too_large",
        )
    },
    || {
        (
            "STL within the limits",
            "model/stl",
            stl(3_999_999),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "PLY of 90 million",
            "model/ply",
            ply("binary_little_endian", 90_000_000),
            413,
            "mesh_too_large",
        )
    },
    || {
        (
            "PLY within the limits",
            "model/ply",
            ply("binary_little_endian", 1_900_000),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "PLY text within the limits",
            "model/ply",
            ply("ascii", 1_900_000),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "PLY with a long list",
            "model/ply",
            long_list(),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "OFF of billions",
            "model/off",
            b"OFF\n4000000000 4000000000 0\n0 0 0\n".to_vec(),
            413,
            "mesh_too_large",
        )
    },
    || {
        (
            "OFF within the limits",
            "model/off",
            b"OFF\n1900000 3900000 0\n0 0 0\n".to_vec(),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "OFF with a long polygon",
            "model/off",
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3000000 0 1 2".to_vec(),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "glTF accessor of billions",
            "model/gltf+json",
            gltf(|g| g["accessors"][0]["count"] = json!(4_000_000_000u32)),
            413,
            "mesh_too_large",
        )
    },
    || {
        (
            "glTF offset at the end of the world",
            "model/gltf+json",
            gltf(|g| g["accessors"][0]["byteOffset"] = json!(u64::MAX)),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "glTF view at the end of the world",
            "model/gltf+json",
            gltf(|g| g["bufferViews"][0]["byteOffset"] = json!(u64::MAX - 3)),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "glTF count times size overflows",
            "model/gltf+json",
            gltf(|g| {
                g["accessors"][0]["count"] = json!(u64::MAX / 12 + 2);
            }),
            413,
            "mesh_too_large",
        )
    },
    || {
        (
            "glTF stride overflows",
            "model/gltf+json",
            gltf(|g| {
                g["bufferViews"][0]["byteStride"] = json!(u64::MAX / 2);
            }),
            422,
            "truncated_mesh",
        )
    },
    || {
        (
            "glTF circle",
            "model/gltf+json",
            gltf(|g| g["nodes"] = json!([{"mesh": 0, "children": [1]}, {"children": [0]}])),
            422,
            "malformed_mesh",
        )
    },
    || {
        (
            "glTF of numbers",
            "model/gltf+json",
            numbers(),
            413,
            "mesh_too_large",
        )
    },
    || {
        (
            "OBJ of one face with 30 million corners",
            "model/obj",
            long_face(" 1"),
            413,
            "mesh_too_large",
        )
    },
    || {
        (
            "OBJ of one face on 30 million lines",
            "model/obj",
            long_face("\\\n"),
            422,
            "mesh_too_small",
        )
    },
    || ("two STL in one", "model/stl", two_stl(), 422, "malformed_mesh"),
    || {
        (
            "3000 triangles",
            "model/off",
            triangles(),
            422,
            "disconnected_mesh",
        )
    },
    || ("one place", "model/off", coincident(), 422, "degenerate_mesh"),
];

fn stl(promised: u32) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(promised.to_le_bytes());
    bytes.extend([0u8; 500]);
    bytes
}

fn two_stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(100_000u32.to_le_bytes());
    bytes.resize(bytes.len() + 5_000_000, 0);
    [bytes.as_slice(), &bytes].concat()
}

fn long_face(filling: &str) -> Vec<u8> {
    format!(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1{} 2 3\n",
        filling.repeat(30_000_000)
    )
    .into_bytes()
}

fn ply(kind: &str, promised: usize) -> Vec<u8> {
    let mut text = format!("ply\nformat {kind} 1.0\nelement vertex {promised}\n");
    text += "property float x\nproperty float y\nproperty float z\n";
    let _ = write!(
        text,
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n",
        2 * promised
    );
    text.into_bytes()
}

fn long_list() -> Vec<u8> {
    let mut text = "ply\nformat binary_little_endian 1.0\nelement vertex 0\n".to_owned();
    text += "property float x\nproperty float y\nproperty float z\nelement face 1\n";
    text += "property list uint int vertex_indices\nend_header\n";
    [text.into_bytes(), vec![0xff; 40]].concat()
}

/// A tetrahedron with a change.
fn gltf(change: impl FnOnce(&mut Value)) -> Vec<u8> {
    use base64::Engine;
    let mut data = Vec::new();
    for x in [1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1i8] {
        data.extend(f32::from(x).to_le_bytes());
    }
    for k in [0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2u16] {
        data.extend(k.to_le_bytes());
    }
    let encoded = base64::engine::general_purpose::STANDARD.encode(&data);
    let mut document = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 12},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [{"byteLength": 72, "uri": format!("data:application/octet-stream;base64,{encoded}")}],
    });
    change(&mut document);
    document.to_string().into_bytes()
}

/// A list nobody needs, of five million numbers: some 50 bytes each once it is read.
fn numbers() -> Vec<u8> {
    let list = "0,".repeat(5_000_000) + "0";
    let accessor = format!(r#"{{"componentType":5126,"count":1,"type":"VEC3","min":[{list}]}}"#);
    format!(r#"{{"asset":{{"version":"2.0"}},"accessors":[{accessor}]}}"#).into_bytes()
}

fn nested() -> Vec<u8> {
    let text = String::from_utf8(gltf(|g| g["extras"] = json!("here"))).unwrap();
    let deep = format!("{}{}", "[".repeat(1_000_000), "]".repeat(1_000_000));
    text.replacen("\"here\"", &deep, 1).into_bytes()
}

/// 100 000 nodes, each the only child of the one before; the last one holds a tetrahedron.
pub fn chain() -> Vec<u8> {
    gltf(|g| {
        let count = 100_000;
        let mut nodes: Vec<Value> = (1..count).map(|k| json!({"children": [k]})).collect();
        nodes.push(json!({"mesh": 0}));
        g["nodes"] = nodes.into();
    })
}

fn off(vertices: &[[f64; 3]], faces: &[[usize; 3]]) -> Vec<u8> {
    let mut text = format!("OFF\n{} {} 0\n", vertices.len(), faces.len());
    for [x, y, z] in vertices {
        let _ = writeln!(text, "{x:e} {y:e} {z:e}");
    }
    for [a, b, c] in faces {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text.into_bytes()
}

fn triangles() -> Vec<u8> {
    let corners = |i: usize| {
        let x = i as f64;
        [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.0]]
    };
    let vertices: Vec<_> = (0..3000).flat_map(corners).collect();
    let faces: Vec<_> = (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    off(&vertices, &faces)
}

fn coincident() -> Vec<u8> {
    let faces: Vec<_> = (0..2998).map(|i| [i, i + 1, i + 2]).collect();
    off(&[[7.0, -3.0, 1e9]; 3000], &faces)
}

/// A spiral strip whose edges grow from 1e-30 to 1e30.
fn growing() -> Vec<u8> {
    let vertices: Vec<_> = (0..600)
        .map(|i| {
            let r = 10f64.powf(-30.0 + f64::from(i) * 0.1);
            let t = f64::from(i) * 0.3;
            [r * t.cos(), r * t.sin(), r]
        })
        .collect();
    let faces: Vec<_> = (0..598).map(|i| [i, i + 1, i + 2]).collect();
    off(&vertices, &faces)
}

/// Odd, but surfaces all the same.
pub fn answerable() -> Vec<(&'static str, Vec<u8>)> {
    // What is nested deeply has no shape, so it is passed over.
    vec![
        ("edges from 1e-30 to 1e30", growing()),
        ("glTF nested deeply", nested()),
    ]
}

/// Equal closed surfaces beside each other, of 162 vertices each.
pub fn pieces(count: usize) -> Vec<u8> {
    let (rings, slices) = (11, 16);
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for piece in 0..count {
        let first = vertices.len();
        let x = 10.0 * piece as f64;
        vertices.push([x, 0.0, 1.3]);
        for ring in 1..rings {
            let polar = std::f64::consts::PI * ring as f64 / rings as f64;
            for slice in 0..slices {
                let around = std::f64::consts::TAU * slice as f64 / slices as f64;
                let r = polar.sin() * (1.0 + 0.3 * around.cos());
                vertices.push([x + r * around.cos(), 0.8 * r * around.sin(), 1.3 * polar.cos()]);
            }
        }
        vertices.push([x, 0.0, -1.3]);
        let last = vertices.len() - 1;
        let at = |ring: usize, slice: usize| first + 1 + (ring - 1) * slices + slice % slices;
        for slice in 0..slices {
            faces.push([first, at(1, slice), at(1, slice + 1)]);
            faces.push([last, at(rings - 1, slice + 1), at(rings - 1, slice)]);
            for ring in 1..rings - 1 {
                faces.push([at(ring, slice), at(ring + 1, slice), at(ring + 1, slice + 1)]);
                faces.push([at(ring, slice), at(ring + 1, slice + 1), at(ring, slice + 1)]);
            }
        }
    }
    off(&vertices, &faces)
}
