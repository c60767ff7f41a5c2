//! The gltf crate as a second reader: on valid files both give the same triangles.

use crate::encode::*;
use serde_json::json;

/// The triangles of the default scene, as the gltf crate reads them.
fn by_the_crate(bytes: &[u8]) -> Vec<[[f64; 3]; 3]> {
    let gltf = gltf::Gltf::from_slice(bytes).expect("a valid file");
    let blob = gltf.blob.as_deref();
    let mut triangles = Vec::new();
    let identity = std::array::from_fn(|c| std::array::from_fn(|r| f64::from(u8::from(c == r))));
    for node in gltf.default_scene().expect("a scene").nodes() {
        visit(&node, &identity, blob, &mut triangles);
    }
    triangles
}

type Matrix = [[f64; 4]; 4];

fn visit(node: &gltf::Node<'_>, parent: &Matrix, blob: Option<&[u8]>, triangles: &mut Vec<[[f64; 3]; 3]>) {
    let local = node.transform().matrix().map(|column| column.map(f64::from));
    let global: Matrix =
        std::array::from_fn(|c| std::array::from_fn(|r| (0..4).map(|k| parent[k][r] * local[c][k]).sum()));
    for primitive in node.mesh().iter().flat_map(|m| m.primitives()) {
        let reader = primitive.reader(|_| blob);
        let points: Vec<[f64; 3]> = reader
            .read_positions()
            .expect("positions")
            .map(|p| p.map(f64::from))
            .map(|p| std::array::from_fn(|r| (0..3).map(|k| global[k][r] * p[k]).sum::<f64>() + global[3][r]))
            .collect();
        let corners: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..points.len() as u32).collect(),
        };
        triangles.extend(
            corners
                .chunks_exact(3)
                .map(|f| std::array::from_fn(|k| points[f[k] as usize])),
        );
    }
    for child in node.children() {
        visit(&child, &global, blob, triangles);
    }
}

fn assert_equal(what: &str, gltf: &Gltf) {
    let bytes = gltf.glb();
    let ours = corners(&read(&bytes).unwrap_or_else(|error| panic!("{what}: {error}")).1);
    let theirs = by_the_crate(&bytes);
    assert_eq!(ours.len(), theirs.len(), "{what}");
    for (a, b) in ours
        .iter()
        .flatten()
        .flatten()
        .zip(theirs.iter().flatten().flatten())
    {
        assert!((a - b).abs() <= 1e-5 * (1.0 + b.abs()), "{what}: {a} and {b}");
    }
}

/// A valid accessor of positions has bounds.
fn bounded(gltf: &mut Gltf) {
    gltf.json["accessors"][0]["min"] = json!([-1, -1, -1]);
    gltf.json["accessors"][0]["max"] = json!([9, 9, 9]);
}

#[test]
fn two_readers_agree_on_valid_files() {
    let mut plain = Gltf::tetra();
    bounded(&mut plain);
    assert_equal("a tetrahedron", &plain);

    let mut placed = Gltf::tetra();
    bounded(&mut placed);
    placed.json["nodes"] = json!([
        {"children": [1, 2], "translation": [1, 2, 3], "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [1, 2, 0.5]},
        {"mesh": 0, "rotation": [0, 0.6, 0, 0.8]},
        {"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1]},
    ]);
    assert_equal("nodes", &placed);

    for (component, width) in [(5121, 1), (5123, 2), (5125, 4)] {
        let mut gltf = Gltf::tetra();
        bounded(&mut gltf);
        let bytes: Vec<u8> = FACES
            .iter()
            .flatten()
            .flat_map(|k| k.to_le_bytes().into_iter().take(width))
            .collect();
        let indices = gltf.accessor("SCALAR", component, 12, &bytes);
        gltf.primitive()["indices"] = indices.into();
        assert_equal("index types", &gltf);
    }

    let mut sparse = Gltf::tetra();
    bounded(&mut sparse);
    let at = sparse.view(&[1, 3]);
    let values: Vec<u8> = [9f32, 8.0, 7.0, 6.0, 5.0, 4.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let values = sparse.view(&values);
    sparse.json["accessors"][0]["sparse"] = json!({
        "count": 2, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values},
    });
    assert_equal("a sparse accessor", &sparse);

    let mut interleaved = Gltf::tetra();
    bounded(&mut interleaved);
    let bytes: Vec<u8> = VERTICES
        .iter()
        .flat_map(|v| {
            [7.0, v[0], v[1], v[2], 0.0]
                .into_iter()
                .flat_map(|x| (x as f32).to_le_bytes())
        })
        .collect();
    let view = interleaved.view(&bytes);
    interleaved.json["bufferViews"][view]["byteStride"] = 20.into();
    interleaved.json["accessors"][0]["bufferView"] = view.into();
    interleaved.json["accessors"][0]["byteOffset"] = 4.into();
    assert_equal("interleaved vertices", &interleaved);
}
