//! glTF files below every limit on size that multiply what they hold: read, or refused, in 5 s of the processor's time
//! and within 512 MB.

use crate::{LIMIT, MEMORY, peak};
use serde_json::{Value, json};
use shapelex_core::mesh::{Limits, MeshError, Source, read, read_poses};
use std::time::Duration;

/// How a reading is to end.
enum End {
    /// With this many faces, in each pose.
    Faces(usize),
    /// With a refusal that names this.
    TooLarge(&'static str),
}

/// A file, how many poses are asked of it, and how that ends.
type Reading = (&'static str, Vec<u8>, Option<usize>, End);

const READINGS: &[fn() -> Reading] = &[
    || {
        (
            "100 000 nodes that share a skin of 380 000 joints",
            shared_skin(100_000, 380_000),
            None,
            End::Faces(400_000),
        )
    },
    || {
        (
            "64 poses of 2000 nodes that share a skin",
            shared_skin(2000, 100_000),
            Some(64),
            End::Faces(8000),
        )
    },
    || {
        (
            "a skin of two million joints",
            shared_skin(1, 2_000_000),
            None,
            End::Faces(4),
        )
    },
    || {
        (
            "3000 skins of 1000 joints each",
            many_skins(3000, 1000),
            None,
            End::Faces(12_000),
        )
    },
    || ("100 000 morph targets", morphs(4, 100_000), None, End::Faces(4)),
    || {
        (
            "2000 morph targets of 300 000 vertices",
            morphs(300_000, 2000),
            None,
            End::TooLarge("steps of applying its morph targets to its vertices"),
        )
    },
    || {
        (
            "50 000 nodes with 2000 weights of the mesh",
            shared_weights(50_000, 2000),
            None,
            End::Faces(200_000),
        )
    },
    || {
        (
            "40 000 channels of 100 000 keys",
            channels(40_000, 100_000),
            Some(64),
            End::Faces(4),
        )
    },
    || {
        (
            "399 000 instances of one mesh",
            instances(399_000),
            None,
            End::Faces(1_596_000),
        )
    },
    || {
        (
            "64 poses of many instances",
            instances(100_000),
            Some(64),
            End::TooLarge("vertices in all poses"),
        )
    },
    || {
        (
            "50 000 meshes over the same bytes",
            same_bytes(50_000),
            None,
            End::Faces(200_000),
        )
    },
    || ("a chain of 390 000 nodes", chain(390_000), None, End::Faces(4)),
    || {
        (
            "64 poses of a chain of nodes",
            chain(390_000),
            Some(64),
            End::TooLarge("steps of placing its nodes"),
        )
    },
    || {
        (
            "1000 sparse accessors of zeros",
            sparse(1000),
            None,
            End::TooLarge("bytes in sparse accessors"),
        )
    },
    || {
        (
            "2000 meshes with sparse accessors",
            sparse_meshes(2000),
            None,
            End::TooLarge("steps of reading its sparse accessors"),
        )
    },
    || {
        (
            "many streams that decompress to much",
            bomb(60, 2_000_000),
            None,
            End::TooLarge("bytes in its embedded and compressed buffers"),
        )
    },
    || {
        (
            "the largest mesh, in text",
            largest(),
            None,
            End::Faces(3_990_000),
        )
    },
];

/// Processor time of this thread so far.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: u64 = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

/// The file a process of its own is to read, and the poses it is to sample.
const FILE: &str = "SHAPELEX_TEST_READING";
const POSES: &str = "SHAPELEX_TEST_POSES";

/// Reads every file; says which take too much or end otherwise.
pub fn read_all() -> Vec<String> {
    READINGS.iter().filter_map(|make| attempt(make())).collect()
}

/// Reads a file in a process of its own, whose memory is the reading's and nothing else's.
fn attempt((what, bytes, poses, end): Reading) -> Option<String> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &bytes).unwrap();
    let mut command = std::process::Command::new(std::env::current_exe().unwrap());
    command
        .args(["--exact", "gltf::a_reading_of_its_own", "--nocapture"])
        .env(FILE, file.path());
    if let Some(poses) = poses {
        command.env(POSES, poses.to_string());
    }
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let told = text.lines().find_map(|line| line.split_once("READING "));
    let Some(told) = told.and_then(|(_, json)| serde_json::from_str::<Value>(json).ok()) else {
        return Some(format!("{what}: {} {text}", output.status));
    };
    println!("{what}: {} MB, {told}", bytes.len() >> 20);
    let right = match end {
        End::Faces(expected) => {
            let faces = told["faces"].as_array().cloned().unwrap_or_default();
            faces.len() == poses.unwrap_or(1) && faces.iter().all(|f| *f == expected)
        }
        End::TooLarge(expected) => told["too_large"] == expected,
    };
    let within = told["seconds"].as_f64().is_some_and(|s| s < LIMIT.as_secs_f64())
        && told["peak"].as_u64().is_some_and(|bytes| bytes < MEMORY as u64);
    (!right || !within).then(|| format!("{what}: {told}"))
}

/// Does nothing by itself; [`attempt`] runs it with a file.
#[test]
fn a_reading_of_its_own() {
    let Some(path) = std::env::var_os(FILE) else {
        return;
    };
    let poses = std::env::var(POSES).ok().and_then(|n| n.parse().ok());
    let bytes = std::fs::read(path).unwrap();
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    let limits = Limits::default();
    let began = processor_time();
    let outcome = match poses {
        None => read(&source, &limits).map(|(_, soup)| vec![soup.faces.len()]),
        Some(poses) => read_poses(&source, poses, &limits)
            .map(|(_, poses)| poses.iter().map(|p| p.soup.faces.len()).collect()),
    };
    let took = processor_time()
        .zip(began)
        .map_or(Duration::ZERO, |(now, began)| now - began);
    let mut told = match outcome {
        Ok(faces) => json!({"faces": faces}),
        Err(MeshError::TooLarge { what, .. }) => json!({"too_large": what}),
        Err(other) => json!({"error": other.to_string()}),
    };
    told["seconds"] = took.as_secs_f64().into();
    told["peak"] = peak().unwrap_or(0).into();
    println!("READING {told}");
}

/// A document under construction; its buffer is in the binary chunk.
struct File {
    json: Value,
    binary: Vec<u8>,
}

const TETRAHEDRON: [f32; 12] = [1., 1., 1., 1., -1., -1., -1., 1., -1., -1., -1., 1.];

impl File {
    /// A tetrahedron as mesh 0, over accessors 0 and 1.
    fn tetrahedron() -> Self {
        let mut file = Self {
            json: json!({
                "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
                "accessors": [], "bufferViews": [],
            }),
            binary: Vec::new(),
        };
        file.floats("VEC3", &TETRAHEDRON);
        file.accessor("SCALAR", 5121, 12, &[0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2]);
        file
    }

    fn list(&mut self, name: &str) -> &mut Vec<Value> {
        self.json[name].as_array_mut().unwrap()
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len()});
        self.binary.extend(bytes);
        self.list("bufferViews").push(view);
        self.list("bufferViews").len() - 1
    }

    fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.list("accessors")
            .push(json!({"bufferView": view, "componentType": component, "type": kind, "count": count}));
        self.list("accessors").len() - 1
    }

    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(kind, 5126, values.len() / width, &bytes)
    }

    fn glb(mut self) -> Vec<u8> {
        self.json["buffers"] = json!([{"byteLength": self.binary.len()}]);
        let glb = gltf::Glb {
            header: gltf::binary::Header {
                magic: *b"glTF",
                version: 2,
                length: 0,
            },
            json: serde_json::to_vec(&self.json).unwrap().into(),
            bin: Some(self.binary.into()),
        };
        glb.to_vec().unwrap()
    }
}

/// Nodes with a tetrahedron that follows the first joints of a skin.
fn shared_skin(nodes: usize, joints: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    let joint = file.accessor("VEC4", 5121, 4, &[0; 16]);
    let weight = file.floats("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(4));
    file.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = joint.into();
    file.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = weight.into();
    file.json["nodes"] = vec![json!({"mesh": 0, "skin": 0}); nodes].into();
    file.json["skins"] = json!([{"joints": (0..joints).map(|k| k % nodes).collect::<Vec<_>>()}]);
    animated(&mut file);
    file.glb()
}

/// A node for each of many skins, in turn.
fn many_skins(skins: usize, joints: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    let joint: Vec<u8> = [(joints - 1) as u16, 0, 0, 0]
        .repeat(4)
        .iter()
        .flat_map(|j| j.to_le_bytes())
        .collect();
    let joint = file.accessor("VEC4", 5123, 4, &joint);
    let weight = file.floats("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(4));
    file.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = joint.into();
    file.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = weight.into();
    file.json["nodes"] = (0..skins).map(|k| json!({"mesh": 0, "skin": k})).collect();
    file.json["skins"] = vec![json!({"joints": vec![1; joints]}); skins].into();
    file.glb()
}

/// A clip that turns the first node.
fn animated(file: &mut File) {
    let keys = file.floats("SCALAR", &[0.0, 1.0]);
    let turns = file.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8]);
    file.json["animations"] = json!([{
        "samplers": [{"input": keys, "output": turns}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
    }]);
}

/// A mesh with many morph targets over the same bytes. Beyond the tetrahedron, triangles of neighbours.
fn morphs(vertices: usize, targets: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    let mut points = TETRAHEDRON.to_vec();
    points.extend((12..3 * vertices).map(|k| (k * k % 1013) as f32));
    let position = file.floats("VEC3", &points);
    let mut corners: Vec<u32> = vec![0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2];
    corners.extend((4..vertices.saturating_sub(2) as u32).flat_map(|k| [k, k + 1, k + 2]));
    let bytes: Vec<u8> = corners.iter().flat_map(|k| k.to_le_bytes()).collect();
    let indices = file.accessor("SCALAR", 5125, corners.len(), &bytes);
    file.json["meshes"] = json!([{
        "weights": vec![0.001; targets],
        "primitives": [{
            "attributes": {"POSITION": position}, "indices": indices,
            "targets": vec![json!({"POSITION": position}); targets],
        }],
    }]);
    file.glb()
}

/// Many nodes that show a mesh with many weights.
fn shared_weights(nodes: usize, weights: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    file.json["meshes"][0]["weights"] = vec![1.0; weights].into();
    file.json["meshes"][0]["primitives"][0]["targets"] = vec![json!({"POSITION": 0}); weights].into();
    file.json["nodes"] = vec![json!({"mesh": 0}); nodes].into();
    file.glb()
}

/// A clip whose channels share long keys and values.
fn channels(channels: usize, keys: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    let input = file.floats("SCALAR", &(0..keys).map(|k| k as f32).collect::<Vec<_>>());
    let output = file.floats("VEC3", &vec![0.5; 3 * keys]);
    file.json["animations"] = json!([{
        "samplers": [{"input": input, "output": output, "interpolation": "LINEAR"}],
        "channels": vec![json!({"sampler": 0, "target": {"node": 0, "path": "translation"}}); channels],
    }]);
    file.glb()
}

fn instances(nodes: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    file.json["nodes"] = (0..nodes)
        .map(|k| json!({"mesh": 0, "translation": [k, 0, 0]}))
        .collect();
    animated(&mut file);
    file.glb()
}

/// Meshes whose accessors all are the same long bytes, of which each uses the beginning.
fn same_bytes(meshes: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    let mut points = TETRAHEDRON.to_vec();
    points.resize(6_000_000, 1.0);
    let position = file.floats("VEC3", &points);
    let accessor = file.json["accessors"][position].clone();
    file.list("accessors").extend(vec![accessor; meshes]);
    file.json["meshes"] = (0..meshes)
        .map(|k| json!({"primitives": [{"attributes": {"POSITION": position + k}, "indices": 1}]}))
        .collect();
    file.json["nodes"] = (0..meshes).map(|k| json!({"mesh": k})).collect();
    file.glb()
}

fn chain(nodes: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    file.json["nodes"] = (1..nodes)
        .map(|k| json!({"children": [k]}))
        .chain([json!({"mesh": 0})])
        .collect();
    animated(&mut file);
    file.glb()
}

/// An accessor of two million points of which one is stored.
fn sparse_accessor(file: &mut File) -> Value {
    let (at, values) = (file.view(&[1]), file.view(&[0; 12]));
    json!({
        "componentType": 5126, "type": "VEC3", "count": 2_000_000, "sparse": {
            "count": 1, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values},
        },
    })
}

fn sparse(primitives: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    let accessor = sparse_accessor(&mut file);
    file.list("accessors").extend(vec![accessor; primitives]);
    file.json["meshes"][0]["primitives"] = (0..primitives)
        .map(|k| json!({"attributes": {"POSITION": 2 + k}, "indices": 1}))
        .collect();
    file.glb()
}

fn sparse_meshes(meshes: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    let accessor = sparse_accessor(&mut file);
    file.list("accessors").push(accessor);
    let mesh = json!({"primitives": [{"attributes": {"POSITION": 2}, "indices": 1}]});
    file.json["meshes"] = vec![mesh; meshes].into();
    file.json["nodes"] = (0..meshes).map(|k| json!({"mesh": k})).collect();
    file.glb()
}

/// Views that are streams of equal vertices, each a small part of its size when decompressed.
fn bomb(views: usize, vertices: usize) -> Vec<u8> {
    let mut file = File::tetrahedron();
    let stream = meshopt::encode_vertex_buffer(&vec![[0u32; 3]; vertices]).unwrap();
    let view = file.view(&stream);
    let mut compressed = file.json["bufferViews"][view].clone();
    compressed["byteStride"] = 12.into();
    compressed["count"] = vertices.into();
    compressed["mode"] = "ATTRIBUTES".into();
    let first = view + 1;
    for k in 0..views {
        file.list("bufferViews").push(json!({
            "buffer": 0, "byteLength": 12 * vertices, "extensions": {"EXT_meshopt_compression": compressed},
        }));
        file.list("accessors")
            .push(json!({"bufferView": first + k, "componentType": 5126, "type": "VEC3", "count": vertices}));
    }
    file.json["meshes"][0]["primitives"] = (0..views)
        .map(|k| json!({"attributes": {"POSITION": 2 + k}, "indices": 1}))
        .collect();
    file.glb()
}

/// A grid close to both limits, with its buffer as base64.
fn largest() -> Vec<u8> {
    use base64::Engine;
    let (width, height) = (1996u32, 1001u32);
    let mut file = File::tetrahedron();
    let mut points = Vec::with_capacity(3 * (width * height) as usize);
    for k in 0..width * height {
        points.extend([(k % width) as f32, (k / width) as f32, (k % 7) as f32]);
    }
    let position = file.floats("VEC3", &points);
    let corners = (0..height - 1).flat_map(|y| (0..width - 1).map(move |x| y * width + x));
    let bytes: Vec<u8> = corners
        .flat_map(|k| [k, k + 1, k + width, k + 1, k + width + 1, k + width])
        .flat_map(u32::to_le_bytes)
        .collect();
    let indices = file.accessor("SCALAR", 5125, bytes.len() / 4, &bytes);
    file.json["meshes"][0]["primitives"] =
        json!([{"attributes": {"POSITION": position}, "indices": indices}]);
    drop((points, bytes));
    let data = base64::engine::general_purpose::STANDARD.encode(&file.binary);
    file.json["buffers"] = json!([{"byteLength": file.binary.len(), "uri": "@"}]);
    file.binary = Vec::new();
    let text = file.json.to_string();
    let (before, after) = text.split_once("\"@\"").unwrap();
    [before, "\"data:;base64,", &data, "\"", after]
        .concat()
        .into_bytes()
}

/// An archive whose glTF refers to one long file in very many ways.
pub fn spellings() -> Vec<u8> {
    use std::io::{Cursor, Write};
    let mut file = File::tetrahedron();
    let length = file.binary.len();
    file.json["buffers"] = (0..200)
        .map(|k| json!({"byteLength": length, "uri": format!("{}x.bin", "./".repeat(k))}))
        .collect();
    // Every buffer is used.
    let views: Vec<Value> = (0..200)
        .map(|k| json!({"buffer": k, "byteLength": 48}))
        .chain([json!({"buffer": 0, "byteOffset": 48, "byteLength": 12})])
        .collect();
    file.json["bufferViews"] = views.into();
    file.json["accessors"] = (0..200)
        .map(|k| json!({"bufferView": k, "componentType": 5126, "type": "VEC3", "count": 4}))
        .chain([json!({"bufferView": 200, "componentType": 5121, "type": "SCALAR", "count": 12})])
        .collect();
    file.json["meshes"][0]["primitives"] = (0..200)
        .map(|k| json!({"attributes": {"POSITION": k}, "indices": 200}))
        .collect();
    let mut buffer = file.binary.clone();
    buffer.resize(150 << 20, 0);
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in [("a.gltf", file.json.to_string().as_bytes()), ("x.bin", &buffer)] {
        zip.start_file(name, zip::write::SimpleFileOptions::default())
            .unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}
