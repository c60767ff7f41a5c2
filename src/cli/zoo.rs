//! `shapelex zoo`: procedural creatures as files.

use super::progress::Progress;
use super::{CliError, output};
use rayon::prelude::*;
use serde_json::json;
use shapelex_eval::sample::{ZooOptions, species, write_glb, write_obj};
use std::path::{Path, PathBuf};

/// The format creatures are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ZooFormat {
    /// Wavefront OBJ
    Obj,
    /// Binary glTF
    Glb,
}

/// Arguments of `zoo`.
#[derive(Debug, clap::Args)]
pub struct ZooArgs {
    /// Folder to write to; every class becomes a folder in it
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Kinds of creatures
    #[arg(long, value_name = "COUNT", default_value_t = 16)]
    pub classes: usize,
    /// Poses of each
    #[arg(long, value_name = "COUNT", default_value_t = 12)]
    pub poses: usize,
    /// File format
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = ZooFormat::Obj)]
    pub format: ZooFormat,
    /// Seed of everything that is random; the same seed gives the same files
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// Fewest vertices of a mesh
    #[arg(long, value_name = "COUNT", default_value_t = ZooOptions::default().min_vertices)]
    pub min_vertices: usize,
    /// Most vertices of a mesh
    #[arg(long, value_name = "COUNT", default_value_t = ZooOptions::default().max_vertices)]
    pub max_vertices: usize,

    /// Leave the creatures standing, y up, in their own units; otherwise each is turned, moved and scaled at random.
    #[arg(long)]
    pub upright: bool,
}

/// A creature in a file format.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// Its kind.
    pub class: String,
    /// The pose's number, from 0.
    pub pose: usize,
    /// The file's name, such as `cat-03.obj`.
    pub name: String,
    /// The file's contents.
    pub bytes: Vec<u8>,
}

/// Makes every pose of every class on all cores, class by class.
///
/// # Errors
/// [`CliError::Failed`] where a creature cannot be made with these options.
pub fn specimens(
    classes: usize,
    poses: usize,
    seed: u64,
    format: ZooFormat,
    options: &ZooOptions,
) -> Result<Vec<Specimen>, CliError> {
    let kinds = species(seed, classes);
    let progress = Progress::new("make the zoo", kinds.len() * poses);
    let specimens = (0..kinds.len() * poses)
        .into_par_iter()
        .map(|i| {
            let (kind, pose) = (&kinds[i / poses], i % poses);
            let mesh = kind
                .pose(seed, pose, options)
                .map_err(|error| CliError::Failed(error.to_string()))?;
            let (bytes, extension) = match format {
                ZooFormat::Obj => (write_obj(&mesh), "obj"),
                ZooFormat::Glb => (write_glb(&mesh), "glb"),
            };
            progress.tick();
            Ok(Specimen {
                class: kind.name().to_owned(),
                pose,
                name: format!("{}-{pose:02}.{extension}", kind.name()),
                bytes,
            })
        })
        .collect::<Result<Vec<_>, CliError>>()?;
    progress.finish();
    Ok(specimens)
}

/// Writes a specimen into its class's folder below `dir`.
///
/// # Errors
/// [`CliError::Failed`] with the path.
pub fn write(dir: &Path, specimen: &Specimen) -> Result<(), CliError> {
    let folder = dir.join(&specimen.class);
    std::fs::create_dir_all(&folder).map_err(|error| CliError::at(&folder, error))?;
    let path = folder.join(&specimen.name);
    std::fs::write(&path, &specimen.bytes).map_err(|error| CliError::at(&path, error))
}

/// Writes the zoo.
///
/// # Errors
/// [`CliError::Usage`] for zero classes or poses; [`CliError::Failed`] where a creature or a file cannot be made.
pub fn run(args: &ZooArgs, as_json: bool) -> Result<(), CliError> {
    if args.classes == 0 || args.poses == 0 {
        return Err(CliError::Usage(
            "--classes and --poses must be 1 or more".to_owned(),
        ));
    }
    if args.min_vertices > args.max_vertices {
        return Err(CliError::Usage(format!(
            "--min-vertices {} is more than --max-vertices {}",
            args.min_vertices, args.max_vertices
        )));
    }
    let options = ZooOptions {
        min_vertices: args.min_vertices,
        max_vertices: args.max_vertices,
        upright: args.upright,
    };
    let specimens = specimens(args.classes, args.poses, args.seed, args.format, &options)?;
    for specimen in &specimens {
        write(&args.out, specimen)?;
    }
    if as_json {
        output::json(&json!({
            "out": args.out.display().to_string(),
            "classes": args.classes,
            "files": specimens.len(),
            "bytes": specimens.iter().map(|s| s.bytes.len()).sum::<usize>(),
        }))
    } else {
        output::line(&format!(
            "{} files of {} classes in {}",
            specimens.len(),
            args.classes,
            args.out.display()
        ))
    }
}
