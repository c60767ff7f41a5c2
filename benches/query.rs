//! Every stage of a query on its own, the whole query, and a class's learning, for each preset.
//!
//! `cargo bench --bench query`. Twelve creatures of the zoo are the classes, three poses each; a fourth pose of the
//! first, some 2000 vertices as an OBJ file, is the query.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{Limits, Source, TriMesh, prepare, read};
use shapelex_core::parameters::{Parameters, Preset};
use shapelex_core::pipeline::{Description, describe_query, describe_shape, learn_model};
use shapelex_core::ranking::{Index, IndexedClass, rank};
use shapelex_core::signature::describe_vertices;
use shapelex_core::spectral::{EigenOptions, assemble, smallest_eigenpairs};
use shapelex_eval::sample::{Species, ZooOptions, species, write_obj};
use std::error::Error;
use std::hint::black_box;

const SEED: u64 = 1;
const CLASSES: usize = 12;
const TRAINING_POSES: usize = 3;
const SIZE: ZooOptions = ZooOptions {
    min_vertices: 1900,
    max_vertices: 2100,
    upright: false,
};

type Outcome<T> = Result<T, Box<dyn Error>>;

fn descriptions(species: &Species, parameters: &Parameters) -> Outcome<Vec<Description>> {
    (0..TRAINING_POSES)
        .map(|pose| {
            let soup = species.pose(SEED, pose, &SIZE)?;
            Ok(describe_shape(soup, parameters, &Cancel::new(), &|_| ())?)
        })
        .collect()
}

fn index(parameters: &Parameters) -> Outcome<Index> {
    let classes = species(SEED, CLASSES)
        .iter()
        .map(|species| {
            let described = descriptions(species, parameters)?;
            let shapes: Vec<&Description> = described.iter().collect();
            let model = learn_model(&shapes, parameters, &Cancel::new(), &|_, _| ())?;
            Ok(IndexedClass {
                label: species.name().to_owned(),
                dictionaries: model.dictionaries,
                shapes: Vec::new(),
            })
        })
        .collect::<Outcome<_>>()?;
    Ok(Index {
        parameters: parameters.clone(),
        classes,
    })
}

fn stages(criterion: &mut Criterion) -> Outcome<()> {
    let first = &species(SEED, 1)[0];
    let bytes = write_obj(&first.pose(SEED, TRAINING_POSES, &SIZE)?);
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    let (limits, cancel, options) = (Limits::default(), Cancel::new(), EigenOptions::default());
    let (_, soup) = read(&source, &limits)?;
    let mut group = criterion.benchmark_group("query");
    group.sample_size(10);
    group.bench_function("read", |bencher| {
        bencher.iter(|| black_box(read(&source, &limits)));
    });
    for preset in Preset::ALL {
        let parameters = Parameters::preset(preset);
        let name = |stage: &str| BenchmarkId::new(stage, format!("{preset:?}").to_lowercase());
        let prepare_options = parameters.prepare_options();
        let (mesh, _): (TriMesh, _) = prepare(soup.clone(), &prepare_options)?;
        let operators = assemble(&mesh)?;
        let pairs = smallest_eigenpairs(&operators, parameters.eigenpairs, &options, &cancel)?;
        let vertices: Vec<u32> = (0..mesh.signature_vertices() as u32).collect();
        let descriptor = parameters.descriptor_parameters();
        group.bench_function(name("prepare"), |bencher| {
            bencher.iter(|| black_box(prepare(soup.clone(), &prepare_options)));
        });
        group.bench_function(name("laplacian"), |bencher| {
            bencher.iter(|| black_box(assemble(&mesh)));
        });
        group.bench_function(name("eigenpairs"), |bencher| {
            bencher.iter(|| {
                black_box(smallest_eigenpairs(
                    &operators,
                    parameters.eigenpairs,
                    &options,
                    &cancel,
                ))
            });
        });
        group.bench_function(name("signatures"), |bencher| {
            bencher.iter(|| black_box(describe_vertices(&pairs, &vertices, &descriptor)));
        });
        let index = index(&parameters)?;
        let query = describe_query(soup.clone(), &parameters, &cancel, &|_| ())?;
        group.bench_function(name("ranking"), |bencher| {
            bencher.iter(|| black_box(rank(&query.views, &index, parameters.rank_by, &cancel)));
        });
        group.bench_function(name("whole"), |bencher| {
            bencher.iter(|| -> Outcome<_> {
                let (_, soup) = read(&source, &limits)?;
                let query = describe_query(soup, &parameters, &cancel, &|_| ())?;
                Ok(black_box(rank(
                    &query.views,
                    &index,
                    parameters.rank_by,
                    &cancel,
                )?))
            });
        });
        let described = descriptions(first, &parameters)?;
        let shapes: Vec<&Description> = described.iter().collect();
        group.bench_function(name("learning"), |bencher| {
            bencher.iter(|| black_box(learn_model(&shapes, &parameters, &cancel, &|_, _| ())));
        });
    }
    group.finish();
    Ok(())
}

fn query(criterion: &mut Criterion) {
    if let Err(error) = stages(criterion) {
        eprintln!("query: {error}");
        std::process::exit(1);
    }
}

criterion_group!(benches, query);
criterion_main!(benches);
