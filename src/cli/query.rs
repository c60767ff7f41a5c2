//! `shapelex query`: which class a mesh belongs to.

use super::client::{Client, TargetArgs};
use super::dictionaries::Exported;
use super::files::MeshFile;
use super::refused::Refused;
use super::{CliError, api, dictionaries, output};
use crate::cancel::Cancel;
use crate::http::dto::parameters::QueryRankByName;
use crate::http::dto::query::VerdictDto;
use crate::mesh::{Limits, read};
use crate::pipeline::{RankedClass, describe_query, judge, judged_by, rank_top};
use crate::ranking::JUDGED;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Arguments of `query`.
#[derive(Debug, clap::Args)]
pub struct QueryArgs {
    /// Mesh files: OBJ, glTF, GLB, PLY, STL or OFF
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Where the index is.
    #[command(flatten)]
    pub target: TargetArgs,
    /// Query dictionaries written by `export` instead of an index
    #[arg(long, value_name = "FILE", conflicts_with_all = ["data", "server"])]
    pub dictionaries: Option<PathBuf>,
    /// How many classes are shown
    #[arg(long, value_name = "COUNT", default_value_t = 5)]
    pub top: usize,
    /// What classes are ordered by; the index's own parameter where it is left out
    #[arg(long, value_name = "METHOD", value_parser = rank_by)]
    pub rank_by: Option<QueryRankByName>,
}

fn rank_by(text: &str) -> Result<QueryRankByName, String> {
    QueryRankByName::ALL
        .into_iter()
        .find(|name| name.name() == text)
        .ok_or_else(|| {
            format!(
                "expected one of {}",
                QueryRankByName::ALL.map(QueryRankByName::name).join(", ")
            )
        })
}

enum Source {
    Service(Client),
    File(Box<Exported>),
}

/// Ranks every file; goes on after one that is refused. With `--json` one line per file: the API's answer and the
/// file's path.
///
/// # Errors
/// [`CliError::Reported`] where a file was refused; [`CliError::Failed`] where there is nothing to query.
pub fn run(args: &QueryArgs, json: bool) -> Result<(), CliError> {
    let source = match &args.dictionaries {
        Some(path) => Source::File(Box::new(dictionaries::load(path)?)),
        None => Source::Service(args.target.client()?),
    };
    let mut refused = false;
    for path in &args.files {
        match source.rank(path, args.top, args.rank_by) {
            Ok(mut answer) => {
                if json {
                    answer["file"] = json!(path.display().to_string());
                    output::json(&answer)?;
                } else {
                    output::line(&text(path, &answer))?;
                }
            }
            Err(error) => {
                refused = true;
                let code = error.code().map(str::to_owned);
                let refusal = Refused::new(path, error);
                refusal.warn();
                if json {
                    output::json(&json!({ "file": refusal.file, "error": refusal.reason, "code": code }))?;
                }
            }
        }
    }
    if refused { Err(CliError::Reported) } else { Ok(()) }
}

impl Source {
    fn rank(&self, path: &Path, top: usize, rank_by: Option<QueryRankByName>) -> Result<Value, CliError> {
        let limits = Limits::default();
        let file = MeshFile::load(path, limits.max_bytes)?;
        let answer = match self {
            Self::Service(client) => api::query(client, file, Some(top), rank_by.map(QueryRankByName::name))?,
            Self::File(exported) => rank_against(exported, &file, top, rank_by, &limits)?,
        };
        Ok(answer)
    }
}

/// The same stages as the service's query, on an index that came out of a file. The answer has the members of the
/// API's answer that have a meaning without a service.
fn rank_against(
    exported: &Exported,
    file: &MeshFile,
    top: usize,
    rank_by: Option<QueryRankByName>,
    limits: &Limits,
) -> Result<Value, CliError> {
    let index = &exported.index;
    let rank_by = match rank_by.map(QueryRankByName::method) {
        None => index.parameters.rank_by,
        Some(Ok(rank_by)) => rank_by,
        Some(Err(_)) => {
            return Err(CliError::Usage(
                "--rank-by: a file of dictionaries has nothing for this method; query an index with --data or --server"
                    .to_owned(),
            ));
        }
    };
    let cancel = Cancel::new();
    let (format, soup) = read(&file.source(), limits)?;
    let description = describe_query(soup, &index.parameters, &cancel, &|_| ())?;
    // The verdict is about the first few, however many are shown.
    let ranking = rank_top(&description.views, index, rank_by, top.max(JUDGED), &cancel)
        .map_err(crate::pipeline::PipelineError::from)?;
    let calibration = exported.calibration();
    let ranked: Vec<RankedClass<'_>> = ranking
        .classes
        .iter()
        .map(|class| RankedClass {
            label: &class.label,
            name: &class.label,
            score: class.score,
        })
        .collect();
    let judged = judge(
        judged_by(&calibration, &index.parameters, rank_by, &description),
        &ranked,
    );
    let classes: Vec<Value> = ranking
        .classes
        .iter()
        .zip(&judged.p_values)
        .take(top)
        .enumerate()
        .map(|(i, (c, p_value))| {
            json!({
                "rank": i + 1,
                "class": { "name": c.label },
                "score": c.score,
                "reconstruction_error": c.frobenius_error,
                "relative_error": c.relative_error,
                "mean_objective": c.mean_objective,
                "trimmed_objective": c.trimmed_objective,
                "mean_nonzeros": c.mean_nonzeros,
                "hypothesis": c.hypothesis,
                "margin": c.margin,
                "p_value": p_value,
            })
        })
        .collect();
    Ok(json!({
        "name": file.name,
        "classes": classes,
        "verdict": VerdictDto::from(judged.verdict.clone()),
        "probability": judged.verdict.probability,
        "none_of_these": judged.none_of_these,
        "margin": ranking.confidence,
        "confidence": ranking.confidence,
        "compared": ranking.compared,
        "pruned": ranking.pruned,
        "signatures": ranking.signatures,
        "format": format,
        "warnings": description.report.warnings,
        "mesh": description.report,
        "eigenvalues": description.eigenvalues,
        "rank_by": rank_by,
        "parameters": index.parameters,
    }))
}

#[derive(Deserialize)]
struct Row {
    rank: usize,
    class: RowClass,
    score: f64,
    /// Only sparse coding knows these two.
    relative_error: Option<f64>,
    mean_nonzeros: Option<f64>,
    margin: Option<f64>,
}

#[derive(Deserialize)]
struct RowClass {
    name: String,
}

/// The ranked table of one answer.
pub fn text(path: &Path, answer: &Value) -> String {
    let rows: Vec<Vec<String>> = answer["classes"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|row| Row::deserialize(row).ok())
        .map(|row| {
            vec![
                row.rank.to_string(),
                row.class.name,
                format!("{:.5}", row.score),
                row.relative_error.map_or(String::new(), |e| format!("{e:.4}")),
                row.mean_nonzeros.map_or(String::new(), |n| format!("{n:.2}")),
                row.margin
                    .map_or(String::new(), |m| format!("{:.2} %", 100.0 * m)),
            ]
        })
        .collect();
    let mut text = format!("{}\n", path.display());
    text += &output::table(
        &[
            ">rank",
            "class",
            ">score",
            ">relative error",
            ">non-zeros",
            ">margin to next",
        ],
        &rows,
    );
    for warning in answer["warnings"].as_array().into_iter().flatten() {
        text += &format!("\nwarning: {}", warning.as_str().unwrap_or_default());
    }
    text
}
