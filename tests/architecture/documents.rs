//! What the documents name exists: files, test programs, commands and their flags.

use clap::CommandFactory;
use clap::error::ErrorKind;
use shapelex::cli::Cli;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The documents that users read, with their text.
fn documents() -> Vec<(PathBuf, String)> {
    let mut paths = vec![
        PathBuf::from("README.md"),
        PathBuf::from("SECURITY.md"),
        PathBuf::from("CHANGELOG.md"),
    ];
    let mut folders = vec![PathBuf::from("docs")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).unwrap() {
            let path = folder.join(entry.unwrap().file_name());
            if root().join(&path).is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                paths.push(path);
            }
        }
    }
    assert!(paths.len() > 10, "{paths:?}");
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(root().join(&path)).unwrap();
        (path, text)
    };
    paths.into_iter().map(read).collect()
}

/// The code of a document: lines of fenced blocks, and what stands between backticks in a line.
fn code(text: &str) -> Vec<String> {
    let (mut found, mut fenced) = (Vec::new(), false);
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if fenced {
            found.push(line.to_owned());
        } else {
            found.extend(line.split('`').skip(1).step_by(2).map(str::to_owned));
        }
    }
    found
}

/// Words of a piece of code without the marks around them.
fn words(code: &str) -> impl Iterator<Item = &str> {
    let marks = ['.', ',', ';', ':', '(', ')', '"', '\''];
    code.split_whitespace().map(move |word| word.trim_matches(marks))
}

#[test]
fn paths_named_in_documents_exist() {
    let folders: BTreeSet<String> = std::fs::read_dir(root())
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.path().is_dir())
        .map(|entry| entry.file_name().into_string().unwrap())
        .filter(|name| name != "target")
        .collect();
    let is_pattern = |word: &str| word.contains(['*', '…', '{', '<', '$']);
    let mut missing = Vec::new();
    for (document, text) in documents() {
        for piece in code(&text) {
            for word in words(&piece).filter(|word| !is_pattern(word)) {
                let Some((folder, _)) = word.split_once('/') else {
                    continue;
                };
                let path = root().join(word);
                if folders.contains(folder) && !path.exists() && !path.with_extension("rs").exists() {
                    missing.push(format!("{}: {word}", document.display()));
                }
            }
        }
        let beside = root().join(&document).parent().unwrap().to_owned();
        for target in text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split([')', '#']).next())
        {
            if !target.contains("://") && !target.is_empty() && !beside.join(target).exists() {
                missing.push(format!("{}: link to {target}", document.display()));
            }
        }
    }
    assert!(missing.is_empty(), "\n{}\n", missing.join("\n"));
}

/// Whether a package has this program: `tests/NAME`, `benches/NAME`, `examples/NAME`, with or without `.rs`.
fn has_program(folder: &str, name: &str) -> bool {
    let packages = std::fs::read_dir(root().join("crates")).unwrap();
    let packages = packages.map(|entry| entry.unwrap().path());
    let is_there = |package: PathBuf| {
        let path = package.join(folder).join(name);
        path.is_dir() || path.with_extension("rs").is_file()
    };
    packages.chain([root().to_owned()]).any(is_there)
}

#[test]
fn test_programs_and_benchmarks_named_in_documents_exist() {
    let mut missing = Vec::new();
    for (document, text) in documents() {
        for piece in code(&text).iter().filter(|piece| piece.contains("cargo ")) {
            let words: Vec<&str> = words(piece).collect();
            for pair in words.windows(2) {
                let folder = match pair[0] {
                    "--test" => "tests",
                    "--bench" => "benches",
                    "--example" => "examples",
                    _ => continue,
                };
                if !has_program(folder, pair[1]) {
                    missing.push(format!("{}: {} {}", document.display(), pair[0], pair[1]));
                }
            }
        }
    }
    assert!(missing.is_empty(), "\n{}\n", missing.join("\n"));
}

/// The command lines of the program in a piece of code: what follows its name, up to what the shell takes for itself.
fn command_lines(code: &str) -> Vec<Vec<String>> {
    let code = code.split(" #").next().unwrap_or_default();
    code.split(['|', ';', '&', '>', '(', ')'])
        .filter_map(|part| {
            let mut words = part.split_whitespace().skip_while(|word| *word == "$");
            (words.next() == Some("shapelex")).then(|| {
                words
                    .map(|word| word.trim_matches(['"', '\'']).to_owned())
                    .take_while(|word| word != "…" && word != "...")
                    .collect()
            })
        })
        .filter(|words: &Vec<String>| !words.is_empty())
        .collect()
}

#[test]
fn commands_named_in_documents_exist_with_their_flags() {
    let mut wrong = Vec::new();
    let mut checked = 0;
    for (document, text) in documents() {
        for piece in code(&text) {
            for words in command_lines(&piece) {
                checked += 1;
                let arguments = std::iter::once("shapelex".to_owned()).chain(words);
                let Err(error) = Cli::command().try_get_matches_from(arguments) else {
                    continue;
                };
                // Placeholders such as DIR are no values, and text may leave arguments out.
                let unknown = [ErrorKind::UnknownArgument, ErrorKind::InvalidSubcommand];
                if unknown.contains(&error.kind()) {
                    wrong.push(format!("{}: {piece}", document.display()));
                }
            }
        }
    }
    assert!(checked > 40, "found only {checked} commands");
    assert!(wrong.is_empty(), "\n{}\n", wrong.join("\n"));
}

#[test]
fn command_lines_end_where_the_shell_takes_over() {
    let found = command_lines("$ shapelex completions bash > /etc/x     # also zsh");
    assert_eq!(found, [["completions", "bash"]]);
    assert_eq!(
        command_lines("shapelex query \"a.obj\" | head; shapelex serve &").len(),
        2
    );
    assert!(command_lines("shapelex").is_empty() && command_lines("./shapelex-data").is_empty());
}
