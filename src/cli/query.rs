//! `shapelex query`: which class a mesh belongs to.

use super::client::{Client, TargetArgs};
use super::dictionaries::Exported;
use super::files::MeshFile;
use super::progress::Progress;
use super::query_inputs::{Input, gather};
use super::query_summary::Summary;
use super::refused::Refused;
use super::values::{at_least_one, one_of};
use super::{CliError, api, dictionaries, output, query_text};
use crate::http::dto::parameters::QueryRankByName;
use crate::http::dto::query::VerdictDto;
use serde_json::{Value, json};
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{Limits, ReadContext, read_within};
use shapelex_core::parameters::RankBy;
use shapelex_core::pipeline::prepared::refined_to;
use shapelex_core::pipeline::{RankedClass, describe_query, judge, judged_by, rank_top};
use shapelex_core::ranking::JUDGED;
use std::path::PathBuf;

/// Arguments of `query`.
#[derive(Debug, clap::Args)]
pub struct QueryArgs {
    /// Mesh files (OBJ, glTF, GLB, PLY, STL or OFF), folders of such, or - for standard input; subfolders of a folder
    /// name the classes of what is in them, and the answers are compared with them
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// What the mesh on standard input is called; an extension tells its format where its bytes do not
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// Where the index is.
    #[command(flatten)]
    pub target: TargetArgs,
    /// Query dictionaries written by `export` instead of an index
    #[arg(long, value_name = "FILE", conflicts_with_all = ["data", "server"])]
    pub dictionaries: Option<PathBuf>,
    /// How many classes are shown
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = at_least_one)]
    pub top: usize,
    /// What classes are ordered by; the index's own parameter where it is left out
    #[arg(long, value_name = "METHOD", value_parser = one_of(&RANK_BY, QueryRankByName::name))]
    pub rank_by: Option<QueryRankByName>,
}

static RANK_BY: [QueryRankByName; 7] = QueryRankByName::ALL;

enum Source {
    Service(Client),
    File(Box<Exported>, RankBy),
}

/// Ranks every mesh; goes on after one that is refused. With `--json` one line per mesh: the API's answer and the file's
/// path. Of several meshes, and of a folder, a last line sums up.
///
/// # Errors
/// [`CliError::Usage`] where there is nothing to query, or nothing to query it against; [`CliError::Reported`] where a
/// mesh was refused.
pub fn run(args: &QueryArgs, json: bool) -> Result<(), CliError> {
    let inputs = gather(&args.files, args.name.as_deref())?;
    let source = source(args)?;
    let several = inputs.len() > 1 || args.files.iter().any(|path| path.is_dir());
    let progress = Progress::at_terminal("query", inputs.len()).filter(|_| several);
    let mut summary = Summary::default();
    for input in &inputs {
        let outcome = source.rank(input, args.top, args.rank_by);
        if let Some(progress) = &progress {
            progress.tick();
        }
        Progress::suspended(progress.as_ref(), || tell(input, outcome, &mut summary, json))?;
    }
    if let Some(progress) = progress {
        progress.clear();
    }
    if several && json {
        output::json(&summary.json())?;
    } else if several {
        output::line(&summary.text())?;
    }
    if summary.refused > 0 {
        Err(CliError::Reported)
    } else {
        Ok(())
    }
}

/// Prints one answer, or why there is none, and counts it.
fn tell(
    input: &Input,
    outcome: Result<Value, CliError>,
    summary: &mut Summary,
    json: bool,
) -> Result<(), CliError> {
    match outcome {
        Ok(mut answer) => {
            summary.add(&answer, input.class.as_deref());
            answer["file"] = json!(input.path.display().to_string());
            if json {
                query_text::warn_once(&mut answer);
                output::json(&answer)
            } else {
                query_text::warn(&input.path, &answer);
                output::line(&query_text::text(&input.path, &answer))
            }
        }
        Err(error) => {
            summary.refuse();
            let code = error.code().map(str::to_owned);
            let refusal = Refused::new(&input.path, error);
            refusal.warn();
            if json {
                output::json(&json!({ "file": refusal.file, "error": refusal.reason, "code": code }))?;
            }
            Ok(())
        }
    }
}

fn source(args: &QueryArgs) -> Result<Source, CliError> {
    let Some(path) = &args.dictionaries else {
        return Ok(Source::Service(args.target.client()?));
    };
    let exported = dictionaries::load(path)?;
    let rank_by = match args.rank_by.map(QueryRankByName::method) {
        None => exported.index.parameters.rank_by,
        Some(Ok(rank_by)) => rank_by,
        Some(Err(_)) => {
            return Err(CliError::Usage(
                "--rank-by: a file of dictionaries has nothing for this method; query an index with --data or --server"
                    .to_owned(),
            ));
        }
    };
    Ok(Source::File(Box::new(exported), rank_by))
}

impl Source {
    fn rank(&self, input: &Input, top: usize, rank_by: Option<QueryRankByName>) -> Result<Value, CliError> {
        let limits = Limits::default();
        let file = input.load(limits.max_bytes)?;
        let answer = match self {
            Self::Service(client) => api::query(client, file, Some(top), rank_by.map(QueryRankByName::name))?,
            Self::File(exported, rank_by) => rank_against(exported, &file, top, *rank_by, &limits)?,
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
    rank_by: RankBy,
    limits: &Limits,
) -> Result<Value, CliError> {
    let index = &exported.index;
    let cancel = Cancel::new();
    let context = ReadContext::new(*limits);
    let (format, soup) = read_within(&file.source(), &context)?;
    let mut description = describe_query(soup, &index.parameters, &cancel, &|_| ())?;
    description.report.warnings.splice(0..0, context.warnings.list());
    // The verdict is about the first few, however many are shown.
    let ranking = rank_top(&description.views, index, rank_by, top.max(JUDGED), &cancel)
        .map_err(shapelex_core::pipeline::PipelineError::from)?;
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
        "compared": ranking.compared,
        "pruned": ranking.pruned,
        "signatures": ranking.signatures,
        "format": format,
        "warnings": description.report.warnings,
        "mesh": description.report,
        "refined_to": Some(refined_to(&description.report, &index.parameters)).filter(|&to| to > 0),
        "eigenvalues": description.eigenvalues,
        "rank_by": rank_by,
        "parameters": index.parameters,
    }))
}
