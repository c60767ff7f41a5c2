//! `docs/configuration.md` says what the program does.

use crate::repository;
use clap::CommandFactory;
use shapelex::cli::Cli;
use shapelex::config::Config;

/// The table as the definitions have it: one row per setting of `serve`.
fn table() -> String {
    let defaults = serde_json::to_value(Config::default()).unwrap();
    let mut cli = Cli::command();
    cli.build();
    let serve = cli.find_subcommand("serve").unwrap();
    let mut lines = vec![
        "| flag | environment | file | default | meaning |".to_owned(),
        "|---|---|---|---|---|".to_owned(),
    ];
    for arg in serve.get_arguments() {
        let id = arg.get_id().as_str();
        let Some(default) = defaults.get(id) else { continue };
        let default = match default {
            serde_json::Value::String(text) if text.is_empty() => "none".to_owned(),
            serde_json::Value::Array(items) if items.is_empty() => "none".to_owned(),
            serde_json::Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        lines.push(format!(
            "| `--{}` | `{}` | `{id}` | `{default}` | {} |",
            arg.get_long().unwrap(),
            arg.get_env().unwrap().to_str().unwrap(),
            arg.get_help().unwrap(),
        ));
    }
    lines.join("\n")
}

/// Set `SHAPELEX_UPDATE_DOCS=1` to write the table instead of checking it.
#[test]
fn the_documented_table_is_the_programs_own() {
    const BEGIN: &str = "<!-- settings: checked by tests/cli/configuration.rs -->\n";
    const END: &str = "\n<!-- end of settings -->";
    let path = repository("docs/configuration.md");
    let document = std::fs::read_to_string(&path).unwrap();
    let begin = document.find(BEGIN).expect("the table's beginning is marked") + BEGIN.len();
    let end = document.find(END).expect("the table's end is marked");
    let table = table();
    assert!(table.lines().count() > 15, "{table}");
    if std::env::var_os("SHAPELEX_UPDATE_DOCS").is_some() {
        std::fs::write(
            &path,
            format!("{}{table}{}", &document[..begin], &document[end..]),
        )
        .unwrap();
        return;
    }
    assert_eq!(
        &document[begin..end],
        table,
        "docs/configuration.md is out of date; SHAPELEX_UPDATE_DOCS=1 cargo test --release --test cli rewrites it"
    );
}

#[test]
fn the_command_line_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn every_setting_has_the_same_name_in_all_three_spellings() {
    let mut cli = Cli::command();
    cli.build();
    let serve = cli.find_subcommand("serve").unwrap();
    let defaults = serde_json::to_value(Config::default()).unwrap();
    for key in defaults.as_object().unwrap().keys() {
        let arg = serve
            .get_arguments()
            .find(|a| a.get_id() == key.as_str())
            .unwrap();
        assert_eq!(arg.get_long().unwrap(), key.replace('_', "-"));
        assert_eq!(
            arg.get_env().unwrap().to_str().unwrap(),
            format!("SHAPELEX_{}", key.to_uppercase())
        );
    }
}
