//! `shapelex query`: which class a mesh belongs to.

use super::ask::Question;
use super::client::{Client, TargetArgs};
use super::files::MeshFile;
use super::outcome::CallError;
use super::progress::Progress;
use super::query_inputs::{Input, Place, gather};
use super::query_summary::Summary;
use super::refused::Refused;
use super::values::{at_least_one, one_of};
use super::{CliError, dictionaries, output, query_text};
use crate::http::dto::answer as dto;
use crate::http::dto::parameters::QueryRankByName;
use crate::http::dto::shape::PoseDto;
use serde_json::{Value, json};
use shapelex_core::mesh::{
    Format, Limits, MeshError, Pose, ReadContext, TriangleSoup, read_poses_within, read_within,
};
use shapelex_core::retrieval::{Deadline, QueryEngine, QueryError, QuerySpec, RankingMethod, SearchIndex};
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
    File(Box<SearchIndex>, QueryRankByName),
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
    let index = dictionaries::load(path)?.into_search_index();
    let own = index.dictionaries.parameters.rank_by;
    let rank_by = args.rank_by.unwrap_or(own.into());
    if matches!(rank_by.method(), RankingMethod::Baseline(_)) && index.baselines.is_none() {
        return Err(CliError::Usage(
            "--rank-by: this file of dictionaries has nothing for this method; query an index with --data or --server"
                .to_owned(),
        ));
    }
    Ok(Source::File(Box::new(index), rank_by))
}

/// One answer or refusal per pose that was asked about.
type Outcomes = Result<Vec<Result<Value, CliError>>, CliError>;

impl Source {
    fn rank(&self, input: &Input, question: &Question) -> Outcomes {
        let limits = Limits::default();
        let client = match self {
            Self::Service(client) => client,
            Self::File(index, rank_by) => {
                let file = input.load(limits.max_bytes)?;
                return rank_against(index, &file, question, *rank_by, &limits);
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

/// A mesh, and which pose of an animated file it is.
type Posed = (Option<PoseDto>, TriangleSoup);

/// The meshes of a file that are asked about.
fn soups(
    file: &MeshFile,
    question: &Question,
    context: &ReadContext,
) -> Result<(Format, Vec<Posed>), CliError> {
    let resting = || -> Result<_, CliError> {
        let (format, soup) = read_within(&file.source(), context)?;
        Ok((format, vec![(None, soup)]))
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
        let label = pose.label;
        (Some(PoseDto { label, index, of }), pose.soup)
    });
    Ok((format, found.collect()))
}

/// The service's query, on an index that came out of a file.
fn rank_against(
    index: &SearchIndex,
    file: &MeshFile,
    question: &Question,
    rank_by: QueryRankByName,
    limits: &Limits,
) -> Outcomes {
    let context = ReadContext::new(*limits);
    let (format, soups) = soups(file, question, &context)?;
    let ranked = soups.into_iter().map(|(pose, soup)| {
        let asked = dto::Question {
            name: &file.name,
            pose,
            format,
            rank_by,
            top: question.top,
            details: None,
        };
        rank_soup(index, soup, &asked, &context.warnings.list())
    });
    Ok(ranked.collect())
}

/// The API's answer, without what only a service knows and without members under former names.
fn rank_soup(
    index: &SearchIndex,
    soup: TriangleSoup,
    asked: &dto::Question<'_>,
    warnings: &[String],
) -> Result<Value, CliError> {
    let spec = QuerySpec {
        method: asked.rank_by.method(),
        top: asked.top,
    };
    let outcome = QueryEngine::default()
        .run(index, soup, &spec, &Deadline::default())
        .map_err(|error| match error {
            QueryError::Pipeline(error) => error.into(),
            other => CliError::Failed(other.to_string()),
        })?;
    let mut answer = asked.answered(index, outcome);
    answer.warnings.splice(0..0, warnings.iter().cloned());
    let mut answer = serde_json::to_value(answer).map_err(|error| CliError::Failed(error.to_string()))?;
    if let Some(members) = answer.as_object_mut() {
        for member in ["confidence", "generation", "timings_ms"] {
            members.remove(member);
        }
    }
    Ok(answer)
}
