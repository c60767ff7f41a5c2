//! Learns classes and ranks queries without a service: `cargo run --release --package shapelex-eval --example learn_and_rank`.
//!
//! Five creatures are the classes, four poses of each train, a fifth is the query.

use shapelex_core::cancel::Cancel;
use shapelex_core::parameters::{Parameters, Preset};
use shapelex_core::pipeline::{Description, describe_shape, learn_model};
use shapelex_core::ranking::{Index, IndexedClass, NotJudged};
use shapelex_core::retrieval::{Deadline, QueryEngine, QuerySpec, SearchIndex};
use shapelex_eval::sample::{ZooOptions, species};
use std::collections::BTreeMap;
use std::error::Error;

const SEED: u64 = 1;
const TRAINING_POSES: usize = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let parameters = Parameters::preset(Preset::Default);
    let (cancel, size) = (Cancel::new(), ZooOptions::default());
    let creatures = species(SEED, 5);
    let mut classes = Vec::new();
    for creature in &creatures {
        let mut shapes = Vec::new();
        for pose in 0..TRAINING_POSES {
            let mesh = creature.pose(SEED, pose, &size)?;
            shapes.push(describe_shape(mesh, &parameters, &cancel, &|_| ())?);
        }
        let shapes: Vec<&Description> = shapes.iter().collect();
        let model = learn_model(&shapes, &parameters, &cancel, &|_, _| ())?;
        classes.push(IndexedClass {
            label: creature.name().to_owned(),
            dictionaries: model.dictionaries,
            shapes: Vec::new(),
        });
    }
    let rank_by = parameters.rank_by;
    let index = SearchIndex {
        dictionaries: Index { parameters, classes },
        names: BTreeMap::new(),
        baselines: None,
        // Answers are judged by held-out training shapes, of which four poses are too few.
        calibration: Err(NotJudged::TooFewShapes),
    };
    let spec = QuerySpec {
        method: rank_by.into(),
        top: Some(3),
    };
    for creature in &creatures {
        let query = creature.pose(SEED, TRAINING_POSES, &size)?;
        let outcome = QueryEngine::default().run(&index, query, &spec, &Deadline::default())?;
        let ranked: Vec<String> = outcome
            .classes
            .iter()
            .take(3)
            .map(|class| format!("{} {:.4}", class.label, class.score))
            .collect();
        println!("{}: {}", creature.name(), ranked.join(", "));
    }
    Ok(())
}
