//! Commands without a service: usage, files, numbers.

use crate::{answer, last_json, repository, run, shapelex, small_zoo, stderr};
use std::path::Path;

const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

#[test]
fn help_and_version_succeed_and_wrong_usage_is_2() {
    let dir = tempfile::tempdir().unwrap();
    for args in [&["--help"][..], &["--version"], &["serve", "--help"]] {
        assert!(!answer(dir.path(), args).is_empty());
    }
    for args in [
        &["fly"][..],
        &[],
        &["evaluate"],
        &["query", "--top", "many", "x.obj"],
        &["inspect", "x.obj", "--set", "atom=3"],
        &["inspect", "x.obj", "--preset", "best"],
        &["query", "x.obj", "--server", "ftp://elsewhere"],
        &["query", "x.obj", "--server", "http://x", "--data", "y"],
        &["evaluate", "."],
        &["benchmark", "--classes", "1"],
        &["benchmark", "--methods", "best"],
        &["benchmark", "--protocols", "easy"],
        &["benchmark", "."],
        &["zoo", "--out", "z", "--classes", "0"],
        &["demo", "--classes", "1"],
        &["serve", "--listen", "here"],
        &["serve", "--log", "shapelex=loud"],
        &["serve", "--max-vertices", "0"],
        &["serve", "--config", "missing.toml"],
    ] {
        let output = run(dir.path(), args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", stderr(&output));
        assert!(output.stdout.is_empty(), "{args:?}");
        assert!(!output.stderr.is_empty(), "{args:?}");
    }
    assert_eq!(
        std::fs::read_dir(dir.path()).unwrap().count(),
        0,
        "nothing was made"
    );
}

#[test]
fn an_unknown_parameter_is_answered_with_those_there_are() {
    let dir = tempfile::tempdir().unwrap();
    let output = run(dir.path(), &["inspect", "x.obj", "--set", "atom=3"]);
    let message = stderr(&output);
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(message.starts_with("shapelex: --set atom"), "{message}");
    assert!(
        message.contains("atoms") && message.contains("lambda"),
        "{message}"
    );
}

#[test]
fn inspect_reads_cleans_and_goes_on_after_a_bad_file() {
    let golden = repository("tests/data/golden/bumpy_closed.off");
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("bad.obj"), "v 0 0 0\nf 1 2 3\n").unwrap();
    std::fs::write(dir.path().join("tetrahedron.obj"), TETRAHEDRON).unwrap();
    std::fs::copy(&golden, dir.path().join("good.off")).unwrap();
    let output = run(
        dir.path(),
        &[
            "inspect",
            "--json",
            "bad.obj",
            "missing.obj",
            "good.off",
            "--set",
            "eigenpairs=60",
        ],
    );
    assert_eq!(output.status.code(), Some(1));
    let lines: Vec<serde_json::Value> = String::from_utf8(output.stdout.clone())
        .unwrap()
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    assert_eq!(lines.len(), 3);
    assert!(
        lines[0]["error"].as_str().unwrap().contains("vertex"),
        "{}",
        lines[0]
    );
    assert_eq!(lines[1]["file"], "missing.obj");
    assert_eq!(lines[2]["format"], "off");
    let eigenvalues = lines[2]["eigenvalues"].as_array().unwrap();
    assert!(eigenvalues[0].as_f64().unwrap().abs() < 1e-6 && eigenvalues[1].as_f64().unwrap() > 1.0);
    let message = stderr(&output);
    assert!(
        message.contains("shapelex: bad.obj: ") && message.contains("shapelex: missing.obj: "),
        "{message}"
    );

    let text = answer(dir.path(), &["inspect", "good.off", "--set", "eigenpairs=60"]);
    assert!(
        text.contains("good.off: OFF") && text.contains("closed"),
        "{text}"
    );
}

#[test]
fn the_zoo_is_written_twice_alike() {
    let dir = tempfile::tempdir().unwrap();
    let args = |out: &'static str| ["zoo", "--out", out, "--classes", "2", "--poses", "2", "--json"];
    let first = last_json(&answer(dir.path(), &args("a")));
    answer(dir.path(), &args("b"));
    assert_eq!(first["files"], 4);
    let mut files = Vec::new();
    collect(&dir.path().join("a"), &mut files);
    assert_eq!(files.len(), 4);
    for file in files {
        let twin = dir
            .path()
            .join("b")
            .join(file.strip_prefix(dir.path().join("a")).unwrap());
        assert!(
            std::fs::read(&file).unwrap() == std::fs::read(twin).unwrap(),
            "{file:?}"
        );
    }
    answer(
        dir.path(),
        &[
            "zoo",
            "--out",
            "c",
            "--classes",
            "1",
            "--poses",
            "1",
            "--format",
            "glb",
        ],
    );
    let mut glb = Vec::new();
    collect(&dir.path().join("c"), &mut glb);
    assert_eq!(&std::fs::read(&glb[0]).unwrap()[..4], b"glTF");
}

fn collect(dir: &Path, files: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            files.push(path);
        }
    }
    files.sort();
}

#[test]
fn evaluate_tells_the_classes_of_a_small_zoo_apart_and_names_refused_files() {
    let dir = tempfile::tempdir().unwrap();
    small_zoo(dir.path());
    let output = run(dir.path(), &["evaluate", "shapes", "--json", "--set", "atoms=32"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let report = last_json(std::str::from_utf8(&output.stdout).unwrap());
    assert_eq!(report["shapes"], 12);
    assert_eq!(report["parameters"]["atoms"], 32);
    let names: Vec<&str> = report["protocols"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["leave-one-out", "even/odd", "one-shot"]);
    let retrieval = &report["retrieval"];
    assert_eq!(retrieval["total"], 12);
    for measure in [
        "nearest_neighbour",
        "first_tier",
        "second_tier",
        "dcg",
        "average_precision",
    ] {
        assert!(
            retrieval["measures"][measure].as_f64().unwrap() > 0.6,
            "{measure}: {retrieval}"
        );
    }
    assert_eq!(report["protocols"][0]["total"], 12);
    assert_eq!(report["protocols"][1]["total"], 6);
    for protocol in report["protocols"].as_array().unwrap() {
        assert!(protocol["top1"].as_f64().unwrap() > 0.8, "{protocol}");
        let counted: u64 = protocol["confusion"]
            .as_object()
            .unwrap()
            .values()
            .flat_map(|answers| answers.as_object().unwrap().values())
            .map(|n| n.as_u64().unwrap())
            .sum();
        assert_eq!(counted, protocol["total"].as_u64().unwrap());
    }

    let asked = [
        "evaluate",
        "shapes",
        "--queries",
        "shapes",
        "--set",
        "atoms=32",
        "--json",
    ];
    let output = run(dir.path(), &asked);
    assert!(output.status.success(), "{}", stderr(&output));
    let report = last_json(std::str::from_utf8(&output.stdout).unwrap());
    let [protocol] = report["protocols"].as_array().unwrap().as_slice() else {
        panic!("{report}");
    };
    assert_eq!(
        (&protocol["name"], &protocol["total"]),
        (&"train/query".into(), &12.into())
    );
    assert_eq!(protocol["top1"], 1.0);
    for measure in ["nearest_neighbour", "first_tier", "dcg"] {
        let value = |of| protocol["measures"][measure][of].as_f64().unwrap();
        assert!(value("low") <= value("mean") && value("mean") == 1.0 && value("high") == 1.0);
    }

    let class = std::fs::read_dir(dir.path().join("shapes"))
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    std::fs::write(class.path().join("zz-broken.obj"), "v 0 0 0\n").unwrap();
    let output = run(
        dir.path(),
        &[
            "evaluate",
            "shapes",
            "--protocol",
            "even-odd",
            "--set",
            "atoms=32",
        ],
    );
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("zz-broken.obj") && text.contains("no faces"),
        "{text}"
    );
    assert!(text.contains("even/odd"), "{text}");
    let unknown = run(dir.path(), &["evaluate", "shapes", "--same", "unicorn,pegasus"]);
    assert_eq!(unknown.status.code(), Some(2));

    let drawn = run(
        dir.path(),
        &[
            "evaluate",
            "shapes",
            "--protocol",
            "even-odd",
            "--protocol",
            "retrieval",
            "--set",
            "atoms=16",
            "--figures",
            "figures",
        ],
    );
    assert_eq!(
        drawn.status.code(),
        Some(1),
        "the broken file: {}",
        stderr(&drawn)
    );
    for name in [
        "even-odd-accuracy.svg",
        "even-odd-confusion.svg",
        "even-odd-dissimilarity.svg",
        "even-odd-worst.svg",
        "retrieval-precision-recall.svg",
    ] {
        let svg = std::fs::read_to_string(dir.path().join("figures").join(name)).unwrap();
        assert!(svg.contains("</svg>"), "{name}");
        let pictures = svg.matches("<polygon").count();
        assert!(name != "even-odd-worst.svg" || pictures > 1000, "{pictures}");
    }
}

#[test]
fn openapi_prints_the_documented_interface() {
    let dir = tempfile::tempdir().unwrap();
    let yaml = answer(dir.path(), &["openapi"]);
    assert!(yaml.starts_with("openapi: 3."), "{}", &yaml[..60.min(yaml.len())]);
    let json: serde_json::Value = serde_json::from_str(&answer(dir.path(), &["openapi", "--json"])).unwrap();
    assert!(json["paths"]["/v1/query"]["post"].is_object());
}

#[test]
fn a_reader_that_leaves_is_no_failure() {
    use std::process::Stdio;
    let dir = tempfile::tempdir().unwrap();
    let mut child = shapelex(dir.path())
        .arg("openapi")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(
        output.status.success() && output.stderr.is_empty(),
        "{}",
        stderr(&output)
    );
}
