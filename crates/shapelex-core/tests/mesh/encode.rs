//! Files in every format, written by the tests themselves.

use serde_json::{Value, json};
use shapelex_core::mesh::{Format, MeshError, Source, TriangleSoup};

/// The corners of a regular tetrahedron.
pub const VERTICES: [[f64; 3]; 4] = [
    [1.0, 1.0, 1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
];
/// Its faces, all turned outwards the same way.
pub const FACES: [[u32; 3]; 4] = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];

/// Reads bytes with default limits and nothing else known.
pub fn read(bytes: &[u8]) -> Result<(Format, TriangleSoup), MeshError> {
    read_as(bytes, None)
}

/// Reads bytes declared to be of a format.
pub fn read_as(bytes: &[u8], declared: Option<Format>) -> Result<(Format, TriangleSoup), MeshError> {
    let source = Source {
        bytes,
        media_type: declared.map(Format::media_type),
        ..Source::default()
    };
    shapelex_core::mesh::read(&source, &Default::default())
}

/// The coordinates of each face's corners, in order.
pub fn corners(soup: &TriangleSoup) -> Vec<[[f64; 3]; 3]> {
    let corner = |k: u32| soup.vertices[k as usize];
    soup.faces.iter().map(|f| f.map(corner)).collect()
}

/// The corners of the tetrahedron's faces.
pub fn tetra_corners() -> Vec<[[f64; 3]; 3]> {
    FACES.iter().map(|f| f.map(|k| VERTICES[k as usize])).collect()
}

/// A file of `tests/data/mesh`.
pub fn fixture(name: &str) -> Vec<u8> {
    let path = shapelex_testing::data("mesh");
    std::fs::read(path.join(name)).expect("a fixture")
}

/// The tetrahedron as binary STL under an 80-byte header that begins as given.
pub fn binary_stl(header: &[u8]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((FACES.len() as u32).to_le_bytes());
    for face in tetra_corners() {
        bytes.extend([0u8; 12]);
        bytes.extend(face.iter().flatten().flat_map(|&x| (x as f32).to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    bytes
}

/// The tetrahedron as binary PLY with 16-bit indices and a colour after each vertex.
pub fn binary_ply(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\r\nformat binary_{order}_endian 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\n\
         property float z\r\nproperty uchar red\r\nelement face 4\r\nproperty list uchar ushort vertex_index\r\n\
         property float quality\r\nend_header\r\n"
    )
    .into_bytes();
    let float = |x: f64| {
        if big {
            (x as f32).to_be_bytes()
        } else {
            (x as f32).to_le_bytes()
        }
    };
    let short = |k: u32| {
        if big {
            (k as u16).to_be_bytes()
        } else {
            (k as u16).to_le_bytes()
        }
    };
    for v in VERTICES {
        bytes.extend(v.iter().flat_map(|&x| float(x)));
        bytes.push(7);
    }
    for f in FACES {
        bytes.push(3);
        bytes.extend(f.iter().flat_map(|&k| short(k)));
        bytes.extend(float(0.5));
    }
    bytes
}

/// A glTF document under construction: a buffer, and views and accessors into it.
pub struct Gltf {
    pub json: Value,
    pub buffer: Vec<u8>,
}

impl Gltf {
    /// A scene of one node with one mesh of one primitive, whose attributes and indices the caller adds.
    pub fn new() -> Self {
        Self {
            json: json!({
                "asset": {"version": "2.0"},
                "scene": 0,
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": [{"attributes": {}}]}],
                "accessors": [],
                "bufferViews": [],
            }),
            buffer: Vec::new(),
        }
    }

    /// The tetrahedron with 32-bit floats and 16-bit indices.
    pub fn tetra() -> Self {
        let mut gltf = Self::new();
        let positions = gltf.floats("VEC3", &VERTICES.concat());
        let indices = gltf.shorts(&FACES.concat());
        let primitive = gltf.primitive();
        primitive["attributes"]["POSITION"] = positions.into();
        primitive["indices"] = indices.into();
        gltf
    }

    /// The only primitive of the first mesh.
    pub fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// Appends bytes and returns the index of a view of them.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.buffer.len().is_multiple_of(4) {
            self.buffer.push(0);
        }
        let view = json!({"buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len()});
        self.buffer.extend(bytes);
        push(&mut self.json["bufferViews"], view)
    }

    /// Appends an accessor over bytes and returns its index.
    pub fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor = json!({"bufferView": view, "componentType": component, "type": kind, "count": count});
        push(&mut self.json["accessors"], accessor)
    }

    pub fn floats(&mut self, kind: &str, values: &[f64]) -> usize {
        let components = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
        self.accessor(kind, 5126, values.len() / components, &bytes)
    }

    pub fn shorts(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|&k| (k as u16).to_le_bytes()).collect();
        self.accessor("SCALAR", 5123, values.len(), &bytes)
    }

    /// As JSON with the buffer in a data URI.
    pub fn embedded(&self) -> Vec<u8> {
        use base64::Engine;
        let data = base64::engine::general_purpose::STANDARD.encode(&self.buffer);
        self.with_uri(&format!("data:application/octet-stream;base64,{data}"))
    }

    /// As JSON with the buffer at a URI.
    pub fn with_uri(&self, uri: &str) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.buffer.len(), "uri": uri}]);
        serde_json::to_vec(&json).expect("JSON")
    }

    /// As GLB.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.buffer.len()}]);
        let mut json = serde_json::to_vec(&json).expect("JSON");
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bin = self.buffer.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let mut bytes = b"glTF\x02\0\0\0".to_vec();
        bytes.extend((28 + json.len() as u32 + bin.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &bin)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(chunk);
        }
        bytes
    }
}

fn push(list: &mut Value, item: Value) -> usize {
    let list = list.as_array_mut().expect("a list");
    list.push(item);
    list.len() - 1
}
