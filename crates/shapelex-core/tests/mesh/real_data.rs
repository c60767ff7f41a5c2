//! Every real mesh there is.

use shapelex_core::mesh::{Format, Limits, Source, read, read_poses};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn files(under: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(under).expect("a directory") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, found);
        } else if path
            .to_str()
            .is_some_and(|name| Format::from_name(name).is_some())
        {
            found.push(path);
        }
    }
}

#[test]
fn every_real_file_is_read_or_refused_with_a_reason() {
    let root = shapelex_testing::repository("../shared/data");
    if !root.is_dir() {
        eprintln!("skipped: every_real_file_is_read_or_refused_with_a_reason: no ../shared/data");
        return;
    }
    let mut paths = Vec::new();
    files(&root, &mut paths);
    paths.sort();
    let limits = Limits::default();
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut refused = Vec::new();
    for path in &paths {
        let bytes = std::fs::read(path).expect("a file");
        let source = Source {
            bytes: &bytes,
            ..Source::default()
        };
        match read(&source, &limits) {
            Ok((format, soup)) => {
                assert_eq!(Some(format), Format::from_name(&path.to_string_lossy()));
                assert!(soup.vertices.len() > 100 && soup.faces.len() > 100, "{path:?}");
                *counts.entry(format!("{format} read")).or_default() += 1;
            }
            Err(error) => refused.push(format!("{}: {error}", path.display())),
        }
        if path.extension().is_some_and(|e| e == "gltf") {
            let poses = read_poses(&source, 16, &limits).expect("an animated file").1;
            assert_eq!(poses.len(), 16);
            assert!(poses.windows(2).all(|p| p[0].soup != p[1].soup), "{path:?}");
            *counts.entry("poses".into()).or_default() += poses.len();
        }
    }
    eprintln!("{} files: {counts:?}, refused {refused:?}", paths.len());
    assert!(refused.is_empty(), "{refused:?}");
}
