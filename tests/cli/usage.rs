//! Mistakes: found before anything is done, named, and answered with the right exit code.

use crate::{answer, last_json, run, shapelex, small_zoo, stderr};
use std::path::Path;

/// Runs it, demands an exit code and returns stderr.
fn fails(dir: &Path, code: i32, args: &[&str]) -> String {
    let output = run(dir, args);
    assert_eq!(output.status.code(), Some(code), "{args:?}: {}", stderr(&output));
    stderr(&output)
}

fn entries(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_data_directory_that_is_not_there_is_not_made_by_commands_that_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    std::fs::write(path.join("x.obj"), "v 0 0 0\n").unwrap();
    for args in [
        &["query", "x.obj", "--data", "typo"][..],
        &["export", "--out", "d.safetensors", "--data", "typo"],
        &["classes", "list", "--data", "typo"],
        &["classes", "delete", "cat", "--yes", "--data", "typo"],
        &["shapes", "list", "cat", "--data", "typo"],
        &["jobs", "list", "--data", "typo"],
        &["jobs", "follow", "--data", "typo"],
        &["reindex", "--data", "typo"],
        &["keys", "list", "--data", "typo"],
        &["snapshot", "list", "--data", "typo"],
        &["snapshot", "create", "--data", "typo"],
        &["snapshot", "restore", "nothing.tar.zst", "--data", "typo"],
        &["serve", "--recovery-mode", "--data", "typo"],
        &["import", "nothing.safetensors", "--data", "typo"],
        &[
            "keys",
            "create",
            "no spaces",
            "--scope",
            "admin",
            "--data",
            "typo",
        ],
        &[
            "keys",
            "create",
            "a",
            "--scope",
            "admin",
            "--expires",
            "soon",
            "--data",
            "typo",
        ],
        &[
            "zoo",
            "--out",
            "z",
            "--min-vertices",
            "900",
            "--max-vertices",
            "800",
        ],
        &["index", "nothing", "--data", "typo"],
        &["query", "x.obj"],
    ] {
        let said = fails(path, 2, args);
        assert_eq!(said.lines().count(), 1, "{args:?}: {said}");
    }
    let said = fails(path, 1, &["snapshot", "restore", "x.obj", "--data", "typo"]);
    assert!(said.contains("cannot be restored"), "{said}");
    assert_eq!(entries(path), ["x.obj"], "nothing was made");
    let said = fails(path, 2, &["query", "x.obj", "--data", "typo"]);
    assert!(
        said.contains("there is no such data directory") && said.contains("--server"),
        "{said}"
    );
    // A folder of something else is no data directory either, and stays as it is.
    std::fs::create_dir(path.join("shapes")).unwrap();
    let said = fails(path, 2, &["query", "x.obj", "--data", "shapes"]);
    assert!(said.contains("no data directory of shapelex"), "{said}");
    assert!(entries(&path.join("shapes")).is_empty());
}

#[test]
fn a_data_directory_that_is_made_is_said_to_be_and_the_nearest_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    let made = run(
        path,
        &[
            "keys",
            "create",
            "root",
            "--scope",
            "admin",
            "--data",
            "shapelex-data",
        ],
    );
    assert!(made.status.success(), "{}", stderr(&made));
    assert!(
        stderr(&made).contains("made a new data directory: shapelex-data"),
        "{}",
        stderr(&made)
    );
    assert_eq!(
        String::from_utf8(made.stdout).unwrap().lines().count(),
        1,
        "stdout has the key alone"
    );
    let again = run(path, &["keys", "list"]);
    assert!(!stderr(&again).contains("made a new"), "{}", stderr(&again));
    let said = fails(path, 2, &["classes", "list", "--data", "shapelex-dtaa"]);
    assert!(said.contains("did you mean shapelex-data?"), "{said}");
}

#[test]
fn tls_that_cannot_be_is_wrong_usage_and_nothing_is_made() {
    let dir = tempfile::tempdir().unwrap();
    for args in [
        &[
            "serve",
            "--data",
            "d",
            "--tls-cert",
            "c.pem",
            "--tls-key",
            "k.pem",
            "--listen",
            "127.0.0.1:0",
        ][..],
        &[
            "serve",
            "--data",
            "d",
            "--tls-cert",
            "c.pem",
            "--listen",
            "127.0.0.1:0",
        ],
    ] {
        let output = run(dir.path(), args);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(output.stdout.is_empty(), "nothing listens");
        assert!(!dir.path().join("d").exists());
    }
}

#[test]
fn wrong_values_are_named_by_where_they_came_from() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    let with = |name: &str, value: &str, args: &[&str]| {
        let output = shapelex(path).args(args).env(name, value).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{name}: {}", stderr(&output));
        stderr(&output)
    };
    for (name, value) in [
        ("SHAPELEX_LISTEN", "here"),
        ("SHAPELEX_JOB_QUEUE", "many"),
        ("SHAPELEX_PRESET", "best"),
        ("SHAPELEX_LOG_FORMAT", "xml"),
    ] {
        let said = with(name, value, &["serve"]);
        assert!(
            said.starts_with(&format!("shapelex: {name}='{value}': ")),
            "{said}"
        );
        assert!(!said.contains("--"), "a variable is no flag: {said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
    assert!(
        with("SHAPELEX_PRESET", "best", &["serve"]).contains("robust"),
        "the values there are"
    );
    let said = with("SHAPELEX_MAX_VERTICES", "0", &["serve"]);
    assert!(
        said.contains("SHAPELEX_MAX_VERTICES: max_vertices must be 1 or more, got 0"),
        "{said}"
    );
    let said = with("SHAPELEX_LOG", "shapelex=loud", &["query", "x.obj"]);
    assert!(said.contains("SHAPELEX_LOG"), "{said}");
    // A flag is still called a flag, also beside a variable.
    let said = with("SHAPELEX_LISTEN", "127.0.0.1:0", &["serve", "--listen", "here"]);
    assert!(
        said.contains("--listen") && !said.contains("SHAPELEX_LISTEN='"),
        "{said}"
    );
    assert!(fails(path, 2, &["serve", "--max-vertices", "0"]).contains("--max-vertices: "));
    for (line, said) in [
        (
            "max_vertices = 0",
            "line 2: max_vertices must be 1 or more, got 0",
        ),
        ("job_queue = \"many\"", "line 2: job_queue: "),
    ] {
        std::fs::write(path.join("shapelex.toml"), format!("query_queue = 3\n{line}\n")).unwrap();
        let told = fails(path, 2, &["serve", "--config", "shapelex.toml"]);
        assert!(told.contains("shapelex.toml") && told.contains(said), "{told}");
    }
}

#[test]
fn a_place_named_by_a_flag_wins_over_the_environment() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    let said = |args: &[&str], variables: &[(&str, &str)]| {
        let output = shapelex(path)
            .args(args)
            .envs(variables.iter().copied())
            .output()
            .unwrap();
        stderr(&output)
    };
    let server = ("SHAPELEX_SERVER", "http://127.0.0.1:9");
    let data = ("SHAPELEX_DATA", "elsewhere");
    let told = said(&["classes", "list", "--data", "d"], &[server]);
    assert!(told.contains("d: there is no such data directory"), "{told}");
    let told = said(&["classes", "list", "--server", "http://127.0.0.1:9"], &[data]);
    assert!(told.contains("http://127.0.0.1:9"), "{told}");
    let told = said(&["classes", "list"], &[server, data]);
    assert!(
        told.contains("SHAPELEX_DATA") && told.contains("SHAPELEX_SERVER"),
        "{told}"
    );
    assert!(!told.contains("--"), "{told}");
}

#[test]
fn help_lists_the_values_of_presets_and_rankings() {
    let dir = tempfile::tempdir().unwrap();
    let help = answer(dir.path(), &["query", "--help"]);
    assert!(
        help.contains("shape_dna_relative") && help.contains("possible values"),
        "{help}"
    );
    let help = answer(dir.path(), &["index", "--help"]);
    assert!(
        help.contains("possible values: default, paper, robust, fast"),
        "{help}"
    );
    let said = fails(dir.path(), 2, &["query", "x.obj", "--rank-by", "luck"]);
    assert!(said.contains("bag_of_words"), "{said}");
    let said = fails(dir.path(), 2, &["inspect", "x.obj", "--set", "atoms=many"]);
    assert!(
        said.contains("--set atoms=many: expected a whole number between 1 and 5000"),
        "{said}"
    );
}

#[test]
fn evaluate_finds_what_does_not_fit_before_it_describes_anything() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path();
    for file in [
        "flat/a.obj",
        "flat/b.obj",
        "flat/c.obj",
        "deep/cat/1.obj",
        "deep/cat/2.obj",
        "deep/dog/1.obj",
        "deep/dog/2.obj",
        "single/cat/1.obj",
    ] {
        let file = path.join(file);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, "no mesh at all").unwrap();
    }
    for (args, what) in [
        (&["evaluate", "flat"][..], "lie in the folder itself"),
        (&["evaluate", "deep", "--same", "cat,cow"], "no class 'cow'"),
        (&["evaluate", "deep", "--same", "cat"], "two classes or more"),
        (&["evaluate", "deep", "--min-shapes", "3"], "at least 3 shapes"),
        (
            &["evaluate", "deep", "--protocol", "k-fold", "--folds", "1"],
            "--folds",
        ),
        (&["evaluate", "deep", "--protocol", "open-set"], "19"),
        (&["evaluate", "deep", "--draws", "0"], "--draws"),
        (&["evaluate", "nowhere"], "no such folder"),
        (&["evaluate", "deep", "--queries", "nowhere"], "no such folder"),
        (&["evaluate", "deep", "--queries", "flat"], "'a' does not train"),
        (
            &["evaluate", "single", "--queries", "single"],
            "needs two or more",
        ),
        (
            &["evaluate", "deep", "--queries", "deep", "--same", "cat,cow"],
            "no class 'cow'",
        ),
        (
            &["evaluate", "deep", "--queries", "deep", "--folds", "2"],
            "cannot be used with",
        ),
        (&["evaluate", "flat/a.obj"], "this is a file"),
        (&["benchmark", "nowhere"], "no such file or folder"),
    ] {
        let figures: &[&str] = if args[0] == "evaluate" {
            &["--figures", "out"]
        } else {
            &[]
        };
        let said = fails(path, 2, &[args, figures].concat());
        assert!(said.contains(what), "{args:?}: {said}");
        assert!(!said.contains("describe"), "{args:?}: {said}");
    }
    assert!(!path.join("out").exists());
    // What only reading can tell is a failure, not wrong usage.
    fails(path, 1, &["evaluate", "deep"]);
}

#[test]
fn deleting_without_a_terminal_takes_a_yes() {
    let dir = tempfile::tempdir().unwrap();
    small_zoo(dir.path());
    for args in [
        &["classes", "delete", "cat"][..],
        &["shapes", "delete", "cat", "0"],
        &["index", "shapes", "--prune"],
    ] {
        let said = fails(dir.path(), 2, args);
        assert!(said.contains("--yes"), "{said}");
    }
    assert_eq!(entries(dir.path()), ["shapes"], "nothing was done");
}

#[test]
fn completions_and_manual_pages_name_every_command() {
    let dir = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = answer(dir.path(), &["completions", shell]);
        for word in ["evaluate", "reindex", "keep-going"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
        let completes_values = ["bash", "zsh", "fish"].contains(&shell);
        assert!(!completes_values || script.contains("shape_dna"), "{shell}");
    }
    let page = answer(dir.path(), &["man"]);
    assert!(page.contains(".TH") && page.contains("query"), "{page}");
    let told = last_json(&answer(dir.path(), &["man", "--out", "man", "--json"]));
    let pages = entries(&dir.path().join("man"));
    assert_eq!(told["pages"].as_u64().unwrap() as usize, pages.len(), "{pages:?}");
    for page in ["shapelex.1", "shapelex-query.1", "shapelex-classes-delete.1"] {
        assert!(pages.iter().any(|p| p == page), "{page}: {pages:?}");
    }
    let query = std::fs::read_to_string(dir.path().join("man/shapelex-query.1")).unwrap();
    assert!(
        query.contains("shapelex query") && query.contains("rank"),
        "{query}"
    );
}

#[test]
fn a_reader_that_leaves_ends_nothing_in_a_panic() {
    use std::process::Stdio;
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.obj"), "no mesh").unwrap();
    let mut child = crate::shapelex(dir.path())
        .args(["inspect", "a.obj", "b.obj", "c.obj"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stderr.take());
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(1));
}
