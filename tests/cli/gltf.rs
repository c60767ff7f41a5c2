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

#[test]
fn stored_shapes_and_poses_are_queried() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    crate::small_zoo(path);
    answer(path, &["index", "shapes", "--preset", "fast"]);
    let classes = last_json(&answer(path, &["classes", "list", "--json"]));
    let class = classes["name"].as_str().unwrap();
    let shape = last_json(&answer(path, &["shapes", "list", class, "--json"]));
    let id = shape["id"].as_str().unwrap();
    let named = format!("{class}/{id}");
    let stored = last_json(&answer(path, &["query", "--shape", &named, "--json"]));
    assert_eq!(stored["shape"], named);
    assert_eq!(stored["classes"][0]["class"]["name"], class);
    let both = answer(path, &["query", "--shape", id, "--shape", &named]);
    assert!(both.contains("2 of 2 meshes answered"), "{both}");
    assert!(both.contains("\nmesh: "), "{both}");
    let missing = run(path, &["query", "--shape", "nowhere/x"]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(
        stderr(&missing).contains("no class 'nowhere'"),
        "{}",
        stderr(&missing)
    );

    // A file without animation counts once, with an index and with a file of dictionaries.
    let file = std::fs::read_dir(path.join("shapes").join(class)).unwrap().next();
    let file = file.unwrap().unwrap().path();
    let file = file.to_str().unwrap();
    answer(path, &["export", "--out", "d.safetensors"]);
    for from in [&["--data", "shapelex-data"], &["--dictionaries", "d.safetensors"]] {
        let asked = [&["query", file, "--poses", "3", "--json"][..], from].concat();
        let still = answer(path, &asked);
        assert_eq!(still.lines().count(), 1, "{still}");
        assert!(last_json(&still)["pose"].is_null(), "{still}");
        let one = [&["query", file, "--poses", "3", "--pose", "1"][..], from].concat();
        assert_eq!(run(path, &one).status.code(), Some(1));
    }
    for wrong in [
        &["query", file, "--pose", "1"][..],
        &["query", file, "--poses", "0"],
        &["query", file, "--poses", "2", "--pose", "2"],
        &["query", "--shape", id, "--dictionaries", "d.safetensors"],
        &["query"],
    ] {
        let refused = run(path, wrong);
        assert_eq!(refused.status.code(), Some(2), "{wrong:?}: {}", stderr(&refused));
    }
}
