//! Lines of JSON → curves of cost over size.

use super::Outcome;
use serde_json::Value;
use shapelex_eval::figure::{CostAxes, Series, cost_curves};
use std::fs;
use std::path::Path;

/// A figure: the key of its sizes, the label of its values, and the keys of its curves with their labels.
struct Figure {
    x: &'static str,
    y: &'static str,
    title: &'static str,
    curves: &'static [(&'static str, &'static str)],
}

const FIGURES: [Figure; 4] = [
    Figure {
        x: "vertices",
        y: "time (ms)",
        title: "Binary PLY to signatures",
        curves: &[("read_ms", "read"), ("describe_ms", "read and described")],
    },
    Figure {
        x: "classes",
        y: "time (ms)",
        title: "Ranking one query",
        curves: &[("brute_ms", "all classes"), ("top_ms", "the ten best")],
    },
    Figure {
        x: "shapes",
        y: "time (ms)",
        title: "A class of so many training shapes",
        curves: &[
            ("describe_ms", "describe"),
            ("learn_ms", "learn"),
            ("calibrate_ms", "calibrate"),
        ],
    },
    Figure {
        x: "clients",
        y: "time (ms)",
        title: "Queries of concurrent clients",
        curves: &[("p50_ms", "median"), ("p99_ms", "99th percentile")],
    },
];

/// Draws every figure the lines of `path` have points for into `directory`, as `cost-<size>.svg`.
pub fn plot(path: &Path, directory: &Path) -> Outcome<()> {
    let text = fs::read_to_string(path)?;
    let lines: Vec<Value> = serde_json::Deserializer::from_str(&text)
        .into_iter()
        .collect::<Result<_, _>>()?;
    // The load generator answers one object with its rounds inside.
    let points: Vec<&Value> = lines
        .iter()
        .flat_map(|line| match line["rounds"].as_array() {
            Some(rounds) => rounds.iter().filter(|round| round["reindex"] == false).collect(),
            None => vec![line],
        })
        .collect();
    fs::create_dir_all(directory)?;
    for Figure { x, y, title, curves } in FIGURES {
        let series: Vec<Series> = curves
            .iter()
            .map(|(key, label)| Series {
                label: (*label).to_owned(),
                points: points
                    .iter()
                    .filter_map(|point| Some((point[x].as_f64()?, point[key].as_f64()?)))
                    .collect(),
            })
            .collect();
        if series.iter().all(|s| s.points.is_empty()) {
            continue;
        }
        let svg = cost_curves(title, CostAxes { x, y }, &series)?;
        fs::write(directory.join(format!("cost-{x}.svg")), svg)?;
    }
    Ok(())
}
