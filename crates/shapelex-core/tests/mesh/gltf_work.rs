//! What reading a glTF may cost: work is counted as a product before it is done, memory is reserved before it is
//! taken, and a stop is seen at once.

use crate::encode::*;
use serde_json::{Value, json};
use shapelex_core::cancel::Cancel;
use shapelex_core::memory::{MemoryBudget, MemoryError};
use shapelex_core::mesh::{Limits, MeshError, ReadContext, Source};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A grid of `side`² vertices whose mesh has many morph targets, all of them the grid itself and all with a weight.
fn morphing(side: u32, targets: usize) -> Vec<u8> {
    let mut gltf = Gltf::new();
    let points: Vec<f64> = (0..side * side)
        .flat_map(|k| [f64::from(k % side), f64::from(k / side), f64::from(k % 7)])
        .collect();
    let positions = gltf.floats("VEC3", &points);
    let corners: Vec<u8> = (0..side - 1)
        .flat_map(|y| (0..side - 1).map(move |x| y * side + x))
        .flat_map(|k| [k, k + 1, k + side])
        .flat_map(u32::to_le_bytes)
        .collect();
    let indices = gltf.accessor("SCALAR", 5125, corners.len() / 4, &corners);
    let primitive = gltf.primitive();
    primitive["attributes"]["POSITION"] = positions.into();
    primitive["indices"] = indices.into();
    primitive["targets"] = vec![json!({"POSITION": positions}); targets].into();
    gltf.json["meshes"][0]["weights"] = vec![json!(1e-6); targets].into();
    gltf.glb()
}

fn source(bytes: &[u8]) -> Source<'_> {
    Source {
        bytes,
        ..Source::default()
    }
}

#[test]
fn a_stop_is_seen_within_a_tenth_of_a_second() {
    // Hundreds of milliseconds of work, more where other work runs beside it.
    let bytes = morphing(700, 320);
    // The time between two looks is the machine's too, so the best of a few attempts counts.
    let stopped_after = (0..4).map(|_| {
        let context = ReadContext {
            cancel: Cancel::new(),
            ..ReadContext::new(Limits::default())
        };
        let flag = context.cancel.clone();
        let stop = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            flag.cancel();
            Instant::now()
        });
        let result = shapelex_core::mesh::read_within(&source(&bytes), &context);
        let returned = Instant::now();
        let set = stop.join().expect("a thread that sets the flag");
        assert!(
            matches!(result, Err(MeshError::Cancelled(_))),
            "{:?}",
            result.err()
        );
        returned.saturating_duration_since(set)
    });
    let best = stopped_after.min().expect("attempts");
    assert!(best < Duration::from_millis(100), "stopped after {best:?}");
}

/// The refusal of a file by the number of its steps, and what they would have done.
fn steps(what: &str, bytes: &[u8], poses: Option<usize>) -> String {
    let limits = Limits::default();
    let error = match poses {
        None => shapelex_core::mesh::read(&source(bytes), &limits).err(),
        Some(poses) => shapelex_core::mesh::read_poses(&source(bytes), poses, &limits).err(),
    };
    match error {
        Some(MeshError::TooLarge { what, found, limit }) if found > limit => what.to_owned(),
        other => panic!("{what}: {other:?}"),
    }
}

#[test]
fn products_are_refused_before_they_are_worked_out() {
    let targets = steps("targets × vertices", &morphing(1000, 500), None);
    assert_eq!(targets, "steps of applying its morph targets to its vertices");

    // 60 000 primitives that are drawn with an accessor whose text is long.
    let mut gltf = Gltf::tetra();
    gltf.json["accessors"][1]["name"] = "x".repeat(100_000).into();
    let primitive = gltf.primitive().clone();
    gltf.json["meshes"][0]["primitives"] = vec![primitive; 60_000].into();
    assert_eq!(
        steps("primitives × text", &gltf.glb(), None),
        "steps of reading its JSON"
    );

    // A clip of 60 000 channels with 100 000 keys each.
    let mut gltf = Gltf::tetra();
    let keys: Vec<f64> = (0..100_000).map(f64::from).collect();
    let values = vec![0.0; 300_000];
    let values = gltf.floats("VEC3", &values);
    let bytes: Vec<u8> = keys.iter().flat_map(|k| (*k as f32).to_le_bytes()).collect();
    let view = gltf.view(&bytes);
    let inputs: Vec<Value> = (0..60_000)
        .map(|_| json!({"bufferView": view, "componentType": 5126, "type": "SCALAR", "count": 100_000}))
        .collect();
    let first = gltf.json["accessors"].as_array().expect("a list").len();
    gltf.json["accessors"]
        .as_array_mut()
        .expect("a list")
        .extend(inputs);
    let samplers: Vec<Value> = (0..60_000)
        .map(|k| json!({"input": first + k, "output": values}))
        .collect();
    let channels: Vec<Value> = (0..60_000)
        .map(|k| json!({"sampler": k, "target": {"node": 0, "path": "translation"}}))
        .collect();
    gltf.json["animations"] = json!([{"samplers": samplers, "channels": channels}]);
    let channels = steps("channels × keys", &gltf.glb(), Some(64));
    assert_eq!(channels, "steps of reading its animation");

    // Many sparse accessors of many zeros, open at the same time.
    let mut gltf = Gltf::tetra();
    let (at, values) = (gltf.view(&[1]), gltf.view(&[0; 12]));
    let sparse = json!({
        "componentType": 5126, "type": "VEC3", "count": 2_000_000,
        "sparse": {"count": 1, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}},
    });
    let primitives: Vec<Value> = (2..1002)
        .map(|k| json!({"attributes": {"POSITION": k}, "indices": 1}))
        .collect();
    gltf.json["accessors"]
        .as_array_mut()
        .expect("a list")
        .extend(vec![sparse; 1000]);
    gltf.json["meshes"][0]["primitives"] = primitives.into();
    assert_eq!(
        steps("sparse accessors", &gltf.glb(), None),
        "bytes in sparse accessors"
    );
}

#[test]
fn memory_is_reserved_before_it_is_taken_and_given_back() {
    let bytes = morphing(300, 3);
    let budget = MemoryBudget::new(1 << 30);
    let context = |budget: &MemoryBudget| ReadContext {
        memory: Arc::new(budget.reservation()),
        ..ReadContext::new(Limits::default())
    };
    let granted = context(&budget);
    let (_, soup) = shapelex_core::mesh::read_within(&source(&bytes), &granted).expect("a mesh");
    // Only the mesh is left.
    let kept = 24 * soup.vertices.len() as u64 + 12 * soup.faces.len() as u64;
    assert_eq!(granted.memory.bytes(), kept);
    drop(granted);
    assert_eq!(budget.used(), 0);

    let mut refused = 0;
    for share in 1..40 {
        let small = MemoryBudget::new(kept * share / 10);
        let context = context(&small);
        match shapelex_core::mesh::read_within(&source(&bytes), &context) {
            Ok((_, again)) => assert_eq!(again, soup),
            Err(MeshError::Memory(MemoryError::NeverFits { .. })) => refused += 1,
            Err(other) => panic!("{other}"),
        }
        drop(context);
        assert_eq!(small.used(), 0);
    }
    assert!((10..39).contains(&refused), "{refused} budgets were too small");
}
