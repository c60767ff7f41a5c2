//! Commands with a service: local, remote, and the demo.

use crate::{answer, last_json, run, shapelex, small_zoo, stderr};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A service on a free port, ended when dropped.
pub struct Service {
    child: Child,
    pub url: String,
}

impl Service {
    pub fn start(dir: &Path, args: &[&str]) -> Self {
        let mut child = shapelex(dir)
            .args(["serve", "--listen", "127.0.0.1:0", "--json"])
            .args(args)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        let url = last_json(&line)["listening"].as_str().unwrap().to_owned();
        Self { child, url }
    }

    /// Asks it to stop, as a container engine does, and waits.
    pub fn terminate(mut self) -> std::process::ExitStatus {
        let asked = Command::new("kill")
            .args(["-TERM", &self.child.id().to_string()])
            .status()
            .unwrap();
        assert!(asked.success());
        let began = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(began.elapsed() < Duration::from_secs(60), "it does not stop");
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // Ended already where the test got that far.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn best(answer: &serde_json::Value) -> &str {
    answer["classes"][0]["class"]["name"].as_str().unwrap()
}

pub fn first_file(dir: &Path, class: &str) -> String {
    let folder = dir.join("shapes").join(class);
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    names.sort();
    names[0].to_str().unwrap().to_owned()
}

pub fn classes(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(dir.join("shapes"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn index_query_export_and_import_in_a_local_directory() {
    let dir = tempfile::tempdir().unwrap();
    small_zoo(dir.path());
    let class = classes(dir.path())[0].clone();
    let unseen = dir.path().join("unseen.obj");
    std::fs::rename(first_file(dir.path(), &class), &unseen).unwrap();

    let empty = run(dir.path(), &["query", "unseen.obj"]);
    assert_eq!(empty.status.code(), Some(2), "there is no data directory");
    assert!(!dir.path().join("shapelex-data").exists());

    let indexed = last_json(&answer(
        dir.path(),
        &["index", "shapes", "--json", "--set", "atoms=32"],
    ));
    assert_eq!(indexed["job"]["state"], "succeeded");
    assert_eq!(indexed["added"][&class], 3);
    let again = last_json(&answer(dir.path(), &["index", "shapes", "--json"]));
    assert_eq!(again["existing"], 11);

    let stored = last_json(&answer(
        dir.path(),
        &["query", "unseen.obj", "--json", "--top", "2"],
    ));
    assert_eq!(best(&stored), class);
    assert_eq!(stored["classes"].as_array().unwrap().len(), 2);
    assert_eq!(
        stored["parameters"]["atoms"], 32,
        "the second run kept the parameters"
    );
    let text = answer(dir.path(), &["query", "unseen.obj"]);
    assert!(text.contains(&class) && text.contains("score"), "{text}");

    let file = "dictionaries.safetensors";
    let exported = last_json(&answer(dir.path(), &["export", "--out", file, "--json"]));
    assert_eq!(exported["classes"].as_array().unwrap().len(), 3);
    let from_file = last_json(&answer(
        dir.path(),
        &["query", "unseen.obj", "--dictionaries", file, "--json"],
    ));
    let imported = last_json(&answer(
        dir.path(),
        &["import", file, "--data", "other", "--json"],
    ));
    assert_eq!(imported["generation"], 1);
    let elsewhere = last_json(&answer(
        dir.path(),
        &["query", "unseen.obj", "--data", "other", "--json"],
    ));
    for same in [&from_file, &elsewhere] {
        assert_eq!(best(same), class);
        assert_eq!(
            same["classes"][0]["score"], stored["classes"][0]["score"],
            "stored and exported dictionaries are the same numbers"
        );
    }
    // What answers are judged by and what the baselines need went along; what did not is said.
    for answer in [&exported, &imported] {
        assert_eq!(answer["absent"], serde_json::json!(["the training shapes"]));
    }
    assert_eq!(from_file["verdict"], stored["verdict"]);
    assert_eq!(elsewhere["verdict"], stored["verdict"]);
    let by_dna = |data: &str| {
        let args = [
            "query",
            "unseen.obj",
            "--data",
            data,
            "--rank-by",
            "shape_dna",
            "--json",
        ];
        last_json(&answer(dir.path(), &args))
    };
    let (here, there) = (by_dna("shapelex-data"), by_dna("other"));
    assert_eq!(here["classes"][0]["score"], there["classes"][0]["score"]);
    // Another class beside the imported ones: these stay.
    std::fs::create_dir_all(dir.path().join("more/blob")).unwrap();
    std::fs::copy(&unseen, dir.path().join("more/blob/blob.obj")).unwrap();
    let more = last_json(&answer(
        dir.path(),
        &["index", "more", "--data", "other", "--json"],
    ));
    assert_eq!(more["job"]["result"]["reused"].as_array().unwrap().len(), 3);
    let beside = last_json(&answer(
        dir.path(),
        &["query", "unseen.obj", "--data", "other", "--json"],
    ));
    assert_eq!(beside["compared"], 4);
    let nothing = run(dir.path(), &["export", "--out", file, "--data", "nowhere"]);
    assert_eq!(nothing.status.code(), Some(2));
    assert!(!dir.path().join("nowhere").exists());
}

#[test]
fn refused_files_are_named_and_stop_the_learning_unless_told_otherwise() {
    let dir = tempfile::tempdir().unwrap();
    small_zoo(dir.path());
    let class = classes(dir.path())[0].clone();
    std::fs::write(dir.path().join("shapes").join(class).join("zz.obj"), "").unwrap();
    let output = run(
        dir.path(),
        &[
            "index",
            "shapes",
            "--set",
            "atoms=16",
            "--set",
            "samples_per_shape=200",
        ],
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("zz.obj: "), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("nothing was learnt"), "{text}");
    let kept = run(dir.path(), &["index", "shapes", "--keep-going"]);
    assert_eq!(kept.status.code(), Some(1), "a file was refused all the same");
    let text = String::from_utf8(kept.stdout).unwrap();
    assert!(text.contains("classes learnt: 3"), "{text}");
}

#[test]
fn a_service_is_indexed_queried_and_stopped() {
    let dir = tempfile::tempdir().unwrap();
    small_zoo(dir.path());
    let service = Service::start(dir.path(), &["--data", "served", "--max-body-mib", "1"]);
    assert_eq!(
        answer(dir.path(), &["health", "--server", &service.url]),
        "alive\n"
    );
    answer(dir.path(), &["health", "--ready", "--server", &service.url]);
    answer(
        dir.path(),
        &[
            "index",
            "shapes",
            "--server",
            &service.url,
            "--set",
            "atoms=16",
            "--set",
            "samples_per_shape=200",
        ],
    );
    let class = classes(dir.path())[1].clone();
    let file = first_file(dir.path(), &class);
    let ranked = last_json(&answer(
        dir.path(),
        &["query", &file, "--server", &service.url, "--json"],
    ));
    assert_eq!(best(&ranked), class);

    let locked = run(dir.path(), &["query", &file, "--data", "served"]);
    assert_eq!(locked.status.code(), Some(1));
    assert!(
        stderr(&locked).contains("another process") && stderr(&locked).contains("--server"),
        "{}",
        stderr(&locked)
    );

    std::fs::write(dir.path().join("large.obj"), vec![b'#'; 2 << 20]).unwrap();
    let large = run(dir.path(), &["query", "large.obj", "--server", &service.url]);
    assert_eq!(large.status.code(), Some(1));

    let url = service.url.clone();
    assert!(service.terminate().success(), "a stop on request is no failure");
    let gone = run(dir.path(), &["health", "--server", &url]);
    assert_eq!(gone.status.code(), Some(1));
    // What was acknowledged is still there.
    let ranked = last_json(&answer(
        dir.path(),
        &["query", &file, "--data", "served", "--json"],
    ));
    assert_eq!(best(&ranked), class);
}

#[test]
fn a_snapshot_goes_to_a_file_and_back_into_a_fresh_directory_and_a_running_service() {
    let dir = tempfile::tempdir().unwrap();
    small_zoo(dir.path());
    let set = ["--set", "atoms=16", "--set", "samples_per_shape=200"];
    answer(
        dir.path(),
        &[&["index", "shapes", "--data", "one"], &set[..]].concat(),
    );
    let class = classes(dir.path())[1].clone();
    let file = first_file(dir.path(), &class);
    let rank = |target: &[&str]| {
        let args = [&["query", &file, "--json"], target].concat();
        last_json(&answer(dir.path(), &args))["classes"].clone()
    };
    let before = rank(&["--data", "one"]);

    let made = last_json(&answer(
        dir.path(),
        &[
            "snapshot",
            "create",
            "--data",
            "one",
            "--out",
            "all.tar.zst",
            "--json",
        ],
    ));
    assert_eq!(made["classes"], 3);
    let id = made["id"].as_str().unwrap();
    let listed = answer(dir.path(), &["snapshot", "list", "--data", "one"]);
    assert!(listed.contains(id), "{listed}");

    let restored = run(
        dir.path(),
        &["snapshot", "restore", "all.tar.zst", "--data", "two"],
    );
    let text = String::from_utf8(restored.stdout.clone()).unwrap();
    assert!(text.contains("restored: 3 classes"), "{text}");
    assert_eq!(
        stderr(&restored),
        "shapelex: made a new data directory: two\n",
        "a restore that succeeds warns of nothing"
    );
    assert_eq!(rank(&["--data", "two"]), before);

    let service = Service::start(dir.path(), &["--data", "three"]);
    let query = ["--server", service.url.as_str()];
    // The token that a restore takes is in the directory.
    let server = ["--server", service.url.as_str(), "--data", "three"];
    answer(
        dir.path(),
        &[&["snapshot", "restore", "all.tar.zst"], &server[..]].concat(),
    );
    assert_eq!(rank(&query), before);
    let made = last_json(&answer(
        dir.path(),
        &[&["snapshot", "create", "--json"], &server[..]].concat(),
    ));
    let id = made["id"].as_str().unwrap();
    let download = ["snapshot", "download", id, "--out", "again.tar.zst"];
    answer(dir.path(), &[&download, &server[..]].concat());
    assert_eq!(
        std::fs::metadata(dir.path().join("again.tar.zst")).unwrap().len(),
        made["bytes"].as_u64().unwrap()
    );
    answer(dir.path(), &[&["snapshot", "restore", id], &server[..]].concat());
    answer(dir.path(), &[&["snapshot", "delete", id], &server[..]].concat());
    assert_eq!(
        answer(dir.path(), &[&["snapshot", "list"], &server[..]].concat()),
        "no snapshots\n"
    );

    std::fs::write(dir.path().join("no.tar.zst"), b"no").unwrap();
    let refused = run(
        dir.path(),
        &[&["snapshot", "restore", "no.tar.zst"], &server[..]].concat(),
    );
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        stderr(&refused).contains("cannot be restored"),
        "{}",
        stderr(&refused)
    );
    assert_eq!(rank(&query), before);
}

#[test]
fn a_taken_port_is_said_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let output = run(dir.path(), &["serve", "--listen", &address]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains(&format!("cannot listen on {address}")),
        "{}",
        stderr(&output)
    );
}

#[test]
fn the_demo_recognises_poses_it_has_not_seen() {
    let dir = tempfile::tempdir().unwrap();
    let output = answer(
        dir.path(),
        &[
            "demo",
            "--json",
            "--classes",
            "4",
            "--poses",
            "3",
            "--set",
            "atoms=32",
        ],
    );
    let summary = last_json(&output);
    assert_eq!(summary["classes"], 4);
    assert_eq!(summary["queries"], 4);
    assert!(summary["top1"].as_f64().unwrap() > 0.7, "{summary}");
    assert!(summary["seconds"].as_f64().unwrap() > 0.0);
    assert_eq!(
        std::fs::read_dir(dir.path()).unwrap().count(),
        0,
        "nothing is left behind"
    );
}
