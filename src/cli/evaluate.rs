//! `shapelex evaluate`: how often the method is right on a folder per class.

use super::files::{LabelledFile, MeshFile, labelled_files};
use super::progress::Progress;
use super::refused::Refused;
use super::{CliError, ParameterArgs, evaluation_report, figures, output};
use crate::benchmark::evaluate::Models;
use crate::benchmark::retrieval::{RetrievalOutcome, coding_scores, judge_retrieval};
use crate::benchmark::{Evaluation, LabelledShape, OpenSet, Protocol, evaluate, evaluate_open_set};
use crate::cancel::Cancel;
use crate::figure::evaluation_figures;
use crate::mesh::{Limits, MeshError, TriangleSoup, read, read_poses};
use crate::parameters::Parameters;
use crate::pipeline::describe_both;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

/// A protocol by name; the numbers come from other flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ProtocolName {
    /// Every shape is queried once, all others train
    LeaveOneOut,
    /// In order of the names the 1st, 3rd, 5th … shape of a class trains, the others are queried
    EvenOdd,
    /// One shape per class trains, drawn at random, all others are queried
    OneShot,
    /// Every class is dealt into folds, each is queried once
    KFold,
    /// Shape against shape: every shape asks for the others of its class
    Retrieval,
    /// How often a shape of a class that is not indexed is answered "none of these", and what the possible classes
    /// promise: half of every class trains, drawn at random
    OpenSet,
}

/// Arguments of `evaluate`.
#[derive(Debug, clap::Args)]
pub struct EvaluateArgs {
    /// Folder with a folder per class
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,
    /// How shapes are split into training shapes and queries; may be repeated
    #[arg(long, value_enum, value_name = "PROTOCOL",
          default_values_t = [ProtocolName::LeaveOneOut, ProtocolName::EvenOdd, ProtocolName::OneShot,
                              ProtocolName::Retrieval])]
    pub protocol: Vec<ProtocolName>,
    /// Classes that count as one another's right answer, such as --same michael,david; may be repeated
    #[arg(long, value_name = "CLASS,CLASS…")]
    pub same: Vec<String>,
    /// Leave out classes with fewer shapes
    #[arg(long, value_name = "COUNT", default_value_t = 2)]
    pub min_shapes: usize,
    /// Sample this many poses of every animated glTF; other files count once
    #[arg(long, value_name = "COUNT")]
    pub poses: Option<usize>,
    /// Independent draws of one-shot and open-set
    #[arg(long, value_name = "COUNT", default_value_t = 5)]
    pub draws: usize,
    /// Folds of k-fold
    #[arg(long, value_name = "COUNT", default_value_t = 6)]
    pub folds: usize,
    /// Seed of the draws and folds
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub split_seed: u64,
    /// How many of the worst queries are listed
    #[arg(long, value_name = "COUNT", default_value_t = 10)]
    pub worst: usize,
    /// Draw confusion, dissimilarity and embedding of the classes into this folder, an SVG file each
    #[arg(long, value_name = "DIR")]
    pub figures: Option<PathBuf>,
    /// The method's parameters.
    #[command(flatten)]
    pub parameters: ParameterArgs,
}

/// Everything an evaluation found out.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Shapes by class.
    pub classes: BTreeMap<String, usize>,
    /// Shapes in all.
    pub shapes: usize,
    /// All shapes that were evaluated, in order: the positions in `retrieval.nearest` are positions in this list.
    pub shape_list: Vec<ShapeName>,
    /// Files that could not be used.
    pub refused: Vec<Refused>,
    /// Classes left out because they have too few shapes.
    pub left_out: Vec<String>,
    /// What counted.
    pub parameters: Parameters,
    /// One outcome per protocol.
    pub protocols: Vec<Outcome>,
    /// Shape against shape, where it was asked for: a dictionary per shape, nearest neighbour, tiers, DCG, mAP.
    pub retrieval: Option<RetrievalOutcome>,
    /// What comes of shapes of no indexed class, where it was asked for and enough shapes train: the sum over the draws.
    pub open_set: Option<OpenSet>,
    /// Wall-clock time of the whole, in seconds.
    pub seconds: f64,
}

/// What a shape is called.
#[derive(Debug, Serialize)]
pub struct ShapeName {
    /// Its class.
    pub class: String,
    /// Its name, unique within the class.
    pub name: String,
}

/// The outcome of one protocol.
#[derive(Debug, Serialize)]
pub struct Outcome {
    /// The protocol's name.
    pub name: &'static str,
    /// Share of queries answered with the right class, 0 to 1.
    pub top1: f64,
    /// The evaluation; as text its queries are cut to the worst, as JSON all are there.
    #[serde(flatten)]
    pub evaluation: Evaluation,
}

/// Describes every file once, then runs the protocols.
///
/// # Errors
/// [`CliError::Usage`] where fewer than two classes are left; [`CliError::Reported`] where a file was refused, after
/// the evaluation of the others.
pub fn run(args: &EvaluateArgs, json: bool) -> Result<(), CliError> {
    let began = Instant::now();
    let parameters = args.parameters.parameters()?;
    let same: Vec<Vec<String>> = args
        .same
        .iter()
        .map(|group| group.split(',').map(|c| c.trim().to_owned()).collect())
        .collect();
    let files = labelled_files(&args.dir)?;
    let (mut shapes, refused) = describe(&files, args.poses, &parameters);
    let (classes, left_out) = keep_classes(&mut shapes, args.min_shapes);
    for group in &same {
        if let Some(unknown) = group
            .iter()
            .find(|&c| !classes.contains_key(c) && !left_out.contains(c))
        {
            return Err(CliError::Usage(format!(
                "--same: there is no class '{unknown}' in {}",
                args.dir.display()
            )));
        }
    }
    if classes.len() < 2 {
        return Err(CliError::Failed(format!(
            "{}: {} classes with at least {} usable shapes; an evaluation needs two",
            args.dir.display(),
            classes.len(),
            args.min_shapes
        )));
    }
    let mut protocols = Vec::new();
    let mut retrieval = None;
    let mut open = None;
    for &name in &args.protocol {
        let Some(protocol) = protocol(name, args) else {
            match name {
                ProtocolName::OpenSet => open = open_set(&shapes, &parameters, &same, args)?,
                _ => retrieval = Some(retrieve(&shapes, &parameters, &same)?),
            }
            continue;
        };
        let progress = Progress::new(protocol.name(), 0);
        let mut evaluation = evaluate(
            &shapes,
            protocol,
            &parameters,
            &same,
            &Cancel::new(),
            &|done, total| progress.set(done, total),
        )?;
        progress.finish();
        if let Some(dir) = &args.figures {
            figures::write(dir, &evaluation_figures(&evaluation)?)?;
        }
        if !json {
            evaluation.queries.truncate(args.worst);
        }
        protocols.push(Outcome {
            name: protocol.name(),
            top1: evaluation.top1(),
            evaluation,
        });
    }
    let report = Report {
        classes,
        shapes: shapes.len(),
        shape_list: shapes
            .iter()
            .map(|shape| ShapeName {
                class: shape.class.clone(),
                name: shape.name.clone(),
            })
            .collect(),
        refused,
        left_out,
        parameters,
        protocols,
        retrieval,
        open_set: open,
        seconds: began.elapsed().as_secs_f64(),
    };
    if json {
        output::json(&report)?;
    } else {
        output::line(&evaluation_report::text(&report))?;
    }
    if report.refused.is_empty() {
        Ok(())
    } else {
        Err(CliError::Reported)
    }
}

/// The split of a protocol; none for those that are not about one right class per query.
fn protocol(name: ProtocolName, args: &EvaluateArgs) -> Option<Protocol> {
    let seed = args.split_seed;
    match name {
        ProtocolName::LeaveOneOut => Some(Protocol::LeaveOneOut),
        ProtocolName::EvenOdd => Some(Protocol::EvenOdd),
        ProtocolName::OneShot => Some(Protocol::OneShot {
            draws: args.draws,
            seed,
        }),
        ProtocolName::KFold => Some(Protocol::KFold {
            folds: args.folds,
            seed,
        }),
        ProtocolName::Retrieval | ProtocolName::OpenSet => None,
    }
}

/// Shape against shape: a dictionary of every shape, every shape queried against all others.
fn retrieve(
    shapes: &[LabelledShape],
    parameters: &Parameters,
    same: &[Vec<String>],
) -> Result<RetrievalOutcome, CliError> {
    let progress = Progress::new("retrieval", 0);
    let scores = coding_scores(
        shapes,
        parameters,
        &Models::new(),
        &Cancel::new(),
        &|done, total| progress.set(done, total),
    )?;
    progress.finish();
    let classes: Vec<&str> = shapes.iter().map(|s| s.class.as_str()).collect();
    Ok(judge_retrieval(&scores, &classes, same))
}

/// As many splits as there are draws, summed. `None` where too few shapes train to calibrate anything.
fn open_set(
    shapes: &[LabelledShape],
    parameters: &Parameters,
    same: &[Vec<String>],
    args: &EvaluateArgs,
) -> Result<Option<OpenSet>, CliError> {
    let mut sum: Option<OpenSet> = None;
    for draw in 0..args.draws as u64 {
        let progress = Progress::new("open set", 0);
        let seed = args.split_seed.wrapping_add(draw);
        let split = evaluate_open_set(shapes, parameters, same, seed, &Cancel::new(), &|done, total| {
            progress.set(done, total);
        })?;
        progress.finish();
        if let Some(split) = split {
            sum.get_or_insert_default().add(&split);
        }
    }
    Ok(sum)
}

/// Describes every file on all cores. Files that cannot be used come back with their reason.
fn describe(
    files: &[LabelledFile],
    poses: Option<usize>,
    parameters: &Parameters,
) -> (Vec<LabelledShape>, Vec<Refused>) {
    let progress = Progress::new("describe", files.len());
    let results: Vec<Result<Vec<LabelledShape>, Refused>> = files
        .par_iter()
        .map(|file| {
            let result = describe_file(file, poses, parameters);
            progress.tick();
            result.map_err(|error| Refused::new(&file.path, error))
        })
        .collect();
    progress.finish();
    let mut shapes = Vec::new();
    let mut refused = Vec::new();
    for result in results {
        match result {
            Ok(described) => shapes.extend(described),
            Err(refusal) => refused.push(refusal),
        }
    }
    (shapes, refused)
}

fn describe_file(
    file: &LabelledFile,
    poses: Option<usize>,
    parameters: &Parameters,
) -> Result<Vec<LabelledShape>, CliError> {
    let limits = Limits::default();
    let mesh = MeshFile::load(&file.path, limits.max_bytes)?;
    let one = |mesh: &MeshFile| -> Result<Vec<(String, TriangleSoup)>, MeshError> {
        Ok(vec![(mesh.name.clone(), read(&mesh.source(), &limits)?.1)])
    };
    let soups = match poses {
        None => one(&mesh)?,
        Some(count) => match read_poses(&mesh.source(), count, &limits) {
            Ok((_, poses)) => poses
                .into_iter()
                .map(|pose| (format!("{} {}", mesh.name, pose.label), pose.soup))
                .collect(),
            Err(MeshError::NoAnimation) => one(&mesh)?,
            Err(error) => return Err(error.into()),
        },
    };
    soups
        .into_iter()
        .map(|(name, soup)| {
            let (training, query) = describe_both(soup, parameters, &Cancel::new())?;
            Ok(LabelledShape {
                class: file.class.clone(),
                name,
                training,
                query,
            })
        })
        .collect()
}

/// Drops shapes of classes with too few; returns the others' counts and the names of the dropped.
fn keep_classes(shapes: &mut Vec<LabelledShape>, least: usize) -> (BTreeMap<String, usize>, Vec<String>) {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for shape in shapes.iter() {
        *counts.entry(shape.class.clone()).or_default() += 1;
    }
    let left_out = counts
        .iter()
        .filter(|&(_, &n)| n < least)
        .map(|(class, _)| class.clone())
        .collect();
    counts.retain(|_, n| *n >= least);
    shapes.retain(|shape| counts.contains_key(&shape.class));
    (counts, left_out)
}
