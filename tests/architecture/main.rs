//! The house's rules, as tests: who may use whom, and how long a file may be.

mod circles;
mod documents;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The modules of each package; one may use only what stands to its left. What a package may use is in its manifest.
const ORDERS: [(&str, &[&str]); 3] = [
    (
        "crates/shapelex-core/src",
        &[
            "cancel",
            "memory",
            "mesh",
            "spectral",
            "signature",
            "coding",
            "parameters",
            "ranking",
            "pipeline",
            "baseline",
            "retrieval",
        ],
    ),
    ("crates/shapelex-eval/src", &["sample", "benchmark", "figure"]),
    (
        "src",
        &["model", "store", "jobs", "http", "telemetry", "config", "cli"],
    ),
];

/// Lines a file may have; the aim is 400.
const MAX_LINES: usize = 450;

fn rust_files(dir: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// The files below `folder` with their text; paths are relative to it.
fn sources(folder: &str) -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut files = Vec::new();
    rust_files(&root, &mut files);
    files.sort();
    assert!(files.len() > 30, "found only {} files in {folder}", files.len());
    files
        .into_iter()
        .map(|path| {
            let text = std::fs::read_to_string(&path).unwrap();
            (path.strip_prefix(&root).unwrap().to_owned(), text)
        })
        .collect()
}

/// `store/keys.rs` → `store`; `None` for `lib.rs` and `main.rs`.
fn module_of(path: &Path) -> Option<String> {
    let first = path.components().next().unwrap().as_os_str().to_str().unwrap();
    let name = first.strip_suffix(".rs").unwrap_or(first);
    (name != "lib" && name != "main").then(|| name.to_owned())
}

/// Code without comments and without what follows the first test module.
fn production(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod ").unwrap_or(text.len());
    text[..end]
        .lines()
        .map(|line| match line.trim_start().starts_with("//") {
            true => "",
            false => line.split(" // ").next().unwrap_or(line),
        })
        .collect::<Vec<_>>()
        .join("\n")
}

/// Names that follow `crate::`, also inside `use crate::{…}`.
fn used_modules(code: &str) -> Vec<String> {
    let identifier = |text: &str| -> String {
        text.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect()
    };
    let mut used = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        // `$crate::` of a macro is the same crate; `other_crate::` is not.
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &code[at + "crate::".len()..];
        match rest.strip_prefix('{') {
            None => used.push(identifier(rest)),
            Some(group) => {
                let mut depth = 0;
                let mut item = String::new();
                for c in group.chars() {
                    match c {
                        '{' => depth += 1,
                        '}' if depth == 0 => break,
                        '}' => depth -= 1,
                        ',' if depth == 0 => used.push(identifier(std::mem::take(&mut item).trim())),
                        _ => {}
                    }
                    if depth == 0 && c != ',' && c != '}' {
                        item.push(c);
                    }
                }
                used.push(identifier(item.trim()));
            }
        }
    }
    used.retain(|name| !name.is_empty());
    used
}

#[test]
fn a_module_uses_only_what_stands_to_its_left() {
    let mut wrong = Vec::new();
    for (folder, order) in ORDERS {
        let place = |name: &str| order.iter().position(|&m| m == name);
        let mut seen = BTreeSet::new();
        for (path, text) in sources(folder) {
            let Some(module) = module_of(&path) else { continue };
            let Some(own) = place(&module) else {
                wrong.push(format!(
                    "{folder}/{}: module '{module}' has no place in the order",
                    path.display()
                ));
                continue;
            };
            for used in used_modules(&production(&text)) {
                // A name that is no module, such as a macro of the crate's root, has no place and breaks no order.
                if place(&used).is_some_and(|other| other > own) {
                    wrong.push(format!("{folder}/{}: {module} uses {used}", path.display()));
                }
            }
            seen.insert(module);
        }
        assert_eq!(seen.len(), order.len(), "{folder} has {seen:?}");
    }
    wrong.dedup();
    assert!(wrong.is_empty(), "\n{}\n", wrong.join("\n"));
}

#[test]
fn files_have_one_purpose_and_so_stay_short() {
    let long: Vec<String> = ORDERS
        .iter()
        .flat_map(|(folder, _)| sources(folder).into_iter().map(move |source| (folder, source)))
        .map(|(folder, (path, text))| (format!("{folder}/{}", path.display()), text.lines().count()))
        .filter(|&(_, lines)| lines > MAX_LINES)
        .map(|(path, lines)| format!("{path}: {lines} lines, at most {MAX_LINES}"))
        .collect();
    assert!(long.is_empty(), "\n{}\n", long.join("\n"));
}

#[test]
fn the_reader_of_imports_sees_all_of_them() {
    let code = "use crate::mesh::{TriMesh, read};\nuse crate::{store::Store, http::{a, b}, cli};\nlet x = \
                crate::jobs::Job;\nuse other_crate::ignored;";
    assert_eq!(used_modules(code), ["mesh", "store", "http", "cli", "jobs"]);
    assert_eq!(
        used_modules(&production(
            "// crate::http\nfn f() {}\n#[cfg(test)]\nmod tests { use crate::cli; }"
        )),
        [""; 0]
    );
}
