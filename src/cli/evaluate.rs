//! `shapelex evaluate`: how often the method is right on a folder per class.

use super::evaluate_args::{EvaluateArgs, ProtocolName};
use super::evaluate_checks::{check, check_queries};
use super::evaluate_describe::{describe, keep_classes};
use super::evaluate_figures::Figures;
use super::evaluation::{Outcome, Report, ShapeName};
use super::folders::{LabelledFile, labelled_files};
use super::progress::Progress;
use super::{CliError, evaluation_report, output};
use shapelex_core::cancel::Cancel;
use shapelex_core::parameters::Parameters;
use shapelex_eval::benchmark::evaluate::Models;
use shapelex_eval::benchmark::retrieval::{RetrievalOutcome, coding_scores, judge_retrieval};
use shapelex_eval::benchmark::{LabelledShape, OpenSet, Protocol, evaluate, evaluate_open_set};
use std::collections::BTreeMap;
use std::time::Instant;

/// Describes every file once, then runs the protocols. What can be known before is checked before.
///
/// # Errors
/// [`CliError::Usage`] where the arguments and the folder do not fit, before anything is described;
/// [`CliError::Failed`] where too many files were refused; [`CliError::Reported`] where a file was refused, after the
/// evaluation of the others.
pub fn run(args: &EvaluateArgs, json: bool) -> Result<(), CliError> {
    let began = Instant::now();
    let parameters = args.parameters.parameters()?;
    let trained = labelled_files(&args.dir)?;
    let (asked, same) = match &args.queries {
        Some(dir) => {
            let asked = labelled_files(dir)?;
            let same = check_queries(args, dir, &trained, &asked)?;
            (asked, same)
        }
        None => (Vec::new(), check(args, &trained, &parameters)?),
    };
    let files: Vec<LabelledFile> = trained.iter().chain(&asked).cloned().collect();
    let figures = Figures::new(args.figures.as_deref(), args.poses, &files)?;
    let (mut shapes, mut refused) = describe(&trained, args.poses, &parameters);
    let (classes, left_out) = usable(args, &mut shapes)?;
    let (queries, refused_queries) = match &args.queries {
        Some(_) => describe(&asked, args.poses, &parameters),
        None => Default::default(),
    };
    let queried = queries.len();
    shapes.extend(queries);
    refused.extend(refused_queries);
    let mut report = Report {
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
        protocols: Vec::new(),
        retrieval: None,
        open_set: None,
        seconds: 0.0,
    };
    if args.queries.is_some() {
        let protocol = Protocol::TrainQuery { queries: queried };
        run_rounds_of(protocol, (&shapes, &same), &figures, &mut report)?;
    } else {
        for &name in &args.protocol {
            run_protocol(name, args, (&shapes, &same), &figures, &mut report)?;
        }
    }
    report.seconds = began.elapsed().as_secs_f64();
    show(args, report, json)
}

/// The classes with enough usable shapes, which stay, and the names of the others.
fn usable(
    args: &EvaluateArgs,
    shapes: &mut Vec<LabelledShape>,
) -> Result<(BTreeMap<String, usize>, Vec<String>), CliError> {
    let least = if args.queries.is_some() {
        1
    } else {
        args.min_shapes
    };
    let (classes, left_out) = keep_classes(shapes, least);
    if classes.len() < 2 {
        return Err(CliError::Failed(format!(
            "{}: {} classes with at least {least} usable shapes; an evaluation needs two",
            args.dir.display(),
            classes.len(),
        )));
    }
    Ok((classes, left_out))
}

fn show(args: &EvaluateArgs, mut report: Report, json: bool) -> Result<(), CliError> {
    if json {
        output::json(&report)?;
    } else {
        for outcome in &mut report.protocols {
            outcome.evaluation.queries.truncate(args.worst);
        }
        output::line(&evaluation_report::text(&report))?;
    }
    if report.refused.is_empty() {
        Ok(())
    } else {
        Err(CliError::Reported)
    }
}

/// Runs one protocol, draws its figures and adds what came of it to the report.
fn run_protocol(
    name: ProtocolName,
    args: &EvaluateArgs,
    (shapes, same): (&[LabelledShape], &[Vec<String>]),
    figures: &Figures<'_>,
    report: &mut Report,
) -> Result<(), CliError> {
    let Some(protocol) = protocol(name, args) else {
        match name {
            ProtocolName::OpenSet => {
                report.open_set = open_set(shapes, &report.parameters, same, args)?;
                figures.open_set(report.open_set.as_ref())?;
            }
            _ => {
                let outcome = retrieve(shapes, &report.parameters, same)?;
                figures.retrieval(&outcome)?;
                report.retrieval = Some(outcome);
            }
        }
        return Ok(());
    };
    run_rounds_of(protocol, (shapes, same), figures, report)
}

/// Runs a protocol that is about one right class per query.
fn run_rounds_of(
    protocol: Protocol,
    (shapes, same): (&[LabelledShape], &[Vec<String>]),
    figures: &Figures<'_>,
    report: &mut Report,
) -> Result<(), CliError> {
    let progress = Progress::new(protocol.name(), 0);
    let evaluation = evaluate(
        shapes,
        protocol,
        &report.parameters,
        same,
        &Cancel::new(),
        &|done, total| progress.set(done, total),
    )?;
    progress.finish();
    figures.evaluation(&evaluation)?;
    report.protocols.push(Outcome {
        name: protocol.name(),
        top1: evaluation.top1(),
        evaluation,
    });
    Ok(())
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
