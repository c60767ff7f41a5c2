//! A query's answer as text, and what is to be said beside it.

use super::output;
use super::verdict::{self, typicality};
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

#[derive(Deserialize)]
struct Row {
    rank: usize,
    class: RowClass,
    score: f64,
    /// Only sparse coding knows these two.
    relative_error: Option<f64>,
    mean_nonzeros: Option<f64>,
    margin: Option<f64>,
    p_value: Option<f64>,
}

#[derive(Deserialize)]
struct RowClass {
    name: String,
}

/// The verdict and the ranked table of one answer.
pub fn text(path: &Path, answer: &Value) -> String {
    let rows: Vec<Row> = answer["classes"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|row| Row::deserialize(row).ok())
        .collect();
    let judged = rows.iter().any(|row| row.p_value.is_some());
    let mut header = vec![
        ">rank",
        "class",
        ">score",
        ">relative error",
        ">non-zeros",
        ">margin to next",
    ];
    if judged {
        header.push(">shapes that fit no better");
    }
    let cells: Vec<Vec<String>> = rows
        .into_iter()
        .map(|row| {
            let shown =
                |value: Option<f64>, write: &dyn Fn(f64) -> String| value.map(write).unwrap_or_default();
            let mut cells = vec![
                row.rank.to_string(),
                row.class.name,
                format!("{:.5}", row.score),
                shown(row.relative_error, &|e| format!("{e:.4}")),
                shown(row.mean_nonzeros, &|n| format!("{n:.2}")),
                shown(row.margin, &|m| format!("{:.2} %", 100.0 * m)),
            ];
            if judged {
                cells.push(shown(row.p_value, &typicality));
            }
            cells
        })
        .collect();
    format!(
        "{}: {}\n{}",
        path.display(),
        verdict::sentence(answer),
        output::table(&header, &cells)
    )
}

/// Says on stderr what should be known about the mesh, each thing once.
pub fn warn(path: &Path, answer: &Value) {
    for warning in warnings(answer) {
        eprintln!("shapelex: {}: {warning}", path.display());
    }
}

/// Leaves each warning once in an answer, where the mesh's report repeats them.
pub fn warn_once(answer: &mut Value) {
    let kept = warnings(answer);
    answer["warnings"] = kept.into();
    if let Some(report) = answer["mesh"].as_object_mut() {
        report.remove("warnings");
    }
}

/// The warnings of an answer and of its mesh's report. That a mesh was simplified is the rule and in the report.
fn warnings(answer: &Value) -> Vec<String> {
    let mut kept: Vec<String> = Vec::new();
    let both = [&answer["warnings"], &answer["mesh"]["warnings"]];
    for warning in both
        .into_iter()
        .filter_map(Value::as_array)
        .flatten()
        .filter_map(Value::as_str)
    {
        if !warning.starts_with("The mesh was simplified from ") && !kept.iter().any(|k| k == warning) {
            kept.push(warning.to_owned());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn each_warning_is_said_once_and_the_usual_simplification_not_at_all() {
        let simplified = "The mesh was simplified from 9000 to 2000 vertices.";
        let mut answer = json!({
            "warnings": [simplified, "The surface is open."],
            "mesh": { "simplified_from": 9000, "warnings": [simplified, "The surface is open."] },
        });
        warn_once(&mut answer);
        assert_eq!(answer["warnings"], json!(["The surface is open."]));
        assert_eq!(answer["mesh"], json!({ "simplified_from": 9000 }));
    }
}
