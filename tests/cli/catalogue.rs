//! Queries of folders, and the commands for classes, shapes, jobs and reindexing.

use crate::service::{Service, classes, first_file};
use crate::{answer, last_json, run, shapelex, small_zoo, stderr};
use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::Stdio;

const FAST: [&str; 4] = ["--set", "atoms=16", "--set", "samples_per_shape=200"];

fn lines(stdout: &str) -> Vec<Value> {
    stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

fn ended(dir: &Path, code: i32, args: &[&str]) -> (String, String) {
    let output = run(dir, args);
    assert_eq!(output.status.code(), Some(code), "{args:?}: {}", stderr(&output));
    (String::from_utf8(output.stdout.clone()).unwrap(), stderr(&output))
}

#[test]
fn a_folder_and_standard_input_are_queried_and_summed_up() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    small_zoo(path);
    answer(path, &[&["index", "shapes"], &FAST[..]].concat());
    let names = classes(path);
    let deep = path.join("shapes").join(&names[0]).join("more");
    std::fs::create_dir(&deep).unwrap();
    std::fs::copy(first_file(path, &names[1]), deep.join("another.obj")).unwrap();
    std::fs::write(path.join("shapes/broken.obj"), "v 0 0 0\n").unwrap();

    let (stdout, told) = ended(path, 1, &["query", "shapes", "--json"]);
    let answers = lines(&stdout);
    assert_eq!(answers.len(), 15, "13 of the classes, a broken one, and the sum");
    let summary = &answers[14]["summary"];
    assert_eq!(summary["total"], 14);
    assert_eq!(summary["answered"], 13);
    assert_eq!(summary["refused"], 1);
    let tally = &summary["tally"];
    let count = |name: &str| tally[name].as_u64().unwrap();
    assert_eq!(count("right") + count("wrong") + count("none"), 13);
    assert!(
        count("wrong") + count("none") >= 1,
        "the file in the wrong folder: {tally}"
    );
    assert!(tally["accuracy"].as_f64().unwrap() > 0.7, "{tally}");
    assert!(told.contains("broken.obj"), "{told}");
    assert!(
        !told.contains("query:"),
        "no progress where stderr is no terminal: {told}"
    );
    let (stdout, _) = ended(path, 1, &["query", "shapes"]);
    assert!(stdout.contains("13 of 14 meshes answered, 1 refused"), "{stdout}");
    assert!(stdout.contains("class of the folder"), "{stdout}");

    let file = first_file(path, &names[1]);
    let mut child = shapelex(path)
        .args(["query", "-", "--name", "from-a-pipe.obj", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child
        .stdin
        .take()
        .unwrap()
        .write_all(&std::fs::read(&file).unwrap())
        .unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let ranked = last_json(&String::from_utf8(output.stdout).unwrap());
    assert_eq!(
        (ranked["file"].as_str(), ranked["name"].as_str()),
        (Some("-"), Some("from-a-pipe.obj"))
    );
    assert_eq!(ranked["classes"][0]["class"]["name"], names[1].as_str());
}

#[test]
fn answers_are_words_and_warnings_go_to_stderr_once() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    answer(
        path,
        &[
            "zoo",
            "--out",
            "shapes",
            "--classes",
            "2",
            "--poses",
            "3",
            "--min-vertices",
            "2600",
            "--max-vertices",
            "3000",
        ],
    );
    answer(path, &[&["index", "shapes"], &FAST[..]].concat());
    let file = first_file(path, &classes(path)[0]);
    // Half of the faces make an open surface, which is worth a warning.
    let text = std::fs::read_to_string(&file).unwrap();
    let faces = text.lines().filter(|line| line.starts_with("f ")).count();
    let mut kept = 0;
    let half: String = text
        .lines()
        .filter(|line| {
            kept += usize::from(line.starts_with("f "));
            !line.starts_with("f ") || 2 * kept < faces
        })
        .map(|line| format!("{line}\n"))
        .collect();
    std::fs::write(path.join("half.obj"), half).unwrap();

    let (stdout, told) = ended(path, 0, &["query", &file, "half.obj"]);
    assert!(!stdout.contains("warning"), "{stdout}");
    assert_eq!(stdout.matches("\nmesh: ").count(), 2, "{stdout}");
    assert!(!told.contains("simplified"), "simplification is the rule: {told}");
    assert_eq!(told.matches("The surface is open").count(), 1, "{told}");
    assert!(
        stdout.contains("nearest: ") || stdout.contains("none of the known"),
        "{stdout}"
    );
    let (stdout, told) = ended(path, 0, &["query", "half.obj", "--json"]);
    assert_eq!(stdout.matches("The surface is open").count(), 1, "{stdout}");
    assert!(
        !told.contains("The surface is open"),
        "with --json the answer has it: {told}"
    );
    answer(path, &["export", "--out", "d.safetensors"]);
    let (stdout, _) = ended(
        path,
        0,
        &["query", "half.obj", "--json", "--dictionaries", "d.safetensors"],
    );
    assert_eq!(stdout.matches("The surface is open").count(), 1, "{stdout}");
    assert!(
        !stdout.contains("confidence") && last_json(&stdout)["margin"].is_number(),
        "{stdout}"
    );
    let coarse = answer(path, &["inspect", &file, "--set", "refine_below=2500", "--json"]);
    assert_eq!(last_json(&coarse)["refined_to"], 2500, "{coarse}");
}

#[test]
fn the_catalogue_is_listed_changed_and_learnt_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    small_zoo(path);
    answer(path, &[&["index", "shapes", "--data", "d"], &FAST[..]].concat());
    let service = Service::start(path, &["--data", "d"]);
    let url: &'static str = service.url.clone().leak();
    catalogue(path, &|args| [args, &["--server", url]].concat());
    assert_eq!(
        requests(url, "get_job"),
        2,
        "`jobs show` and `cancel`; a job is followed, not asked for"
    );
    assert!(requests(url, "follow_job") >= 3);
    // One process uses a data directory at a time, and says how to reach the one that does.
    let (_, told) = ended(path, 1, &["classes", "list", "--data", "d"]);
    assert!(
        told.contains("another process") && told.contains("--server"),
        "{told}"
    );
    assert!(service.terminate().success());
    small_zoo(path);
    answer(path, &["index", "shapes", "--data", "d"]);
    catalogue(path, &|args| [args, &["--data", "d"]].concat());
}

/// How many requests of an operation a service has answered with success, by its own count.
fn requests(url: &str, operation: &str) -> u64 {
    use std::io::Read;
    let mut stream = std::net::TcpStream::connect(url.strip_prefix("http://").unwrap()).unwrap();
    stream
        .write_all(b"GET /metrics HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n")
        .unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    let series = |line: &&str| {
        line.starts_with("shapelex_http_requests_total")
            && line.contains(&format!("operation=\"{operation}\""))
            && line.contains("status=\"2xx\"")
    };
    let line = text
        .lines()
        .find(series)
        .unwrap_or_else(|| panic!("no {operation} in {text}"));
    line.rsplit(' ').next().unwrap().parse().unwrap()
}

/// Every command, at a place that holds the small zoo.
fn catalogue(path: &Path, at: &dyn Fn(&[&'static str]) -> Vec<&'static str>) {
    let say = |args: &[&'static str]| answer(path, &at(args));
    let names = classes(path);
    let (first, second, third): (&'static str, &'static str, &'static str) = (
        names[0].clone().leak(),
        names[1].clone().leak(),
        names[2].clone().leak(),
    );
    let listed = lines(&say(&["classes", "list", "--json"]));
    assert_eq!(listed.len(), 3);
    assert!(say(&["classes", "list"]).contains("current"));
    assert!(say(&["classes", "show", first]).contains("4"));
    let renamed = say(&["classes", "rename", first, "renamed"]);
    assert!(renamed.contains("is called renamed now"), "{renamed}");
    say(&["classes", "rename", "renamed", first]);
    let taken = run(path, &at(&["classes", "rename", first, second]));
    assert_eq!(taken.status.code(), Some(1));
    let unknown = run(path, &at(&["classes", "show", "unicorn"]));
    assert_eq!(unknown.status.code(), Some(1));
    assert!(
        stderr(&unknown).contains("no class 'unicorn'"),
        "{}",
        stderr(&unknown)
    );

    let shapes = lines(&say(&["shapes", "list", second, "--json"]));
    assert_eq!(shapes.len(), 4);
    let id: &'static str = shapes[0]["id"].as_str().unwrap().to_owned().leak();
    let name = shapes[0]["name"].as_str().unwrap();
    assert!(say(&["shapes", "show", second, id]).contains(name));
    say(&["shapes", "download", second, id]);
    let original = path.join("shapes").join(second).join(name);
    assert_eq!(
        std::fs::read(path.join(name)).unwrap(),
        std::fs::read(original).unwrap()
    );
    let there = run(path, &at(&["shapes", "download", second, id]));
    assert_eq!(there.status.code(), Some(1), "a file is not written over unasked");
    std::fs::remove_file(path.join(name)).unwrap();
    say(&["shapes", "delete", second, id, "--yes"]);
    assert_eq!(lines(&say(&["shapes", "list", second, "--json"])).len(), 3);

    let job = last_json(&say(&["reindex", "--json"]));
    assert_eq!(job["state"], "succeeded");
    assert_eq!(
        job["result"]["relearned"].as_array().unwrap().len(),
        1,
        "what changed"
    );
    let job = last_json(&say(&["reindex", "--class", first, "--class", third, "--json"]));
    assert_eq!(job["result"]["relearned"].as_array().unwrap().len(), 2);
    assert!(say(&["reindex", "--all", "--set", "atoms=12"]).contains("classes learnt: 3"));
    let jobs = lines(&say(&["jobs", "list", "--json"]));
    assert!(jobs.len() >= 3);
    let latest: &'static str = jobs[0]["id"].as_str().unwrap().to_owned().leak();
    assert!(say(&["jobs", "show", latest]).contains("succeeded"));
    assert!(
        say(&["jobs", "follow"]).contains("classes learnt: 3"),
        "the latest"
    );
    let finished = run(path, &at(&["jobs", "cancel", latest]));
    assert_eq!(finished.status.code(), Some(1));

    // What left the folder leaves the index, and only that.
    std::fs::remove_dir_all(path.join("shapes").join(third)).unwrap();
    let gone = first_file(path, first);
    std::fs::remove_file(&gone).unwrap();
    let pruned = run(path, &at(&["index", "shapes", "--prune", "--yes", "--json"]));
    assert!(pruned.status.success(), "{}", stderr(&pruned));
    let report = last_json(&String::from_utf8(pruned.stdout.clone()).unwrap());
    assert_eq!(
        report["pruned"]["classes"],
        serde_json::json!([third]),
        "{report}"
    );
    assert_eq!(report["pruned"]["shapes"].as_array().unwrap().len(), 1);
    assert!(stderr(&pruned).contains("no longer there"), "{}", stderr(&pruned));
    assert_eq!(lines(&say(&["classes", "list", "--json"])).len(), 2);
    assert_eq!(lines(&say(&["shapes", "list", first, "--json"])).len(), 3);
    let deleted = say(&["classes", "delete", first, second, "--yes"]);
    assert_eq!(deleted.lines().count(), 2, "{deleted}");
    assert!(say(&["classes", "list"]).contains("there are no classes"));
    assert!(
        say(&["reindex"]).contains("classes learnt: 0"),
        "an index without classes"
    );
}

#[test]
fn without_a_service_nothing_is_said_about_requests() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    answer(
        path,
        &["keys", "create", "root", "--scope", "admin", "--data", "d"],
    );
    small_zoo(path);
    let file = first_file(path, &classes(path)[0]);
    std::fs::write(
        path.join("lost.gltf"),
        r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"gone.bin","byteLength":4}],"meshes":[]}"#,
    )
    .unwrap();
    std::fs::write(path.join("empty.obj"), "").unwrap();
    std::fs::write(path.join("notes.txt"), "hello").unwrap();
    for args in [
        &["query", &file, "--data", "d"][..],
        &["reindex", "--data", "d"],
        &["query", "lost.gltf", "--data", "d"],
        &["query", "empty.obj", "--data", "d"],
        &["query", "notes.txt", "--data", "d"],
        &["query", "shapes", "--rank-by", "bag_of_words", "--data", "d"],
        &["inspect", "lost.gltf", "empty.obj"],
    ] {
        let (_, told) = ended(path, 1, args);
        for word in [
            "POST",
            "GET",
            "/v1",
            "request",
            "multipart",
            "header",
            "body",
            "upload,",
        ] {
            assert!(!told.contains(word), "{args:?}: {told}");
        }
    }
    let (_, told) = ended(path, 1, &["query", &file, "--data", "d"]);
    assert!(told.contains("`shapelex index DIR --data d`"), "{told}");
}

#[test]
fn an_export_has_the_classes_and_names_of_today() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    small_zoo(path);
    answer(path, &[&["index", "shapes"], &FAST[..]].concat());
    let names = classes(path);
    answer(path, &["classes", "rename", &names[0], "renamed"]);
    answer(path, &["classes", "delete", &names[1], "--yes"]);
    let (stdout, _) = ended(path, 0, &["export", "--out", "d.safetensors", "--json"]);
    let exported = last_json(&stdout)["classes"].clone();
    let mut found: Vec<&str> = (exported.as_array().unwrap().iter())
        .map(|class| class["name"].as_str().unwrap())
        .collect();
    found.sort_unstable();
    let mut expected = ["renamed", names[2].as_str()];
    expected.sort_unstable();
    assert_eq!(found, expected);
    let file = first_file(path, &names[0]);
    let query = ["query", &file, "--json", "--dictionaries", "d.safetensors"];
    for by in [&[][..], &["--rank-by", "bag_of_words"]] {
        let (stdout, _) = ended(path, 0, &[&query[..], by].concat());
        let answered = last_json(&stdout);
        let ranked = answered["classes"].as_array().unwrap();
        assert_eq!(
            (ranked.len(), &ranked[0]["class"]["name"]),
            (2, &Value::from("renamed"))
        );
    }
    for name in ["renamed", names[2].as_str()] {
        answer(path, &["classes", "delete", name, "--yes"]);
    }
    let (_, told) = ended(path, 1, &["export", "--out", "none.safetensors"]);
    assert!(told.contains("every class of the index was deleted"), "{told}");
}
