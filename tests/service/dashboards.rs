//! The dashboard and the alert rules ask for series that exist.

use crate::harness::App;
use std::collections::BTreeSet;
use std::path::Path;

fn file(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docker").join(name)).unwrap()
}

/// Every `shapelex_…` that is followed by something no word goes on with.
fn names(text: &str) -> BTreeSet<String> {
    text.match_indices("shapelex_")
        .map(|(at, _)| {
            text[at..]
                .chars()
                .take_while(|c| c.is_ascii_alphanumeric() || *c == '_')
                .collect()
        })
        .collect()
}

/// Values of a label, as in `code="overloaded"`.
fn values<'a>(text: &'a str, label: &str) -> Vec<&'a str> {
    let begin = format!("{label}=\"");
    text.match_indices(&begin)
        .filter_map(|(at, _)| text[at + begin.len()..].split('"').next())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn dashboards_and_alerts_ask_for_series_that_exist() {
    let metrics = App::new().get("/metrics").await.text();
    let existing = names(&metrics);
    let dashboard = file("grafana-dashboard.json");
    let parsed: serde_json::Value = serde_json::from_str(&dashboard).unwrap();
    assert!(parsed["panels"].as_array().unwrap().len() > 8);
    let dashboard = dashboard.replace("\\\"", "\"");
    for (source, text) in [("dashboard", dashboard), ("alerts", file("alerts.yaml"))] {
        let asked = names(&text);
        assert!(asked.len() > 4, "{source}: {asked:?}");
        for name in asked {
            assert!(existing.contains(&name), "{source} asks for {name}");
        }
        for label in ["code", "operation", "status", "stage"] {
            for value in values(&text, label) {
                let series = format!("{label}=\"{value}\"");
                assert!(metrics.contains(&series), "{source} asks for {series}");
            }
        }
    }
}

#[test]
fn the_manual_explains_every_alert() {
    let manual = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/operations.md");
    let manual = std::fs::read_to_string(manual).unwrap();
    let rules = file("alerts.yaml");
    let alerts: Vec<&str> = rules
        .lines()
        .filter_map(|l| l.trim().strip_prefix("- alert: "))
        .collect();
    assert!(alerts.len() > 5);
    for alert in alerts {
        assert!(
            manual.contains(&format!("`{alert}`")),
            "docs/operations.md does not explain {alert}"
        );
    }
}

#[test]
fn the_systemd_unit_starts_the_service_as_the_manual_says() {
    let unit = file("shapelex.service");
    let value = |key: &str| {
        let line = unit
            .lines()
            .find_map(|line| line.strip_prefix(&format!("{key}=")));
        line.unwrap_or_else(|| panic!("the unit has no {key}"))
    };
    assert!(value("ExecStart").ends_with("shapelex serve --data /var/lib/shapelex"));
    assert_eq!(value("StateDirectory"), "shapelex");
    // systemd must not kill a service that is still closing its store.
    let grace: u64 = value("TimeoutStopSec").parse().unwrap();
    let shutdown = shapelex::http::ServiceConfig::default()
        .shutdown_timeout
        .as_secs();
    assert!(grace > 2 * shutdown, "{grace} s against {shutdown} s");
}
