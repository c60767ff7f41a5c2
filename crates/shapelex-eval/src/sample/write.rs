//! Triangles → bytes of a Wavefront OBJ or a binary glTF 2.0 file.

use serde_json::json;
use shapelex_core::mesh::TriangleSoup;
use std::fmt::Write;

/// OBJ text: `v` and `f` lines only, one-based indices, coordinates with as many digits as tell them apart.
pub fn write_obj(mesh: &TriangleSoup) -> Vec<u8> {
    let mut text = String::with_capacity(64 * mesh.vertices.len() + 20 * mesh.faces.len());
    for [x, y, z] in &mesh.vertices {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for face in &mesh.faces {
        let [a, b, c] = face.map(|i| u64::from(i) + 1);
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    text.into_bytes()
}

/// A GLB container (glTF 2.0 specification, section 4.4) with one node, one mesh, one indexed triangle primitive:
/// POSITION in single precision with its bounds, indices of 32 bits. Coordinates are rounded to single precision.
pub fn write_glb(mesh: &TriangleSoup) -> Vec<u8> {
    let positions: Vec<[f32; 3]> = mesh.vertices.iter().map(|v| v.map(|x| x as f32)).collect();
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for p in &positions {
        for i in 0..3 {
            low[i] = low[i].min(p[i]);
            high[i] = high[i].max(p[i]);
        }
    }
    let mut binary = Vec::with_capacity(12 * (positions.len() + mesh.faces.len()));
    for x in positions.iter().flatten() {
        binary.extend_from_slice(&x.to_le_bytes());
    }
    let split = binary.len();
    for i in mesh.faces.iter().flatten() {
        binary.extend_from_slice(&i.to_le_bytes());
    }
    let document = json!({
        "asset": {"version": "2.0", "generator": concat!("shapelex ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "buffers": [{"byteLength": binary.len()}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": split, "target": 34962},
            {"buffer": 0, "byteOffset": split, "byteLength": binary.len() - split, "target": 34963},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": positions.len(), "type": "VEC3",
             "min": low, "max": high},
            {"bufferView": 1, "componentType": 5125, "count": 3 * mesh.faces.len(), "type": "SCALAR"},
        ],
    });
    let mut text = document.to_string().into_bytes();
    // Chunks are padded to four bytes, JSON with spaces; positions and indices are multiples of four already.
    text.resize(text.len().next_multiple_of(4), b' ');

    let total = 12 + 8 + text.len() + 8 + binary.len();
    let mut bytes = Vec::with_capacity(total);
    bytes.extend_from_slice(b"glTF");
    bytes.extend_from_slice(&2u32.to_le_bytes());
    bytes.extend_from_slice(&(total as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
        bytes.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        bytes.extend_from_slice(kind);
        bytes.extend_from_slice(chunk);
    }
    bytes
}
