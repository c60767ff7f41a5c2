//! `shapelex query`: which class a mesh belongs to.

use super::ask::Question;
use super::client::{CallError, Client, TargetArgs};
use super::dictionaries::Exported;
use super::files::MeshFile;
use super::progress::Progress;
use super::query_inputs::{Input, Place, gather};
use super::query_summary::Summary;
use super::refused::Refused;
use super::values::{at_least_one, one_of};
use super::{CliError, dictionaries, output, query_text};
use crate::http::dto::parameters::QueryRankByName;
use crate::http::dto::query::VerdictDto;
use crate::http::dto::shape::ReportDto;
use serde_json::{Value, json};
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{
    Format, Limits, MeshError, Pose, ReadContext, TriangleSoup, read_poses_within, read_within,
};
use shapelex_core::parameters::RankBy;
use shapelex_core::pipeline::{RankedClass, describe_query, judge, judged_by, rank_top};
use shapelex_core::ranking::JUDGED;
use std::path::PathBuf;

/// Arguments of `query`.
#[derive(Debug, clap::Args)]
pub struct QueryArgs {
    /// Mesh files (OBJ, glTF, GLB, PLY, STL or OFF), folders of such, or - for standard input; subfolders of a folder
    /// name the classes of what is in them, and the answers are compared with them
    #[arg(required_unless_present = "shape", value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// A shape of the index to query with, by its id or as CLASS/ID, as `shapes list` shows it; may be given several times.
    /// The index was learnt from it, so its own class fits it better than a new shape
    #[arg(long, value_name = "CLASS/ID", conflicts_with = "dictionaries")]
    pub shape: Vec<String>,
    /// Sample this many poses of every animated glTF and answer each; other files count once
    #[arg(long, value_name = "COUNT", value_parser = at_least_one)]
    pub poses: Option<usize>,
    /// Answer only this one of the poses, from 0
    #[arg(long, value_name = "NUMBER", requires = "poses")]
    pub pose: Option<usize>,
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

impl QueryArgs {
    fn question(&self) -> Result<Question, CliError> {
        if let (Some(poses), Some(pose)) = (self.poses, self.pose)
            && pose >= poses
        {
            return Err(CliError::Usage(format!(
                "--pose {pose}: expected a number below --poses, which is {poses}; poses are counted from 0"
            )));
        }
        Ok(Question {
            top: Some(self.top),
            rank_by: self.rank_by,
            poses: self.poses,
            pose: self.pose,
        })
    }
}

/// Ranks every mesh; goes on after one that is refused. With `--json` one line per mesh: the API's answer and the file's
/// path. Of several meshes, and of a folder, a last line sums up.
///
/// # Errors
/// [`CliError::Usage`] where there is nothing to query, or nothing to query it against; [`CliError::Reported`] where a
/// mesh was refused.
pub fn run(args: &QueryArgs, json: bool) -> Result<(), CliError> {
    let question = args.question()?;
    let mut inputs = gather(&args.files, args.name.as_deref())?;
    inputs.extend(args.shape.iter().map(|shape| Input::stored(shape)));
    let source = source(args)?;
    let several = inputs.len() > 1 || args.poses.is_some() || args.files.iter().any(|path| path.is_dir());
    let progress = Progress::at_terminal("query", inputs.len()).filter(|_| several);
    let mut summary = Summary::default();
    for input in &inputs {
        let outcomes = source
            .rank(input, &question)
            .unwrap_or_else(|error| vec![Err(error)]);
        if let Some(progress) = &progress {
            progress.tick();
        }
        Progress::suspended(progress.as_ref(), || {
            outcomes
                .into_iter()
                .try_for_each(|outcome| tell(input, outcome, &mut summary, json))
        })?;
    }
    if let Some(progress) = progress {
        progress.clear();
    }
    let sums_up = summary.total > 1 || args.files.iter().any(|path| path.is_dir());
    if sums_up && json {
        output::json(&summary.json())?;
    } else if sums_up {
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
    let place = match input.place {
        Place::File => "file",
        Place::Stored => "shape",
    };
    match outcome {
        Ok(mut answer) => {
            summary.add(&answer, input.class.as_deref());
            answer[place] = json!(input.path.display().to_string());
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
                output::json(&json!({ place: refusal.file, "error": refusal.reason, "code": code }))?;
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

/// One answer or refusal per pose that was asked about.
type Outcomes = Result<Vec<Result<Value, CliError>>, CliError>;

impl Source {
    fn rank(&self, input: &Input, question: &Question) -> Outcomes {
        let limits = Limits::default();
        let client = match self {
            Self::Service(client) => client,
            Self::File(exported, rank_by) => {
                let file = input.load(limits.max_bytes)?;
                return rank_against(exported, &file, question, *rank_by, &limits);
            }
        };
        // Files that are not animated count once.
        let is_still = |outcomes: &Outcomes| {
            let refused = |error: &CliError| error.code() == Some("no_animation");
            question.pose.is_none() && outcomes.as_ref().is_err_and(refused)
        };
        let resting = Question {
            poses: None,
            ..*question
        };
        if input.place == Place::Stored {
            let shape = input.path.to_string_lossy();
            let asked = outcomes(question.stored(client, &shape));
            return match is_still(&asked) {
                true => outcomes(resting.stored(client, &shape)),
                false => asked,
            };
        }
        let file = input.load(limits.max_bytes)?;
        if question.poses.is_none() {
            return outcomes(question.file(client, file));
        }
        let asked = outcomes(question.file(client, file.clone()));
        match is_still(&asked) {
            true => outcomes(resting.file(client, file)),
            false => asked,
        }
    }
}

/// What a service answered; a file that could not be read is refused as a whole.
fn outcomes(found: Result<Vec<Result<Value, CallError>>, CallError>) -> Outcomes {
    let mut found: Vec<Result<Value, CliError>> = found?
        .into_iter()
        .map(|one| one.map_err(CliError::from))
        .collect();
    match (found.pop(), found.is_empty()) {
        (Some(Err(error)), true) => Err(error),
        (last, _) => {
            found.extend(last);
            Ok(found)
        }
    }
}

/// The meshes of a file that are asked about.
fn soups(
    file: &MeshFile,
    question: &Question,
    context: &ReadContext,
) -> Result<(Format, Vec<(Value, TriangleSoup)>), CliError> {
    let resting = || -> Result<_, CliError> {
        let (format, soup) = read_within(&file.source(), context)?;
        Ok((format, vec![(Value::Null, soup)]))
    };
    let Some(poses) = question.poses else {
        return resting();
    };
    let (format, found) = match read_poses_within(&file.source(), poses, context) {
        // Files that are not animated count once.
        Err(MeshError::NoAnimation) if question.pose.is_none() => return resting(),
        found => found?,
    };
    let of = found.len();
    let meant = |(index, _): &(usize, Pose)| question.pose.is_none_or(|pose| pose == *index);
    let found = found.into_iter().enumerate().filter(meant).map(|(index, pose)| {
        let label = json!({ "label": pose.label, "index": index, "of": of });
        (label, pose.soup)
    });
    Ok((format, found.collect()))
}

/// The same stages as the service's query, on an index that came out of a file. The answers have the members of the
/// API's answer that have a meaning without a service.
fn rank_against(
    exported: &Exported,
    file: &MeshFile,
    question: &Question,
    rank_by: RankBy,
    limits: &Limits,
) -> Outcomes {
    let context = ReadContext::new(*limits);
    let (format, soups) = soups(file, question, &context)?;
    let top = question.top.unwrap_or(usize::MAX);
    let ranked = soups.into_iter().map(|(pose, soup)| {
        let mut answer = rank_soup(exported, soup, top, rank_by, &context.warnings.list())?;
        answer["name"] = json!(file.name);
        answer["pose"] = pose;
        answer["format"] = json!(format);
        Ok(answer)
    });
    Ok(ranked.collect())
}

fn rank_soup(
    exported: &Exported,
    soup: TriangleSoup,
    top: usize,
    rank_by: RankBy,
    warnings: &[String],
) -> Result<Value, CliError> {
    let index = &exported.index;
    let cancel = Cancel::new();
    let mut description = describe_query(soup, &index.parameters, &cancel, &|_| ())?;
    description.report.warnings.splice(0..0, warnings.iter().cloned());
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
        "classes": classes,
        "verdict": VerdictDto::from(judged.verdict.clone()),
        "probability": judged.verdict.probability,
        "none_of_these": judged.none_of_these,
        "margin": ranking.confidence,
        "compared": ranking.compared,
        "pruned": ranking.pruned,
        "signatures": ranking.signatures,
        "warnings": description.report.warnings,
        "mesh": ReportDto::from(description.report),
        "eigenvalues": description.eigenvalues,
        "rank_by": rank_by,
        "parameters": index.parameters,
    }))
}
