//! glTF: what is read, from where, and what is refused.

use crate::encode::*;
use serde_json::json;
use shapelex_core::mesh::{Companion, Format, Limits, MeshError, Pose, Source, TriangleSoup};

fn soup(gltf: &Gltf) -> TriangleSoup {
    read(&gltf.glb()).expect("a valid file").1
}

fn poses(gltf: &Gltf, n: usize) -> Result<Vec<Pose>, MeshError> {
    let bytes = gltf.glb();
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    shapelex_core::mesh::read_poses(&source, n, &Limits::default()).map(|r| r.1)
}

fn close(a: [f64; 3], b: [f64; 3]) -> bool {
    a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-6)
}

#[test]
fn nodes_place_their_meshes() {
    let mut gltf = Gltf::tetra();
    let quarter = std::f64::consts::FRAC_1_SQRT_2;
    gltf.json["scenes"][0]["nodes"] = json!([1, 3]);
    gltf.json["nodes"] = json!([
        {"mesh": 0, "translation": [10, 0, 0]},
        {"children": [0], "rotation": [0, 0, quarter, quarter], "scale": [2, 2, 2]},
        {"mesh": 0, "translation": [77, 0, 0]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]);
    let soup = soup(&gltf);
    // Node 2 is not in the scene.
    assert_eq!(soup.vertices.len(), 8);
    assert_eq!(soup.faces.len(), 8);
    // (1, 1, 1) moved to (11, 1, 1), doubled, then turned so that x becomes y.
    assert!(
        close(soup.vertices[0], [-2.0, 22.0, 2.0]),
        "{:?}",
        soup.vertices[0]
    );
    assert!(close(soup.vertices[4], [1.0, 1.0, 6.0]));
    // No default scene: the first. No scenes: every root.
    gltf.json.as_object_mut().expect("an object").remove("scene");
    assert_eq!(read(&gltf.glb()).expect("valid").1.vertices.len(), 8);
    gltf.json.as_object_mut().expect("an object").remove("scenes");
    assert_eq!(read(&gltf.glb()).expect("valid").1.vertices.len(), 12);
}

#[test]
fn modes_and_index_types() {
    let square = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0];
    let faces = |mode: u32, component: u32, indices: &[u8]| {
        let mut gltf = Gltf::new();
        let positions = gltf.floats("VEC3", &square);
        gltf.primitive()["attributes"]["POSITION"] = positions.into();
        gltf.primitive()["mode"] = mode.into();
        if component > 0 {
            let width = match component {
                5121 => 1,
                5123 => 2,
                _ => 4,
            };
            let bytes: Vec<u8> = indices
                .iter()
                .flat_map(|&k| [k, 0, 0, 0].into_iter().take(width))
                .collect();
            let index = gltf.accessor("SCALAR", component, indices.len(), &bytes);
            gltf.primitive()["indices"] = index.into();
        }
        // Vertices that no face uses are left out, so the corners are named by where they are.
        let soup = soup(&gltf);
        let name = |k: u32| {
            let at = soup.vertices[k as usize];
            square
                .chunks(3)
                .position(|p| p == at)
                .expect("a corner of the square")
        };
        soup.faces.iter().map(|f| f.map(name)).collect::<Vec<_>>()
    };
    assert_eq!(faces(5, 0, &[]), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(faces(6, 0, &[]), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(faces(4, 0, &[]), [[0, 1, 2]]);
    for component in [5121, 5123, 5125] {
        assert_eq!(faces(4, component, &[3, 1, 2]), [[3, 1, 2]]);
        assert_eq!(faces(5, component, &[3, 1, 2, 0]), [[3, 1, 2], [2, 1, 0]]);
    }
}

#[test]
fn primitives_that_share_vertices_share_them_here() {
    let mut gltf = Gltf::tetra();
    let second = gltf.shorts(&[0, 1, 2]);
    let positions = gltf.primitive()["attributes"]["POSITION"].clone();
    let more = json!({"attributes": {"POSITION": positions, "_CUSTOM": 0}, "indices": second});
    gltf.json["meshes"][0]["primitives"]
        .as_array_mut()
        .expect("a list")
        .push(more);
    let soup = soup(&gltf);
    assert_eq!((soup.vertices.len(), soup.faces.len()), (4, 5));
}

#[test]
fn sparse_accessors() {
    let mut gltf = Gltf::tetra();
    let indices = gltf.view(&[2]);
    let values: Vec<u8> = [9f32, 8.0, 7.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let values = gltf.view(&values);
    let sparse = json!({
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": values},
    });
    gltf.json["accessors"][0]["sparse"] = sparse;
    let mut expected = VERTICES;
    expected[2] = [9.0, 8.0, 7.0];
    assert_eq!(soup(&gltf).vertices, expected);
    // Without a buffer view the rest is zero.
    gltf.json["accessors"][0]
        .as_object_mut()
        .expect("an object")
        .remove("bufferView");
    assert_eq!(soup(&gltf).vertices[1..3], [[0.0; 3], [9.0, 8.0, 7.0]]);
    gltf.json["accessors"][0]["sparse"]["indices"]["byteOffset"] = 1.into();
    assert!(matches!(read(&gltf.glb()), Err(MeshError::Truncated { .. })));
}

#[test]
fn quantised_positions() {
    let mut gltf = Gltf::tetra();
    let bytes: Vec<u8> = VERTICES
        .iter()
        .flat_map(|v| v.iter().map(|&x| (x * 127.0) as i8 as u8).chain([0]))
        .collect();
    let positions = gltf.accessor("VEC3", 5120, 4, &bytes);
    let view = gltf.json["accessors"][positions]["bufferView"]
        .as_u64()
        .expect("an index") as usize;
    gltf.json["bufferViews"][view]["byteStride"] = 4.into();
    gltf.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    gltf.primitive()["attributes"]["POSITION"] = positions.into();
    assert_eq!(soup(&gltf).vertices[1], [127.0, -127.0, -127.0]);
    gltf.json["accessors"][positions]["normalized"] = true.into();
    assert_eq!(soup(&gltf).vertices, VERTICES);
}

#[test]
fn buffers_come_from_the_file_or_the_upload_only() {
    let gltf = Gltf::tetra();
    let percent: String = gltf.buffer.iter().map(|b| format!("%{b:02x}")).collect();
    let bytes = gltf.with_uri(&format!("data:,{percent}"));
    assert_eq!(corners(&read(&bytes).expect("valid").1), tetra_corners());

    for uri in ["my%20cat.bin", "./my cat.bin", "parts/my%20cat.bin"] {
        let bytes = gltf.with_uri(uri);
        assert_eq!(read(&bytes), Err(MeshError::MissingBuffer { uri: uri.into() }));
        let companion = |name: &str| Companion::new(name, gltf.buffer.clone());
        let companions = [companion("other.bin"), companion("my cat.bin")];
        let source = Source {
            bytes: &bytes,
            companions: &companions,
            ..Source::default()
        };
        let soup = shapelex_core::mesh::read(&source, &Limits::default())
            .expect("valid")
            .1;
        assert_eq!(corners(&soup), tetra_corners(), "{uri}");
    }
    for uri in [
        "file:///etc/hostname",
        "/etc/hostname",
        "../Cargo.toml",
        "http://localhost/x.bin",
    ] {
        let error = read(&gltf.with_uri(uri)).expect_err("not in the upload");
        assert_eq!(error, MeshError::MissingBuffer { uri: uri.into() });
    }
    let error = read(&gltf.with_uri("data:application/octet-stream;base64,!!!")).expect_err("no base64");
    assert!(error.to_string().contains("data URI"), "{error}");
    let error = read(&gltf.with_uri("data:application/octet-stream;base64,AAAA")).expect_err("short");
    assert!(matches!(error, MeshError::Truncated { .. }), "{error}");
}

#[test]
fn required_extensions_are_refused_by_name() {
    for name in ["EXT_mesh_primitive_restart", "KHR_accessor_float64", "VENDOR_new"] {
        let mut gltf = Gltf::tetra();
        gltf.json["extensionsRequired"] = json!(["KHR_materials_unlit", name]);
        let refused = MeshError::Unsupported {
            format: Format::Glb,
            feature: name.into(),
        };
        assert_eq!(read(&gltf.glb()), Err(refused));
    }
}

#[test]
fn hostile_structure_is_refused_precisely() {
    let refused = |change: &dyn Fn(&mut Gltf), words: &str| {
        let mut gltf = Gltf::tetra();
        change(&mut gltf);
        let error = read(&gltf.glb()).expect_err(words);
        assert!(error.to_string().contains(words), "{words}: {error}");
    };
    refused(
        &|g| g.json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"children": [0]}]),
        "circle",
    );
    refused(
        &|g| g.json["nodes"] = json!([{"mesh": 0, "children": [0]}]),
        "circle",
    );
    refused(
        &|g| g.json["nodes"] = json!([{"children": [1, 1]}, {"mesh": 0}]),
        "two parents",
    );
    refused(
        &|g| g.json["nodes"] = json!([{"mesh": 0, "children": [7]}]),
        "node 7, but has 1",
    );
    refused(&|g| g.json["nodes"][0]["mesh"] = 3.into(), "mesh 3, but has 1");
    refused(&|g| g.json["nodes"][0]["skin"] = 0.into(), "skin 0, but has 0");
    refused(&|g| g.json["scene"] = 4.into(), "scene 4, but has 1");
    refused(&|g| g.primitive()["indices"] = 9.into(), "accessor 9, but has 2");
    refused(
        &|g| g.primitive()["attributes"]["POSITION"] = 1.into(),
        "elements of type Scalar",
    );
    refused(&|g| g.primitive()["mode"] = 99.into(), "unknown mode");
    refused(
        &|g| g.json["accessors"][0]["count"] = 5.into(),
        "5 elements need 60 bytes",
    );
    refused(
        &|g| g.json["accessors"][0]["count"] = 4_000_000_000u32.into(),
        "4000000000 vertices",
    );
    refused(
        &|g| g.json["accessors"][1]["count"] = 4_000_000_000u32.into(),
        "1333333333 faces",
    );
    refused(
        &|g| g.json["accessors"][0]["byteOffset"] = u64::MAX.into(),
        "need 18446744073709551615 bytes",
    );
    refused(
        &|g| g.json["bufferViews"][0]["byteOffset"] = u64::MAX.into(),
        "its buffer view needs",
    );
    refused(
        &|g| g.json["bufferViews"][0]["byteLength"] = 1_000_000.into(),
        "its buffer view needs",
    );
    refused(
        &|g| g.json["bufferViews"][0]["byteStride"] = 4.into(),
        "a stride of 4 bytes for elements of 12",
    );
    refused(
        &|g| g.json["bufferViews"][0]["buffer"] = 1.into(),
        "buffer 1, but has 1",
    );
    refused(
        &|g| g.json["accessors"][0]["componentType"] = 1.into(),
        "unknown component",
    );
    // One small accessor drawn by very many nodes.
    let many: Vec<_> = (0..300_000).map(|_| json!({"mesh": 0})).collect();
    let roots: Vec<u32> = (0..300_000).collect();
    let mut gltf = Gltf::tetra();
    gltf.json["nodes"] = many.into();
    gltf.json["scenes"][0]["nodes"] = roots.into();
    let bytes = gltf.glb();
    let limits = Limits {
        max_vertices: 1_000_000,
        ..Limits::default()
    };
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    let error = shapelex_core::mesh::read(&source, &limits).expect_err("too many");
    assert!(
        matches!(error, MeshError::TooLarge { what: "vertices", .. }),
        "{error}"
    );
}

/// The tetrahedron with a joint for its first three vertices and another, half and half with the first, for the last.
fn skinned() -> Gltf {
    let mut gltf = Gltf::tetra();
    let joints = gltf.accessor("VEC4", 5121, 4, &[0, 1, 9, 9, 0, 1, 9, 9, 0, 1, 9, 9, 0, 1, 9, 9]);
    let weights = [1.0, 0.0, 0.0, 0.0].repeat(3);
    let weights = gltf.floats("VEC4", &[weights, vec![0.5, 0.5, 0.0, 0.0]].concat());
    let unit = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    let mut moved = unit;
    moved[12] = -1.0;
    let inverse = gltf.floats("MAT4", &[unit, moved].concat());
    gltf.primitive()["attributes"]["JOINTS_0"] = joints.into();
    gltf.primitive()["attributes"]["WEIGHTS_0"] = weights.into();
    gltf.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": inverse}]);
    gltf.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"children": [2]},
        {"translation": [1, 0, 0]},
    ]);
    gltf.json["scenes"][0]["nodes"] = json!([0, 1]);
    gltf
}

#[test]
fn a_skinned_mesh_follows_its_joints_and_not_its_node() {
    let mut gltf = skinned();
    assert_eq!(soup(&gltf).vertices, VERTICES);
    gltf.json["nodes"][2]["translation"] = json!([1, 4, 0]);
    let moved = soup(&gltf);
    assert_eq!(moved.vertices[..3], VERTICES[..3]);
    assert!(
        close(moved.vertices[3], [-1.0, 1.0, 1.0]),
        "{:?}",
        moved.vertices[3]
    );
    // Joints scaled to nothing: the stored positions, placed by the node.
    gltf.json["nodes"][1]["scale"] = json!([0, 0, 0]);
    assert_eq!(soup(&gltf).vertices[0], [101.0, 1.0, 1.0]);
    // A joint the skin does not have, with a weight.
    let mut gltf = skinned();
    gltf.json["skins"][0]["joints"] = json!([1]);
    let error = read(&gltf.glb()).expect_err("no such joint");
    assert!(error.to_string().contains("joint 1 of a skin with 1"), "{error}");
}

#[test]
fn poses_spread_over_the_clips() {
    let mut gltf = skinned();
    let keys = gltf.floats("SCALAR", &[2.0, 4.0]);
    let up = gltf.floats("VEC3", &[1.0, 0.0, 0.0, 1.0, 8.0, 0.0]);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turn = gltf.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
    gltf.json["animations"] = json!([
        {"name": "Lift", "samplers": [{"input": keys, "output": up}],
         "channels": [{"sampler": 0, "target": {"node": 2, "path": "translation"}}]},
        {"samplers": [{"input": keys, "output": turn, "interpolation": "STEP"}],
         "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]},
    ]);
    let poses = poses(&gltf, 3).expect("poses");
    let labels: Vec<&str> = poses.iter().map(|p| p.label.as_str()).collect();
    assert_eq!(labels, ["Lift@0.50", "clip1@0.25", "clip1@0.75"]);
    // Half weight of half the lift of 8.
    assert!(close(poses[0].soup.vertices[3], [-1.0, 1.0, 1.0]));
    assert_eq!(poses[1].soup.vertices, VERTICES);
    assert_eq!(poses[0].soup.faces, FACES);
    let many = Limits::default().max_poses + 1;
    let error = self::poses(&gltf, many).expect_err("too many");
    assert!(
        matches!(error, MeshError::TooLarge { what: "poses", .. }),
        "{error}"
    );
}

#[test]
fn morph_targets_at_rest_and_in_poses() {
    let mut gltf = Gltf::tetra();
    let mut shift = [0.0; 12];
    shift[9..12].copy_from_slice(&[0.0, 0.0, 4.0]);
    let target = gltf.floats("VEC3", &shift);
    let keys = gltf.floats("SCALAR", &[0.0, 1.0]);
    let weights = gltf.floats("SCALAR", &[0.0, 1.0]);
    gltf.primitive()["targets"] = json!([{"POSITION": target}]);
    assert_eq!(soup(&gltf).vertices, VERTICES);
    gltf.json["meshes"][0]["weights"] = json!([0.25]);
    assert_eq!(soup(&gltf).vertices[3], [-1.0, -1.0, 2.0]);
    gltf.json["nodes"][0]["weights"] = json!([1.0]);
    assert_eq!(soup(&gltf).vertices[3], [-1.0, -1.0, 5.0]);
    gltf.json["animations"] = json!([
        {"name": "Grow", "samplers": [{"input": keys, "output": weights}],
         "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]},
    ]);
    let found = poses(&gltf, 2).expect("poses");
    let heights: Vec<f64> = found.iter().map(|p| p.soup.vertices[3][2]).collect();
    assert_eq!(heights, [2.0, 4.0]);
}

#[test]
fn poses_need_an_animation() {
    assert_eq!(poses(&Gltf::tetra(), 4).err(), Some(MeshError::NoAnimation));
    let bytes = fixture("tetra.obj");
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    let refused = shapelex_core::mesh::read_poses(&source, 4, &Limits::default());
    assert_eq!(refused.err(), Some(MeshError::NoAnimation));
}
