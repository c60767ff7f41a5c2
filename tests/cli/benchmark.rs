//! `shapelex benchmark` on three creatures of the zoo.

use crate::{answer, last_json, run, stderr};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Three nulls, two categories, one method of each kind.
const SMALL: [&str; 14] = [
    "benchmark",
    "--classes",
    "3",
    "--vertices",
    "400",
    "--categories",
    "noise,view",
    "--methods",
    "robust,shape_dna,sdd_wks,bow_si_hks",
    "--set",
    "atoms=16",
    "--set",
    "eigenpairs=60",
    "--json",
];

fn files(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else {
            found.push(path);
        }
    }
    found.sort();
}

#[test]
fn a_small_benchmark_counts_as_its_protocols_say_and_resumes_from_its_cache() {
    let dir = tempfile::tempdir().unwrap();
    let with = |more: &[&'static str]| -> Value {
        let args: Vec<&str> = SMALL.iter().chain(more).copied().collect();
        last_json(&answer(dir.path(), &args))
    };
    let first = with(&["--cache", "cache", "--out", "tables"]);

    // Protocol → method → category → counts.
    let protocols = ["in", "hold", "null", "retrieval", "similarity_holes_range"];
    assert_eq!(first.as_object().unwrap().len(), protocols.len());
    for protocol in protocols {
        let methods = first[protocol].as_object().unwrap();
        assert_eq!(methods.len(), 4, "{protocol}");
        for (method, counts) in methods {
            let categories = match protocol {
                "similarity_holes_range" => ["similarity_holes", "similarity_range"],
                _ => ["noise", "view"],
            };
            let each = match protocol {
                "null" | "similarity_holes_range" => 15,
                _ => 18,
            };
            let mut correct = 0;
            for category in categories {
                let count = &counts[category];
                assert_eq!(count["total"], each, "{protocol} {method} {category}");
                correct += count["correct"].as_u64().unwrap();
            }
            assert_eq!(counts["total"]["total"], 2 * each);
            assert_eq!(counts["total"]["correct"], correct);
            assert_eq!(counts.as_object().unwrap().len(), 3);
        }
    }
    // Noise on shapes of which a dictionary has seen weaker and stronger noise.
    assert!(
        first["hold"]["robust"]["noise"]["correct"].as_u64().unwrap() >= 17,
        "{first}"
    );

    let tables = dir.path().join("tables");
    let read = |name: &str| std::fs::read_to_string(tables.join(name)).unwrap();
    let report: Value = serde_json::from_str(&read("benchmark.json")).unwrap();
    assert_eq!(report["counts"], first);
    assert_eq!(report["nulls"].as_array().unwrap().len(), 3);
    assert_eq!(report["retrieval"]["robust"]["total"]["queries"], 36);
    // In, hold and null of two categories, and the two of the similarity protocol, by four methods.
    assert_eq!(report["dissimilarity"].as_array().unwrap().len(), (3 * 2 + 2) * 4);
    assert!(read("benchmark.md").contains("| robust |"));
    for (name, said) in [
        ("gallery.svg", "shot noise"),
        ("dissimilarity.svg", "mean score"),
        ("mds.svg", "first axis"),
        ("precision_recall.svg", "recall"),
    ] {
        let svg = read(name);
        assert!(svg.starts_with("<svg") && svg.contains(said), "{name}");
    }
    // A line per count, and the header.
    assert_eq!(read("counts.csv").lines().count(), 1 + 5 * 4 * 3);

    // Everything is in the cache; half of it is lost; what is left of one entry is damaged.
    assert_eq!(with(&["--cache", "cache"]), first);
    let mut entries = Vec::new();
    files(&dir.path().join("cache"), &mut entries);
    assert!(entries.len() > 50, "{} entries", entries.len());
    for path in entries.iter().step_by(2) {
        std::fs::remove_file(path).unwrap();
    }
    for path in entries.iter().skip(1).step_by(4) {
        let mut bytes = std::fs::read(path).unwrap();
        if let Some(last) = bytes.last_mut() {
            *last ^= 0x55;
        }
        std::fs::write(path, bytes).unwrap();
    }
    assert_eq!(with(&["--cache", "cache"]), first);
    assert_eq!(with(&["--no-cache"]), first);
}

#[test]
fn null_shapes_come_from_files_and_folders() {
    let dir = tempfile::tempdir().unwrap();
    answer(
        dir.path(),
        &[
            "zoo",
            "--out",
            "shapes",
            "--classes",
            "2",
            "--poses",
            "3",
            "--min-vertices",
            "400",
            "--max-vertices",
            "600",
        ],
    );
    let args = |path: &'static str| {
        [
            "benchmark",
            path,
            "--no-cache",
            "--json",
            "--methods",
            "shape_dna",
            "--protocols",
            "hold",
        ]
    };
    // Three poses of a class: the first is the null, the two others strengths 1 and 2 of the isometries.
    let counts = last_json(&answer(dir.path(), &args("shapes")));
    let counts = &counts["hold"]["shape_dna"];
    assert_eq!(counts["isometry"]["total"], 6);
    assert_eq!(counts["local_scale"]["total"], 12);
    assert_eq!(counts["total"]["total"], 6 + 10 * 12);
    // Two classes of a file each have no other poses.
    let mut meshes = Vec::new();
    files(&dir.path().join("shapes"), &mut meshes);
    std::fs::create_dir(dir.path().join("nulls")).unwrap();
    for (from, to) in [(&meshes[0], "nulls/a.obj"), (&meshes[3], "nulls/b.obj")] {
        std::fs::copy(from, dir.path().join(to)).unwrap();
    }
    let counts = last_json(&answer(dir.path(), &args("nulls")));
    assert_eq!(counts["hold"]["shape_dna"]["total"]["total"], 9 * 12);
    let unknown = run(
        dir.path(),
        &["benchmark", "nulls", "--same", "a,unicorn", "--no-cache"],
    );
    assert_eq!(unknown.status.code(), Some(2));
    assert!(stderr(&unknown).contains("unicorn"), "{}", stderr(&unknown));
}
