//! glTF files with one trait each that bug reports describe, and their siblings: what is read out of them.

use crate::encode::*;
use serde_json::{Value, json};
use shapelex_core::memory::MemoryBudget;
use shapelex_core::mesh::gltf::external_buffers;
use shapelex_core::mesh::{Companion, Format, Limits, MeshError, ReadContext, Source, TriangleSoup};

/// Reads a file of `tests/data/mesh/cases/gltf` with the buffers that lie beside it.
fn read_case(name: &str) -> Result<TriangleSoup, MeshError> {
    let folder = shapelex_testing::data("mesh/cases/gltf");
    let bytes = std::fs::read(folder.join(name)).expect("a case");
    let companions: Vec<Companion> = external_buffers(&bytes, &MemoryBudget::unlimited().reservation())
        .expect("memory is not limited")
        .iter()
        .filter_map(|uri| {
            let contents = uri
                .candidates()
                .find_map(|p| std::fs::read(folder.join(p)).ok())?;
            Some(Companion::new(uri.path(), contents))
        })
        .collect();
    let source = Source {
        bytes: &bytes,
        companions: &companions,
        ..Source::default()
    };
    shapelex_core::mesh::read(&source, &Limits::default()).map(|r| r.1)
}

fn area(soup: &TriangleSoup) -> f64 {
    corners(soup)
        .iter()
        .map(|[a, b, c]| {
            let [u, v]: [[f64; 3]; 2] = [b, c].map(|p| std::array::from_fn(|k| p[k] - a[k]));
            let cross: [f64; 3] =
                std::array::from_fn(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]);
            cross.iter().map(|x| x * x).sum::<f64>().sqrt() / 2.0
        })
        .sum()
}

/// The octahedron: 6 vertices, 8 faces, edges of length √2.
const OCTAHEDRON: (usize, usize, f64) = (6, 8, 6.928203);
/// A ball of 512 faces that approximate the unit sphere.
const BALL: (usize, usize, f64) = (258, 512, 12.408184);

#[test]
fn every_case_has_its_right_value() {
    let octahedra = [
        "anim_no_node.gltf",
        "basecolor3.gltf",
        "bom_external.gltf",
        "bytestride_0.gltf",
        "camera_incomplete.gltf",
        "data_uri_DATA.gltf",
        "dot_slash_uri.gltf",
        "external_bin.glb",
        "extras_1.gltf",
        "invalid_utf8_name.gltf",
        "json_nul_padding.glb",
        "json_only_trailing.glb",
        "percent uri.gltf",
        "required_EXT_mesh_features.gltf",
        "required_KHR_techniques_webgl.gltf",
        "scene_without_nodes.gltf",
        "unknown_chunk_no_bin.glb",
    ];
    let balls = [
        ("draco_edgebreaker.glb", 2e-3),
        ("draco_valence.glb", 2e-3),
        ("draco_sequential.glb", 1e-5),
        ("meshopt_plain.glb", 1e-5),
        ("meshopt_quantised.glb", 1e-3),
        ("meshopt_exponential.glb", 1e-4),
        ("meshopt_khr_animated.glb", 1e-3),
    ];
    let cases = octahedra
        .map(|name| (name, OCTAHEDRON, 1e-5))
        .into_iter()
        .chain(balls.map(|(name, tolerance)| (name, BALL, tolerance)))
        // Each vertex is raised by its weight (z + 1) / 2 for a joint that stands 1 higher.
        .chain([("draco_skinned.glb", (258, 512, 16.706633), 1e-2)]);
    let mut wrong = Vec::new();
    for (name, (vertices, faces, expected), tolerance) in cases {
        match read_case(name) {
            Ok(soup)
                if (soup.vertices.len(), soup.faces.len()) == (vertices, faces)
                    && (area(&soup) - expected).abs() < tolerance => {}
            Ok(soup) => wrong.push(format!(
                "{name}: {} vertices, {} faces, area {}",
                soup.vertices.len(),
                soup.faces.len(),
                area(&soup)
            )),
            Err(error) => wrong.push(format!("{name}: {error}")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The tetrahedron with a part changed, which must not change what is read.
fn unchanged(what: &str, change: impl FnOnce(&mut Value)) {
    let mut gltf = Gltf::tetra();
    change(&mut gltf.json);
    for bytes in [gltf.glb(), gltf.embedded()] {
        match read(&bytes) {
            Ok((_, soup)) => assert_eq!(corners(&soup), tetra_corners(), "{what}"),
            Err(error) => panic!("{what}: {error}"),
        }
    }
}

#[test]
fn what_has_no_shape_may_be_anything() {
    unchanged("lists of things without a shape", |g| {
        for list in ["materials", "cameras", "images", "textures", "samplers"] {
            g[list] = json!([7, null, {"name": 3}, []]);
        }
        g["extensions"] = json!("none");
        g["extensionsUsed"] = json!({"a": 1});
    });
    unchanged("references to things without a shape", |g| {
        g["nodes"][0]["camera"] = json!(-1);
        g["nodes"][0]["name"] = json!(["not a string"]);
        g["meshes"][0]["primitives"][0]["material"] = json!("red");
        g["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(99);
        g["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!("u");
    });
    for extras in [
        json!("note"),
        json!(1.5),
        json!([1]),
        json!(null),
        json!({"a": {"b": []}}),
    ] {
        unchanged("extras", |g| {
            for (list, k) in [
                ("nodes", 0),
                ("meshes", 0),
                ("accessors", 1),
                ("bufferViews", 0),
                ("scenes", 0),
            ] {
                g[list][k]["extras"] = extras.clone();
            }
            g["extras"] = extras.clone();
            g["asset"]["extras"] = extras.clone();
        });
    }
    unchanged("an asset without a version", |g| g["asset"] = json!("mine"));
    unchanged("null where a part is left out", |g| {
        g["nodes"][0]["skin"] = json!(null);
        g["nodes"][0]["children"] = json!(null);
        g["nodes"][0]["matrix"] = json!(null);
        g["accessors"][0]["sparse"] = json!(null);
        g["skins"] = json!(null);
        g["animations"] = json!(null);
    });
    unchanged("whole numbers with a point", |g| {
        g["nodes"][0]["mesh"] = json!(0.0);
        g["accessors"][0]["count"] = json!(4.0);
        g["scene"] = json!(0.0);
    });
    unchanged("elements that nothing refers to", |g| {
        g["accessors"]
            .as_array_mut()
            .expect("a list")
            .push(json!({"count": "many"}));
        g["bufferViews"].as_array_mut().expect("a list").push(json!(5));
        g["meshes"]
            .as_array_mut()
            .expect("a list")
            .push(json!({"primitives": 1}));
        g["skins"] = json!([{"joints": "all"}]);
        g["animations"] = json!([{"channels": [{}], "samplers": [1]}, 3]);
        g["scenes"]
            .as_array_mut()
            .expect("a list")
            .push(json!({"nodes": "x"}));
    });
}

#[test]
fn names_may_be_no_text_at_all() {
    let text = String::from_utf8(Gltf::tetra().embedded()).expect("JSON");
    let named = |name: &str| text.replace("\"mesh\":0", &format!("\"mesh\":0,\"name\":\"{name}\""));
    assert_ne!(named("x"), text);
    for name in ["\\ud800", "\\udc00 \\ud83d", "a\\u0000b"] {
        assert_eq!(
            corners(&read(named(name).as_bytes()).expect(name).1),
            tetra_corners()
        );
    }
    let mut latin = named("?").into_bytes();
    let at = latin.iter().position(|b| *b == b'?').expect("the name");
    latin.splice(at..=at, [0xe9, 0xff, 0xc3]);
    assert_eq!(corners(&read(&latin).expect("latin").1), tetra_corners());
}

#[test]
fn channels_that_move_nothing_are_passed_over() {
    let mut gltf = Gltf::tetra();
    let keys = gltf.floats("SCALAR", &[0.0, 1.0]);
    let up = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 8.0, 0.0]);
    let sampler = json!({"input": keys, "output": up});
    let idle = [
        json!({"sampler": 0, "target": {"path": "translation"}}),
        json!({"sampler": 0, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/x"}}}}),
        json!({"sampler": 9, "target": {"node": 0, "path": "blink"}}),
        json!({"target": 1}),
    ];
    gltf.json["animations"] = json!([{"samplers": [sampler], "channels": idle}]);
    let poses = |gltf: &Gltf| {
        let bytes = gltf.glb();
        let source = Source {
            bytes: &bytes,
            ..Source::default()
        };
        shapelex_core::mesh::read_poses(&source, 1, &Limits::default()).map(|r| r.1)
    };
    assert_eq!(poses(&gltf).err(), Some(MeshError::NoAnimation));
    assert_eq!(corners(&read(&gltf.glb()).expect("a mesh").1), tetra_corners());
    let mut channels = idle.to_vec();
    channels.push(json!({"sampler": 1, "target": {"node": 0, "path": "translation"}}));
    // The sampler of the channels that move nothing cannot be read.
    gltf.json["animations"] = json!([
        {"name": "Up \\ud800", "samplers": [{"input": "x"}, sampler], "channels": channels}
    ]);
    let found = poses(&gltf).expect("a pose");
    assert_eq!(found[0].soup.vertices[0], [1.0, 5.0, 1.0]);
}

#[test]
fn data_uris_in_every_spelling() {
    let gltf = Gltf::tetra();
    let uri = |bytes: &[u8]| {
        let json: Value = serde_json::from_slice(bytes).expect("JSON");
        json["buffers"][0]["uri"].as_str().expect("a URI").to_owned()
    };
    let plain = uri(&gltf.embedded());
    let data = plain.split_once(',').expect("data").1.to_owned();
    for uri in [
        plain.replace("data:", "DATA:"),
        plain.replace(";base64", ";BASE64"),
        plain.replace(";base64", ";Base64 "),
        format!("data:;base64,{}", data.trim_end_matches('=')),
        format!("data:;base64,{}", data.replace('+', "-").replace('/', "_")),
        format!("data:;base64,{}", data.replace('/', "%2F").replace('=', "%3d")),
        format!("data:;base64,{}\n{}", &data[..8], &data[8..]),
        format!("data:application/gltf-buffer;charset=x;base64,{data}"),
    ] {
        let found = read(&gltf.with_uri(&uri)).unwrap_or_else(|error| panic!("{uri}: {error}"));
        assert_eq!(corners(&found.1), tetra_corners(), "{uri}");
    }
    let escaped = String::from_utf8(gltf.with_uri(&plain))
        .expect("JSON")
        .replace('/', "\\/");
    assert_eq!(
        corners(&read(escaped.as_bytes()).expect("escapes").1),
        tetra_corners()
    );
}

#[test]
fn glb_chunks_paddings_and_tails() {
    let glb = Gltf::tetra().glb();
    let expect = |what: &str, bytes: &[u8]| {
        let found = read(bytes).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(corners(&found.1), tetra_corners(), "{what}");
    };
    let json_end = 20 + u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize;
    let sized = |mut bytes: Vec<u8>| {
        let length = bytes.len() as u32;
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        bytes
    };
    let with = |at: usize, extra: &[u8]| [&glb[..at], extra, &glb[at..]].concat();
    let unknown = b"\x04\0\0\0XTRAabcd";
    expect("an unknown chunk at the end", &sized(with(glb.len(), unknown)));
    expect("an unknown chunk in the middle", &sized(with(json_end, unknown)));
    expect("an unknown chunk at the beginning", &sized(with(12, unknown)));
    expect("an empty chunk", &sized(with(json_end, b"\0\0\0\0XTRA")));
    for tail in [
        &b"\n"[..],
        b"\0\0\0\0\0\0\0\0\0\0",
        b"trailing words of any length",
    ] {
        expect("bytes after the file", &with(glb.len(), tail));
    }
    for generator in ["", "a", "bc", "def"] {
        let mut gltf = Gltf::tetra();
        gltf.json["asset"]["generator"] = generator.into();
        let mut bytes = gltf.glb();
        let end = bytes.windows(4).position(|w| w == b"BIN\0").expect("a chunk") - 4;
        for byte in bytes[..end].iter_mut().rev().take_while(|b| **b == b' ') {
            *byte = 0;
        }
        expect("NULs after the JSON", &bytes);
    }
    let mut wrong_length = glb.clone();
    wrong_length[8..12].copy_from_slice(&(json_end as u32).to_le_bytes());
    expect("a length without the binary chunk", &wrong_length);
    let text = Gltf::tetra().embedded();
    expect("NULs and a newline after JSON", &[&text[..], b"\0\0\n"].concat());
    expect(
        "a byte order mark before JSON",
        &[b"\xef\xbb\xbf", &text[..]].concat(),
    );
}

#[test]
fn vertices_are_counted_as_they_are_used() {
    // A library of 150 000 vertices, of which each of 30 meshes uses three.
    let mut gltf = Gltf::new();
    let many = 150_000;
    let positions: Vec<f64> = (0..many)
        .flat_map(|k| [f64::from(k), f64::from(k % 7), 1.0])
        .collect();
    let positions = gltf.floats("VEC3", &positions);
    let mut meshes = Vec::new();
    for k in 0..30u32 {
        let bytes: Vec<u8> = [k, k + 1000, k + 140_000]
            .iter()
            .flat_map(|i| i.to_le_bytes())
            .collect();
        let indices = gltf.accessor("SCALAR", 5125, 3, &bytes);
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": positions}, "indices": indices}]}));
    }
    gltf.json["meshes"] = meshes.into();
    gltf.json["nodes"] = (0..30).map(|k| json!({"mesh": k})).collect();
    gltf.json["scenes"] = json!([{"nodes": (0..30).collect::<Vec<u32>>()}]);
    let bytes = gltf.glb();
    let soup = read(&bytes).expect("30 triangles").1;
    assert_eq!((soup.vertices.len(), soup.faces.len()), (90, 30));
    assert_eq!(
        corners(&soup)[29],
        [[29.0, 1.0, 1.0], [1029.0, 0.0, 1.0], [140_029.0, 1.0, 1.0]]
    );
    // More vertices than a mesh may have, as long as faces do not use them.
    let limits = Limits {
        max_vertices: 90,
        ..Limits::default()
    };
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    assert!(shapelex_core::mesh::read(&source, &limits).is_ok());
    let limits = Limits {
        max_vertices: 89,
        ..limits
    };
    let refused = shapelex_core::mesh::read(&source, &limits).expect_err("one more than allowed");
    assert!(
        matches!(
            refused,
            MeshError::TooLarge {
                what: "vertices",
                found: 90,
                ..
            }
        ),
        "{refused}"
    );
    // One that no face uses need not be a number.
    let mut gltf = Gltf::tetra();
    let mut positions = VERTICES.concat();
    positions.extend([f64::NAN, 0.0, f64::INFINITY]);
    let positions = gltf.floats("VEC3", &positions);
    gltf.primitive()["attributes"]["POSITION"] = positions.into();
    assert_eq!(soup_of(&gltf).vertices, VERTICES);
}

fn soup_of(gltf: &Gltf) -> TriangleSoup {
    read(&gltf.glb()).expect("a mesh").1
}

#[test]
fn messages_say_what_happened_and_what_to_do() {
    let message = |bytes: &[u8]| read(bytes).expect_err("refused").to_string();
    let mut gltf = Gltf::tetra();
    gltf.json["scenes"] = json!([{}]);
    assert_eq!(read(&gltf.glb()).err(), Some(MeshError::EmptyScene { meshes: 1 }));
    assert!(message(&gltf.glb()).contains("shows none of its 1 meshes"));
    for asset in [json!({"version": "1.0"}), json!({"version": "1.1"})] {
        gltf.json["asset"] = asset;
        let refused = message(&gltf.glb());
        assert!(
            refused.contains("needs glTF 1.0") && refused.contains("export it as glTF 2.0"),
            "{refused}"
        );
    }
    let named = br#"{"scene": "s", "meshes": {"mesh_1": {"primitives": []}}, "buffers": {}}"#;
    let named = read_as(named, Some(Format::Gltf)).expect_err("lists by name");
    assert!(named.to_string().contains("glTF 1.0"), "{named}");
    let mut old = Gltf::tetra().glb();
    old[4] = 1;
    assert!(message(&old).contains("glTF 1.0"));
    let missing = message(&Gltf::tetra().with_uri("a%20b.bin"));
    assert!(
        missing.contains("'a%20b.bin'") && missing.contains("beside the file"),
        "{missing}"
    );
    let error = message(&{
        let mut gltf = Gltf::tetra();
        gltf.json["accessors"][0]
            .as_object_mut()
            .expect("an object")
            .remove("count");
        gltf.glb()
    });
    assert!(error.ends_with("accessor 0: missing field `count`"), "{error}");
}

#[test]
fn instances_count_as_one_copy_with_a_warning_and_hidden_nodes_are_left_out() {
    let mut gltf = Gltf::tetra();
    gltf.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    gltf.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}});
    let bytes = gltf.glb();
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    let context = ReadContext::new(Limits::default());
    let (_, soup) = shapelex_core::mesh::read_within(&source, &context).expect("one copy");
    assert_eq!(corners(&soup), tetra_corners());
    let warnings = context.warnings.list();
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("one copy of each was read"), "{warnings:?}");

    let mut gltf = Gltf::tetra();
    gltf.json["extensionsRequired"] = json!(["KHR_node_visibility"]);
    gltf.json["nodes"] = json!([
        {"mesh": 0, "children": [1]},
        {"extensions": {"KHR_node_visibility": {"visible": false}}, "children": [2], "mesh": 0},
        {"mesh": 0},
    ]);
    assert_eq!(corners(&soup_of(&gltf)), tetra_corners());
}

#[test]
fn broken_compression_is_refused() {
    let folder = shapelex_testing::data("mesh/cases/gltf");
    for name in [
        "draco_edgebreaker.glb",
        "meshopt_plain.glb",
        "meshopt_khr_animated.glb",
    ] {
        let bytes = std::fs::read(folder.join(name)).expect("a case");
        let json = 20 + u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
        // The stream's first byte names the codec and its version.
        let mut broken = bytes.clone();
        broken[json + 8] ^= 0xff;
        let error = read(&broken).expect_err(name);
        assert!(
            matches!(
                error,
                MeshError::Malformed {
                    format: Format::Glb,
                    ..
                }
            ),
            "{name}: {error}"
        );
        assert!(error.to_string().contains("compression"), "{name}: {error}");
    }
    let replace = |name: &str, from: &str, to: &str| {
        let bytes = std::fs::read(folder.join(name)).expect("a case");
        assert_eq!(from.len(), to.len());
        let at = bytes
            .windows(from.len())
            .position(|w| w == from.as_bytes())
            .expect(from);
        let mut changed = bytes.clone();
        changed[at..at + to.len()].copy_from_slice(to.as_bytes());
        read(&changed).expect_err(to).to_string()
    };
    let mode = replace(
        "meshopt_plain.glb",
        "\"mode\":\"ATTRIBUTES\"",
        "\"mode\":\"ATTRACTION\"",
    );
    assert!(mode.contains("unknown mode `ATTRACTION`"), "{mode}");
    let stride = replace(
        "meshopt_plain.glb",
        "\"byteStride\":12,\"count\"",
        "\"byteStride\":13,\"count\"",
    );
    assert!(stride.contains("258 elements of 13 bytes"), "{stride}");
}
