//! No file imports another that imports it again, directly or through others.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Files of a package by module path, such as `store::keys`; the root is the empty path.
type Modules = BTreeMap<String, String>;

/// `http/routes/query.rs` → `http::routes::query`, `store/mod.rs` → `store`, `lib.rs` → the empty path.
fn module_path(file: &Path) -> String {
    let stem = file.with_extension("");
    let mut parts: Vec<&str> = stem.iter().filter_map(|part| part.to_str()).collect();
    if matches!(parts.last(), Some(&("mod" | "lib" | "main"))) {
        parts.pop();
    }
    parts.join("::")
}

/// The paths of a `use` tree, one per leaf, without what follows `as`.
fn leaves(prefix: &str, tree: &str, found: &mut Vec<String>) {
    let tree = tree.trim();
    let Some(open) = tree.find('{') else {
        let name = tree.split(" as ").next().unwrap_or(tree).trim();
        found.push(format!("{prefix}{name}"));
        return;
    };
    let prefix = format!("{prefix}{}", &tree[..open]);
    let inner = tree[open + 1..].trim_end().trim_end_matches('}');
    let (mut depth, mut from) = (0, 0);
    for (at, c) in inner.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                leaves(&prefix, &inner[from..at], found);
                from = at + 1;
            }
            _ => {}
        }
    }
    if !inner[from..].trim().is_empty() {
        let rest = &inner[from..];
        // The closing brackets of an inner group that were trimmed with the outer one.
        let missing = rest
            .matches('{')
            .count()
            .saturating_sub(rest.matches('}').count());
        leaves(&prefix, &format!("{rest}{}", "}".repeat(missing)), found);
    }
}

/// Paths below `crate`, `super` and `self` that code names, in `use` declarations and elsewhere.
fn named_paths(code: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut body = String::new();
    let mut rest = code;
    while let Some(at) = rest.find("use ") {
        let starts = rest[..at].chars().next_back().is_none_or(char::is_whitespace);
        let tree = &rest[at + 4..];
        let is_own = ["crate::", "super::", "self::"]
            .iter()
            .any(|own| tree.starts_with(own));
        body.push_str(&rest[..at]);
        rest = tree;
        if starts && is_own {
            let end = tree.find(';').unwrap_or(tree.len());
            leaves("", &tree[..end], &mut found);
            rest = &tree[end..];
        }
    }
    body.push_str(rest);
    for own in ["crate::", "super::"] {
        for (at, _) in body.match_indices(own) {
            let before = body[..at].chars().next_back();
            if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':' || c == '$') {
                continue;
            }
            let path: String = body[at..]
                .chars()
                .take_while(|c| c.is_alphanumeric() || *c == '_' || *c == ':')
                .collect();
            found.push(path.trim_end_matches(':').to_owned());
        }
    }
    found
}

/// The module that `path` leads to from the module `from`, and the item it names there.
fn resolve<'a>(modules: &'a Modules, from: &str, path: &str) -> Option<(&'a str, String)> {
    let mut base: Vec<&str> = from.split("::").filter(|part| !part.is_empty()).collect();
    let mut parts = path.split("::").peekable();
    match parts.peek() {
        Some(&"crate") => {
            base.clear();
            parts.next();
        }
        Some(&"self") => _ = parts.next(),
        _ => {}
    }
    while parts.peek() == Some(&"super") {
        base.pop()?;
        parts.next();
    }
    let all: Vec<&str> = base.into_iter().chain(parts).collect();
    (0..=all.len()).rev().find_map(|n| {
        let (module, _) = modules.get_key_value(&all[..n].join("::"))?;
        Some((
            module.as_str(),
            all.get(n).map_or(String::new(), |item| (*item).to_owned()),
        ))
    })
}

/// (module, item) → the module that the item is re-exported from.
fn reexports(modules: &Modules) -> BTreeMap<(String, String), String> {
    let mut table = BTreeMap::new();
    for (module, code) in modules {
        for declaration in code.split("pub").skip(1) {
            let declaration = declaration.trim_start();
            let declaration = match declaration.strip_prefix('(') {
                Some(rest) => rest.split_once(')').map_or("", |(_, rest)| rest.trim_start()),
                None => declaration,
            };
            let Some(tree) = declaration.strip_prefix("use ") else {
                continue;
            };
            let tree = tree.split(';').next().unwrap_or_default();
            let mut found = Vec::new();
            leaves("", tree, &mut found);
            for path in found {
                if let Some((source, item)) = resolve(modules, module, &path).filter(|(s, _)| s != module) {
                    table.insert((module.clone(), item), source.to_owned());
                }
            }
        }
    }
    table
}

/// Module → modules it uses. Declaring and re-exporting its own submodules is no use.
fn graph(modules: &Modules) -> BTreeMap<&str, BTreeSet<&str>> {
    let reexported = reexports(modules);
    let mut graph = BTreeMap::new();
    for (module, code) in modules {
        let only_reexports = !code.contains("fn ");
        let mut used = BTreeSet::new();
        for path in named_paths(code) {
            let Some((mut target, item)) = resolve(modules, module, &path) else {
                continue;
            };
            while let Some(source) = reexported.get(&(target.to_owned(), item.clone())) {
                let Some((source, _)) = modules.get_key_value(source) else {
                    break;
                };
                target = source;
            }
            let own = target == module || (item.is_empty() && module.starts_with(&format!("{target}::")));
            let below = target.starts_with(&format!("{module}::")) || module.is_empty();
            if !(own || below && only_reexports) {
                used.insert(target);
            }
        }
        graph.insert(module.as_str(), used);
    }
    graph
}

/// The modules that can be reached from `from`.
fn reachable<'a>(graph: &BTreeMap<&'a str, BTreeSet<&'a str>>, from: &str) -> BTreeSet<&'a str> {
    let mut seen = BTreeSet::new();
    let mut next: Vec<&str> = graph.get(from).into_iter().flatten().copied().collect();
    while let Some(module) = next.pop() {
        if seen.insert(module) {
            next.extend(graph.get(module).into_iter().flatten());
        }
    }
    seen
}

/// Groups of modules that reach each other.
fn circles(modules: &Modules) -> BTreeSet<Vec<String>> {
    let graph = graph(modules);
    let reach: BTreeMap<&str, BTreeSet<&str>> = graph
        .keys()
        .map(|&module| (module, reachable(&graph, module)))
        .collect();
    let mut found = BTreeSet::new();
    for (&module, reached) in &reach {
        let mutual = |other: &&&str| reach.get(**other).is_some_and(|back| back.contains(module));
        let mut group: Vec<String> = reached.iter().filter(mutual).map(|&m| m.to_owned()).collect();
        if group.len() > 1 {
            group.sort();
            found.insert(group);
        }
    }
    found
}

#[test]
fn no_file_imports_itself_through_others() {
    for (folder, _) in super::ORDERS {
        let modules: Modules = super::sources(folder)
            .into_iter()
            .filter(|(path, _)| !path.ends_with("tests.rs"))
            .map(|(path, text)| (module_path(&path), super::production(&text)))
            .collect();
        let circles = circles(&modules);
        assert!(circles.is_empty(), "{folder}: {circles:#?}");
        assert!(
            graph(&modules).values().map(BTreeSet::len).sum::<usize>() > 30,
            "{folder}"
        );
    }
}

#[test]
fn circles_are_seen() {
    let modules = |files: &[(&str, &str)]| -> Modules {
        files
            .iter()
            .map(|(path, code)| ((*path).to_owned(), (*code).to_owned()))
            .collect()
    };
    let straight = modules(&[
        ("", "pub mod a;"),
        ("a", "pub mod x; pub mod y;\npub use x::X;"),
        ("a::x", "use super::y::Y; pub struct X;"),
        ("a::y", "pub struct Y;"),
        ("b", "use crate::a::{X, y::{Y, Z as W}}; fn f() {}"),
    ]);
    assert!(circles(&straight).is_empty(), "{:?}", circles(&straight));
    assert_eq!(graph(&straight)["b"], ["a::x", "a::y"].into());
    let mut round = straight;
    round.insert(
        "a::y".to_owned(),
        "pub struct Y; fn f() -> super::X {}".to_owned(),
    );
    assert_eq!(
        circles(&round),
        [vec!["a::x".to_owned(), "a::y".to_owned()]].into()
    );
}
