//! The files of a folder per class as described shapes.

use super::CliError;
use super::files::MeshFile;
use super::folders::LabelledFile;
use super::progress::Progress;
use super::refused::Refused;
use rayon::prelude::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{Limits, MeshError, TriangleSoup, read, read_poses};
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::describe_both;
use shapelex_eval::benchmark::LabelledShape;
use std::collections::BTreeMap;

/// Describes every file on all cores. Files that cannot be used come back with their reason.
pub fn describe(
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
    let soups = poses_of(file, poses)?;
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

/// The surfaces of a file with their names: one, or those of its poses where it is animated and some were asked for.
pub fn poses_of(file: &LabelledFile, poses: Option<usize>) -> Result<Vec<(String, TriangleSoup)>, CliError> {
    let limits = Limits::default();
    let mesh = MeshFile::load(&file.path, limits.max_bytes)?;
    let one = || -> Result<Vec<(String, TriangleSoup)>, MeshError> {
        Ok(vec![(file.name.clone(), read(&mesh.source(), &limits)?.1)])
    };
    let Some(count) = poses else {
        return Ok(one()?);
    };
    match read_poses(&mesh.source(), count, &limits) {
        Ok((_, poses)) => Ok(poses
            .into_iter()
            .map(|pose| (format!("{} {}", file.name, pose.label), pose.soup))
            .collect()),
        Err(MeshError::NoAnimation) => Ok(one()?),
        Err(error) => Err(error.into()),
    }
}

/// Drops shapes of classes with too few; returns the others' counts and the names of the dropped.
pub fn keep_classes(shapes: &mut Vec<LabelledShape>, least: usize) -> (BTreeMap<String, usize>, Vec<String>) {
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
