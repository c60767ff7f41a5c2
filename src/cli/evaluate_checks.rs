//! What is wrong with an evaluation before anything is described.

use super::CliError;
use super::evaluate_args::{EvaluateArgs, ProtocolName};
use super::folders::LabelledFile;
use shapelex_core::parameters::{Parameters, RankBy};
use std::collections::BTreeMap;
use std::path::Path;

/// Held-out shapes that a p-value of 0.05 takes.
const HELD_OUT: usize = 19;
/// Fewest shapes of a class that the open-set protocol splits.
const SPLIT: usize = 3;

/// Checks the arguments against one another and the folder, by its files' names alone. Returns the groups of classes
/// that count as one another's right answer.
///
/// # Errors
/// [`CliError::Usage`] with what does not fit.
pub fn check(
    args: &EvaluateArgs,
    files: &[LabelledFile],
    parameters: &Parameters,
) -> Result<Vec<Vec<String>>, CliError> {
    let wrong = |reason: String| Err(CliError::Usage(reason));
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for file in files {
        *counts.entry(&file.class).or_default() += most_poses(file, args.poses);
    }
    let dir = args.dir.display();
    let same = groups(&args.same, &args.dir, &counts)?;
    let kept = || counts.values().copied().filter(|&n| n >= args.min_shapes);
    if kept().count() < 2 {
        let flat = files
            .iter()
            .all(|file| file.path.parent() == Some(args.dir.as_path()));
        let why = if flat {
            format!(
                "the {} files lie in the folder itself, which makes each a class of its own; expected a folder per class",
                files.len()
            )
        } else {
            format!(
                "{} of {} classes have at least {} shapes; an evaluation needs two",
                kept().count(),
                counts.len(),
                args.min_shapes
            )
        };
        return wrong(format!("{dir}: {why}"));
    }
    if kept().all(|n| n < 2) {
        return wrong(format!(
            "{dir}: no class has two shapes, so that none could be queried"
        ));
    }
    if args.protocol.contains(&ProtocolName::KFold) && args.folds < 2 {
        return wrong("--folds must be 2 or more: one fold trains, another is queried".to_owned());
    }
    if args.protocol.contains(&ProtocolName::OpenSet) {
        if parameters.rank_by == RankBy::Frobenius {
            return wrong(
                "--protocol open-set: answers ranked by frobenius are not judged; use another rank_by"
                    .to_owned(),
            );
        }
        let training: usize = kept().filter(|&n| n >= SPLIT).map(|n| n.div_ceil(2)).sum();
        if training < HELD_OUT {
            return wrong(format!(
                "--protocol open-set: half of every class with {SPLIT} or more shapes makes {training} shapes that train; \
                 {HELD_OUT} are needed to judge an answer"
            ));
        }
    }
    Ok(same)
}

/// As [`check`], where one folder trains and another is queried.
///
/// # Errors
/// [`CliError::Usage`] with what does not fit.
pub fn check_queries(
    args: &EvaluateArgs,
    queries: &Path,
    trained: &[LabelledFile],
    asked: &[LabelledFile],
) -> Result<Vec<Vec<String>>, CliError> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for file in trained {
        *counts.entry(&file.class).or_default() += 1;
    }
    let (dir, names) = (args.dir.display(), || {
        counts.keys().copied().collect::<Vec<_>>().join(", ")
    });
    if counts.len() < 2 {
        return Err(CliError::Usage(format!(
            "{dir}: there is one class, {}; an evaluation needs two or more to choose from",
            names()
        )));
    }
    if let Some(file) = asked
        .iter()
        .find(|file| !counts.contains_key(file.class.as_str()))
    {
        return Err(CliError::Usage(format!(
            "--queries {}: the class '{}' does not train; {dir} has {}",
            queries.display(),
            file.class,
            names()
        )));
    }
    groups(&args.same, &args.dir, &counts)
}

/// As many shapes as a file can give.
fn most_poses(file: &LabelledFile, poses: Option<usize>) -> usize {
    let extension = file
        .path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    match poses {
        Some(count) if extension == "gltf" || extension == "glb" => count,
        _ => 1,
    }
}

fn groups(same: &[String], dir: &Path, counts: &BTreeMap<&str, usize>) -> Result<Vec<Vec<String>>, CliError> {
    same.iter()
        .map(|given| {
            let group: Vec<String> = given.split(',').map(|class| class.trim().to_owned()).collect();
            if group.len() < 2 {
                return Err(CliError::Usage(format!(
                    "--same {given}: expected two classes or more, such as --same michael,david"
                )));
            }
            match group.iter().find(|class| !counts.contains_key(class.as_str())) {
                None => Ok(group),
                Some(unknown) => Err(CliError::Usage(format!(
                    "--same {given}: there is no class '{unknown}' in {}; there are {}",
                    dir.display(),
                    counts.keys().copied().collect::<Vec<_>>().join(", ")
                ))),
            }
        })
        .collect()
}
