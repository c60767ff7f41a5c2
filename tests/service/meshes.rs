//! Small closed surfaces of three kinds, in poses, and as files of every format.

use std::f64::consts::TAU;
use std::fmt::Write;

/// What the surfaces are called.
pub const CLASSES: [&str; 3] = ["bean", "star", "bottle"];

pub struct Mesh {
    pub vertices: Vec<[f64; 3]>,
    pub faces: Vec<[u32; 3]>,
}

/// A surface of a class. A pose bends and turns it; `finer` changes the triangulation too.
pub fn mesh(class: &str, pose: u32) -> Mesh {
    surface(class, pose, 22 + pose as usize % 3, 26)
}

fn surface(class: &str, pose: u32, rings: usize, slices: usize) -> Mesh {
    let mut vertices = vec![[0.0, 0.0, 1.0]];
    for ring in 1..rings {
        let polar = std::f64::consts::PI * ring as f64 / rings as f64;
        for slice in 0..slices {
            let around = TAU * slice as f64 / slices as f64;
            let (r, stretch) = match class {
                "bean" => (1.0, 2.2),
                "star" => (1.0 + 0.45 * (5.0 * around).cos() * polar.sin().powi(2), 0.5),
                "bottle" => (if polar < 0.8 { 0.35 } else { 1.0 }, 1.6),
                other => panic!("no class {other}"),
            };
            vertices.push([
                r * polar.sin() * around.cos(),
                r * polar.sin() * around.sin(),
                stretch * polar.cos(),
            ]);
        }
    }
    vertices[0][2] = vertices[1][2] * 1.01;
    let last = vertices.len() as u32;
    let bottom = vertices[last as usize - 1][2] * 1.01;
    vertices.push([0.0, 0.0, bottom]);
    let at = |ring: usize, slice: usize| (1 + (ring - 1) * slices + slice % slices) as u32;
    let mut faces = Vec::new();
    for slice in 0..slices {
        faces.push([0, at(1, slice), at(1, slice + 1)]);
        faces.push([last, at(rings - 1, slice + 1), at(rings - 1, slice)]);
        for ring in 1..rings - 1 {
            faces.push([at(ring, slice), at(ring + 1, slice), at(ring + 1, slice + 1)]);
            faces.push([at(ring, slice), at(ring + 1, slice + 1), at(ring, slice + 1)]);
        }
    }
    let bend = 0.12 * f64::from(pose);
    for [x, y, z] in &mut vertices {
        (*x, *z) = (*x + bend * *z * *z * 0.3, *z);
        let turn = 0.7 * f64::from(pose);
        (*x, *y) = (
            *x * turn.cos() - *y * turn.sin(),
            *x * turn.sin() + *y * turn.cos(),
        );
    }
    Mesh { vertices, faces }
}

/// A ball of 100 000 vertices: some work to read and to simplify.
pub fn dense() -> Mesh {
    surface("bean", 0, 250, 400)
}

pub fn off(class: &str, pose: u32) -> Vec<u8> {
    mesh(class, pose).off()
}

impl Mesh {
    pub fn off(&self) -> Vec<u8> {
        let mut text = format!("OFF\n{} {} 0\n", self.vertices.len(), self.faces.len());
        for [x, y, z] in &self.vertices {
            writeln!(text, "{x} {y} {z}").unwrap();
        }
        for [a, b, c] in &self.faces {
            writeln!(text, "3 {a} {b} {c}").unwrap();
        }
        text.into_bytes()
    }

    pub fn obj(&self) -> Vec<u8> {
        let mut text = String::from("# a surface\n");
        for [x, y, z] in &self.vertices {
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        for [a, b, c] in &self.faces {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
        }
        text.into_bytes()
    }

    pub fn ply(&self) -> Vec<u8> {
        let mut bytes = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.vertices.len(),
            self.faces.len()
        )
        .into_bytes();
        for value in self.vertices.iter().flatten() {
            bytes.extend((*value as f32).to_le_bytes());
        }
        for face in &self.faces {
            bytes.push(3);
            face.iter().for_each(|i| bytes.extend(i.to_le_bytes()));
        }
        bytes
    }

    pub fn stl(&self) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes.extend((self.faces.len() as u32).to_le_bytes());
        for face in &self.faces {
            bytes.extend([0u8; 12]);
            for i in face {
                for value in self.vertices[*i as usize] {
                    bytes.extend((value as f32).to_le_bytes());
                }
            }
            bytes.extend([0u8; 2]);
        }
        bytes
    }

    fn buffer(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for value in self.vertices.iter().flatten() {
            bytes.extend((*value as f32).to_le_bytes());
        }
        self.faces
            .iter()
            .flatten()
            .for_each(|i| bytes.extend(i.to_le_bytes()));
        bytes
    }

    fn document(&self, uri: Option<&str>) -> String {
        let (v, f) = (self.vertices.len(), self.faces.len());
        let (positions, indices) = (v * 12, f * 12);
        let bound = |pick: fn(f64, f64) -> f64| {
            (0..3)
                .map(|k| self.vertices.iter().map(|p| p[k]).reduce(pick).unwrap() as f32)
                .collect::<Vec<_>>()
        };
        let mut buffer = serde_json::json!({"byteLength": positions + indices});
        if let Some(uri) = uri {
            buffer["uri"] = uri.into();
        }
        serde_json::json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": v, "type": "VEC3",
                 "min": bound(f64::min), "max": bound(f64::max)},
                {"bufferView": 1, "componentType": 5125, "count": f * 3, "type": "SCALAR"}
            ],
            "bufferViews": [
                {"buffer": 0, "byteOffset": 0, "byteLength": positions},
                {"buffer": 0, "byteOffset": positions, "byteLength": indices}
            ],
            "buffers": [buffer]
        })
        .to_string()
    }

    /// A glTF document and the buffer it refers to as `uri`.
    pub fn gltf(&self, uri: &str) -> (Vec<u8>, Vec<u8>) {
        (self.document(Some(uri)).into_bytes(), self.buffer())
    }

    pub fn glb(&self) -> Vec<u8> {
        pack_glb(self.document(None), &self.buffer())
    }

    /// A GLB with one clip, `Stretch`, that makes the mesh three times as long.
    pub fn animated(&self) -> Vec<u8> {
        let mut buffer = self.buffer();
        let start = buffer.len();
        for value in [0.0_f32, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 3.0] {
            buffer.extend(value.to_le_bytes());
        }
        let mut document: serde_json::Value = serde_json::from_str(&self.document(None)).unwrap();
        document["buffers"][0]["byteLength"] = buffer.len().into();
        let views = document["bufferViews"].as_array_mut().unwrap();
        for (offset, length) in [(start, 8), (start + 8, 24)] {
            views.push(serde_json::json!({"buffer": 0, "byteOffset": offset, "byteLength": length}));
        }
        let accessors = document["accessors"].as_array_mut().unwrap();
        accessors.push(serde_json::json!({
            "bufferView": 2, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0.0], "max": [1.0]
        }));
        accessors
            .push(serde_json::json!({"bufferView": 3, "componentType": 5126, "count": 2, "type": "VEC3"}));
        document["animations"] = serde_json::json!([{
            "name": "Stretch",
            "samplers": [{"input": 2, "output": 3}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "scale"}}]
        }]);
        pack_glb(document.to_string(), &buffer)
    }
}

fn pack_glb(document: String, buffer: &[u8]) -> Vec<u8> {
    let mut json = document.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2u32.to_le_bytes());
    bytes.extend((12 + 8 + json.len() as u32 + 8 + buffer.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((buffer.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}
