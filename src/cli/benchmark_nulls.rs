//! The null shapes of a benchmark: files, or creatures of the zoo.

use super::CliError;
use super::files::MeshFile;
use super::folders::labelled_files;
use rayon::prelude::*;
use shapelex_core::mesh::{Components, Limits, PrepareOptions, TriangleSoup, prepare, read};
use shapelex_eval::benchmark::Category;
use shapelex_eval::benchmark::protocol::natural_key;
use shapelex_eval::sample::{ZooOptions, species};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Other poses of a class that are used, as many as there are strengths.
const POSES: usize = 5;

/// A null shape, and other poses of its class.
#[derive(Clone, Debug)]
pub struct Null {
    /// Its class.
    pub class: String,
    /// The shape, clean and of the working size.
    pub soup: TriangleSoup,
    /// Other poses, likewise.
    pub poses: Vec<TriangleSoup>,
}

impl Null {
    /// The shape of a category at a strength, 0 for the null itself; `None` for a pose there is none of. Every class
    /// draws its own random numbers.
    pub fn member(&self, category: Category, strength: usize, seed: u64) -> Option<TriangleSoup> {
        match category {
            _ if strength == 0 => Some(self.soup.clone()),
            Category::Isometry => self.poses.get(strength - 1).cloned(),
            Category::Deformed(deformation) => {
                let digest = blake3::hash(self.class.as_bytes());
                let mut own = [0; 8];
                own.copy_from_slice(&digest.as_bytes()[..8]);
                let seed = seed ^ u64::from_le_bytes(own);
                Some(deformation.apply(&self.soup, strength as u32, seed))
            }
        }
    }
}

/// Reads mesh files and folders. A class with several files gives its first, in natural order, as the null shape.
///
/// # Errors
/// [`CliError::Usage`] where fewer than two classes are found or two paths give the same class;
/// [`CliError::Failed`] where a file is no usable mesh.
pub fn of_files(paths: &[PathBuf], vertices: usize) -> Result<Vec<Null>, CliError> {
    let mut classes: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in paths {
        if !path.exists() {
            return Err(CliError::Usage(format!(
                "{}: there is no such file or folder",
                path.display()
            )));
        }
        let mut found: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
        if path.is_dir() {
            for file in labelled_files(path)? {
                found.entry(file.class).or_default().push(file.path);
            }
        } else {
            let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned());
            found.insert(stem.unwrap_or_default(), vec![path.clone()]);
        }
        for (class, files) in found {
            if classes.contains_key(&class) {
                return Err(CliError::Usage(format!(
                    "{}: there is a class '{class}' already; rename one of them",
                    path.display()
                )));
            }
            classes.insert(class, files);
        }
    }
    if classes.len() < 2 {
        return Err(CliError::Usage(format!(
            "{} null shapes; a benchmark needs two or more classes",
            classes.len()
        )));
    }
    let key = |path: &PathBuf| {
        natural_key(
            &path
                .file_name()
                .map_or(String::new(), |n| n.to_string_lossy().into_owned()),
        )
    };
    classes
        .into_par_iter()
        .map(|(class, mut files)| {
            files.sort_by_cached_key(key);
            files.truncate(1 + POSES);
            let mut soups = files
                .iter()
                .map(|path| load(path, vertices))
                .collect::<Result<Vec<_>, _>>()?;
            // A class is made with its first file.
            let soup = soups.remove(0);
            Ok(Null {
                class,
                soup,
                poses: soups,
            })
        })
        .collect()
}

fn load(path: &Path, vertices: usize) -> Result<TriangleSoup, CliError> {
    let limits = Limits::default();
    let file = MeshFile::load(path, limits.max_bytes)?;
    let (_, soup) = read(&file.source(), &limits).map_err(|error| CliError::at(path, error))?;
    clean(soup, vertices).map_err(|error| CliError::at(path, error))
}

/// The first species of the zoo; other poses only where they are wanted.
///
/// # Errors
/// [`CliError::Usage`] for fewer than two classes; [`CliError::Failed`] where a creature cannot be made.
pub fn of_the_zoo(classes: usize, poses: bool, seed: u64, vertices: usize) -> Result<Vec<Null>, CliError> {
    if classes < 2 {
        return Err(CliError::Usage("--classes must be 2 or more".to_owned()));
    }
    let options = ZooOptions::default();
    let mut nulls = species(seed, classes)
        .par_iter()
        .map(|kind| {
            let pose = |number: usize| -> Result<TriangleSoup, CliError> {
                let soup = kind
                    .pose(seed, number, &options)
                    .map_err(|error| CliError::Failed(error.to_string()))?;
                clean(soup, vertices).map_err(|error| CliError::Failed(error.to_string()))
            };
            Ok(Null {
                class: kind.name().to_owned(),
                soup: pose(0)?,
                poses: (1..=POSES)
                    .filter(|_| poses)
                    .map(pose)
                    .collect::<Result<_, _>>()?,
            })
        })
        .collect::<Result<Vec<_>, CliError>>()?;
    nulls.sort_by(|a, b| a.class.cmp(&b.class));
    Ok(nulls)
}

/// The largest component, simplified to the working size; holes stay as they are.
fn clean(soup: TriangleSoup, vertices: usize) -> Result<TriangleSoup, shapelex_core::mesh::MeshError> {
    let options = PrepareOptions {
        components: Components::Largest,
        fill_holes_below: 0.0,
        working_size: vertices,
    };
    let (mesh, _) = prepare(soup, &options)?;
    let (vertices, faces) = mesh.into_parts();
    Ok(TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    })
}

/// The groups of `--same`, every class of which must exist.
///
/// # Errors
/// [`CliError::Usage`] with the class that does not.
pub fn groups(same: &[String], classes: &[String]) -> Result<Vec<Vec<String>>, CliError> {
    let split = |group: &String| -> Vec<String> { group.split(',').map(|c| c.trim().to_owned()).collect() };
    let groups: Vec<Vec<String>> = same.iter().map(split).collect();
    match groups.iter().flatten().find(|c| !classes.contains(c)) {
        Some(unknown) => Err(CliError::Usage(format!(
            "--same: there is no class '{unknown}'; there are {}",
            classes.join(", ")
        ))),
        None => Ok(groups),
    }
}
