//! Thousands of classes: dictionaries of random creatures, made once and kept in a file, and mixtures of them.
//!
//! Ten thousand creatures would take an hour to make. So the first [`REAL`] classes are dictionaries of creatures
//! and the others are mixtures of two of them, atom by atom; their queries are the same mixtures of signals of poses
//! that no class has learnt. Mixtures lie closer together than creatures do, so they are harder to tell apart.

use super::Outcome;
use faer::{Mat, MatRef};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::coding::Dictionary;
use shapelex_core::parameters::{Channel, Hypothesis, Parameters};
use shapelex_core::pipeline::{Description, describe_query, describe_shape, learn_model};
use shapelex_core::ranking::{Index, IndexedClass, View};
use shapelex_core::signature::Signatures;
use shapelex_eval::sample::{Species, ZooOptions};
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

/// Classes that are creatures of their own.
pub const REAL: usize = 48;
/// Seed of the creatures and mixtures.
const SEED: u64 = 7;
/// Training shapes of these classes are small.
pub const TRAINING: ZooOptions = ZooOptions {
    min_vertices: 450,
    max_vertices: 800,
    upright: false,
};
/// Queries have the size of real ones.
const QUERY: ZooOptions = ZooOptions {
    min_vertices: 1400,
    max_vertices: 1900,
    upright: false,
};

/// The `default` preset with as many eigenpairs as small meshes have good ones.
pub fn parameters() -> Parameters {
    Parameters {
        eigenpairs: 100,
        iterations: 10,
        ..Parameters::default()
    }
}

/// An index of `count` classes.
pub fn index(count: usize) -> Outcome<Index> {
    let real: Vec<Mat<f64>> = (0..REAL.min(count.max(2)))
        .into_par_iter()
        .map(|number| kept(&format!("dictionary-{number}"), || learnt(number)))
        .collect::<Result<_, _>>()?;
    let classes = (0..count)
        .into_par_iter()
        .map(|number| {
            let atoms = if number < REAL {
                real[number].clone()
            } else {
                let Mixture { one, other, share } = mixture(number);
                mixed(&real[one], &real[other], share)
            };
            let dictionary = Dictionary::new(atoms).map_err(|e| e.to_string())?;
            Ok(IndexedClass {
                label: format!("class-{number:05}"),
                dictionaries: [(Channel::Plain, Arc::new(dictionary))].into(),
                shapes: Vec::new(),
            })
        })
        .collect::<Result<_, String>>()?;
    Ok(Index {
        parameters: parameters(),
        classes,
    })
}

/// The plain view of a query that belongs to class `number`.
pub fn query(number: usize) -> Outcome<Vec<View>> {
    let signals = |number: usize| kept(&format!("query-{number}"), || queried(number));
    let matrix = if number < REAL {
        signals(number)?
    } else {
        let Mixture { one, other, share } = mixture(number);
        mixed(&signals(one)?, &signals(other)?, share)
    };
    Ok(vec![View {
        hypothesis: Hypothesis::Plain,
        channel: Channel::Plain,
        area_scale: 1.0,
        bounded: false,
        signatures: Signatures {
            vertices: (0..matrix.ncols() as u32).collect(),
            matrix,
        },
    }])
}

struct Mixture {
    one: usize,
    other: usize,
    share: f64,
}

fn mixture(number: usize) -> Mixture {
    let mut random = ChaCha8Rng::seed_from_u64(SEED + number as u64);
    let one = random.random_range(0..REAL);
    let other = (one + random.random_range(1..REAL)) % REAL;
    Mixture {
        one,
        other,
        share: random.random_range(0.15..0.85),
    }
}

/// Columns of two matrices of unit WKS roots, mixed in the order of their centres: √((1 − t) a² + t b²), unit norm.
fn mixed(one: &Mat<f64>, other: &Mat<f64>, share: f64) -> Mat<f64> {
    let order = |m: MatRef<'_, f64>| {
        let mut order: Vec<(f64, usize)> = (0..m.ncols())
            .map(|j| ((0..m.nrows()).map(|i| i as f64 * m[(i, j)].powi(2)).sum(), j))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order
    };
    let (a, b) = (order(one.as_ref()), order(other.as_ref()));
    let count = a.len().min(b.len());
    let mut out = Mat::from_fn(one.nrows(), count, |i, j| {
        let (x, y) = (
            one[(i, a[j * a.len() / count].1)],
            other[(i, b[j * b.len() / count].1)],
        );
        ((1.0 - share) * x * x + share * y * y).sqrt()
    });
    for j in 0..count {
        let norm = out.col(j).norm_l2().max(1e-300);
        out.col_mut(j).iter_mut().for_each(|v| *v /= norm);
    }
    out
}

fn learnt(number: usize) -> Result<Mat<f64>, String> {
    let parameters = parameters();
    let described = describe(number, 0, &TRAINING, |soup| {
        describe_shape(soup, &parameters, &Cancel::new(), &|_| ())
    })?;
    let model =
        learn_model(&[&described], &parameters, &Cancel::new(), &|_, _| ()).map_err(|e| e.to_string())?;
    Ok(model.dictionaries[&Channel::Plain].atoms().into_owned())
}

fn queried(number: usize) -> Result<Mat<f64>, String> {
    let parameters = parameters();
    let described = describe(number, 50, &QUERY, |soup| {
        describe_query(soup, &parameters, &Cancel::new(), &|_| ())
    })?;
    Ok(described.views[0].signatures.matrix.clone())
}

/// The first pose from `pose` on that has a surface at this size, of four.
pub fn describe(
    number: usize,
    pose: usize,
    options: &ZooOptions,
    how: impl Fn(shapelex_core::mesh::TriangleSoup) -> Result<Description, shapelex_core::pipeline::PipelineError>,
) -> Result<Description, String> {
    let named = Species::named();
    let species = match named.get(number) {
        Some(species) => species.clone(),
        None => Species::random(SEED, (number - named.len()) as u64),
    };
    let soup = (pose..pose + 4)
        .find_map(|pose| species.pose(SEED, pose, options).ok())
        .ok_or_else(|| format!("creature {number} has no pose of this size"))?;
    how(soup).map_err(|e| e.to_string())
}

/// A matrix from a file of `target/scale`, made where there is none.
fn kept(name: &str, make: impl Fn() -> Result<Mat<f64>, String>) -> Result<Mat<f64>, String> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/scale");
    let path = folder.join(name);
    if let Ok(bytes) = fs::read(&path)
        && bytes.len() > 8
    {
        let values: Vec<f64> = bytes
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(std::array::from_fn(|k| b[k])))
            .collect();
        let rows = values[0] as usize;
        return Ok(Mat::from_fn(rows, (values.len() - 1) / rows, |i, j| {
            values[1 + j * rows + i]
        }));
    }
    let matrix = make()?;
    let mut bytes = (matrix.nrows() as f64).to_le_bytes().to_vec();
    for j in 0..matrix.ncols() {
        bytes.extend(matrix.col_as_slice(j).iter().flat_map(|v| v.to_le_bytes()));
    }
    fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    // Renamed into place, so that nobody reads half a file.
    let unfinished = folder.join(format!("{name}.{:?}", std::thread::current().id()));
    fs::write(&unfinished, bytes).map_err(|e| e.to_string())?;
    fs::rename(&unfinished, &path).map_err(|e| e.to_string())?;
    Ok(matrix)
}
