//! Replays what the fuzz targets were fed: `fuzz/corpus`, checked by the code of `fuzz/src`.

#[path = "../../fuzz/src/archive.rs"]
mod archive;
#[path = "../../fuzz/src/mesh.rs"]
mod mesh;
mod mutations;
#[path = "../../fuzz/src/polygon.rs"]
mod polygon;
#[path = "../../fuzz/src/request.rs"]
mod request;

use shapelex_core::mesh::Format;
use std::path::Path;
use std::time::{Duration, Instant};

/// Checks every input of a target's corpus, each within the time libFuzzer would give it.
fn replay(target: &str, check: impl Fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fuzz/corpus")
        .join(target);
    let mut inputs = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let bytes = std::fs::read(&path).unwrap();
        let began = Instant::now();
        check(&bytes);
        let took = began.elapsed();
        assert!(took < Duration::from_secs(5), "{} took {took:?}", path.display());
        inputs += 1;
    }
    assert!(inputs >= 4, "{inputs} inputs in {}", folder.display());
}

#[test]
fn meshes_of_every_format() {
    for format in Format::ALL {
        replay(&format!("mesh_{}", format.extension()), |bytes| {
            mesh::check(bytes, Some(format));
        });
    }
    replay("mesh_detect", |bytes| mesh::check(bytes, None));
}

#[test]
fn polygons() {
    replay("mesh_polygon", polygon::check);
}

#[test]
fn archives() {
    replay("archive", archive::check);
}

#[test]
fn requests() {
    replay("request", request::check);
}
