//! glTF files and the buffers that lie beside them.

use crate::{answer, last_json, repository, run, stderr};
use std::path::Path;

/// Copies the cases of `tests/data`, so that a test may change them.
fn cases(dir: &Path) {
    let from = repository("tests/data/mesh/cases/gltf");
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, dir.join(path.file_name().unwrap())).unwrap();
    }
}

fn faces_and_area(dir: &Path, file: &str) -> (u64, f64) {
    let report = last_json(&answer(dir, &["inspect", "--json", file]))["report"].clone();
    (
        report["input_faces"].as_u64().unwrap(),
        report["area"].as_f64().unwrap(),
    )
}

#[test]
fn external_buffers_are_found_beside_the_file() {
    let dir = tempfile::tempdir().unwrap();
    cases(dir.path());
    for file in [
        "dot_slash_uri.gltf",
        "percent uri.gltf",
        "bom_external.gltf",
        "external_bin.glb",
    ] {
        let (faces, area) = faces_and_area(dir.path(), file);
        assert!(
            faces == 8 && (area - 6.928203).abs() < 1e-4,
            "{file}: {faces} faces, area {area}"
        );
    }
    let text = std::fs::read_to_string(dir.path().join("dot_slash_uri.gltf")).unwrap();
    std::fs::create_dir(dir.path().join("parts")).unwrap();
    std::fs::copy(
        dir.path().join("plain.bin"),
        dir.path().join("parts/müde 100%.bin"),
    )
    .unwrap();
    for uri in [
        "parts/m%C3%BCde%20100%25.bin",
        "parts\\\\müde 100%.bin",
        "./parts/../parts/müde 100%25.bin",
        "C:\\\\models\\\\plain.bin",
        "../plain.bin",
    ] {
        std::fs::write(dir.path().join("sibling.gltf"), text.replace("./plain.bin", uri)).unwrap();
        assert_eq!(faces_and_area(dir.path(), "sibling.gltf").0, 8, "{uri}");
    }
}

#[test]
fn a_missing_buffer_says_where_it_belongs() {
    let dir = tempfile::tempdir().unwrap();
    cases(dir.path());
    std::fs::remove_file(dir.path().join("plain.bin")).unwrap();
    let output = run(dir.path(), &["inspect", "external_bin.glb"]);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(
        message.contains("'plain.bin'") && message.contains("put it there"),
        "{message}"
    );
}

#[test]
fn compressed_files_are_read() {
    let dir = tempfile::tempdir().unwrap();
    cases(dir.path());
    for file in [
        "draco_edgebreaker.glb",
        "draco_skinned.glb",
        "meshopt_quantised.glb",
        "meshopt_khr_animated.glb",
    ] {
        assert_eq!(faces_and_area(dir.path(), file).0, 512, "{file}");
    }
    let poses = answer(
        dir.path(),
        &["inspect", "--json", "--poses", "3", "meshopt_khr_animated.glb"],
    );
    assert_eq!(poses.lines().count(), 3, "{poses}");
    let turned = last_json(&poses);
    assert!(
        (turned["report"]["area"].as_f64().unwrap() - 12.408184).abs() < 1e-2,
        "{turned}"
    );
}

#[test]
fn instances_are_warned_of() {
    let dir = tempfile::tempdir().unwrap();
    cases(dir.path());
    let text = std::fs::read_to_string(dir.path().join("dot_slash_uri.gltf")).unwrap();
    let instanced = text.replace(
        "{\"mesh\": 0}",
        "{\"mesh\": 0, \"extensions\": {\"EXT_mesh_gpu_instancing\": {\"attributes\": {\"TRANSLATION\": 0}}}}",
    );
    assert_ne!(instanced, text);
    std::fs::write(dir.path().join("instanced.gltf"), instanced).unwrap();
    let shown = stderr(&run(dir.path(), &["inspect", "instanced.gltf"]));
    assert!(shown.contains("one copy of each was read"), "{shown}");
}
