//! A query's answer as text, and what is to be said beside it.

use super::output;
use super::output::note_line;
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
    let pose = match answer["pose"]["label"].as_str() {
        Some(label) => format!(", pose {label}"),
        None => String::new(),
    };
    let mesh = match answer["mesh"]["summary"].as_str() {
        Some(summary) => format!("mesh: {summary}\n"),
        None => String::new(),
    };
    format!(
        "{}{pose}: {}\n{mesh}{}",
        path.display(),
        verdict::sentence(answer),
        output::table(&header, &cells)
    )
}

/// Says on stderr what should be known about the mesh, each thing once.
pub fn warn(path: &Path, answer: &Value) {
    for warning in warnings(answer) {
        note_line!("shapelex: {}: {warning}", path.display());
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

/// The warnings of an answer and of its mesh's report.
fn warnings(answer: &Value) -> Vec<String> {
    let mut kept: Vec<String> = Vec::new();
    let both = [&answer["warnings"], &answer["mesh"]["warnings"]];
    for warning in both
        .into_iter()
        .filter_map(Value::as_array)
        .flatten()
        .filter_map(Value::as_str)
    {
        if !kept.iter().any(|k| k == warning) {
            kept.push(warning.to_owned());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::dto::shape::ReportDto;
    use serde_json::json;
    use shapelex_core::mesh::PrepareReport;

    #[test]
    fn each_warning_is_said_once() {
        let mut answer = json!({
            "warnings": ["The surface is open."],
            "mesh": { "simplified_from": 9000, "warnings": ["The surface is open."] },
        });
        warn_once(&mut answer);
        assert_eq!(answer["warnings"], json!(["The surface is open."]));
        assert_eq!(answer["mesh"], json!({ "simplified_from": 9000 }));
    }

    #[test]
    fn simplification_and_refinement_are_said_beside_the_verdict() {
        let report = PrepareReport {
            input_vertices: 9000,
            input_faces: 18000,
            simplified_from: Some(9000),
            vertices: 800,
            refined_to: Some(2500),
            ..PrepareReport::default()
        };
        let answer = json!({ "verdict": { "text": "cat" }, "mesh": ReportDto::from(report), "classes": [] });
        let said = text(Path::new("a.obj"), &answer);
        let lines: Vec<&str> = said.lines().take(2).collect();
        assert_eq!(
            lines,
            [
                "a.obj: cat",
                "mesh: 9000 vertices and 18000 faces, simplified to 800 vertices, refined to 2500 vertices for the spectrum"
            ]
        );
    }
}
