//! Scores of the WKS as the default preset has it, kept on disk.

use super::rows::{Row, Rows};
use super::sets::Set;
use super::settings::Settings;
use rayon::prelude::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::describe_both;
use shapelex_eval::benchmark::evaluate::{Models, Trial, run_rounds};
use shapelex_eval::benchmark::{LabelledShape, Round};
use std::error::Error;
use std::path::Path;

/// Computes them, or reads them where they are known.
pub fn rows(set: &Set, cache: &Path, _settings: &Settings) -> Result<Rows, Box<dyn Error>> {
    let at = cache.join(format!("wks-{}.json", set.name));
    if let Ok(bytes) = std::fs::read(&at) {
        return Ok(serde_json::from_slice(&bytes)?);
    }
    let parameters = Parameters::default();
    let shapes: Vec<LabelledShape> = set
        .shapes
        .par_iter()
        .map(|shape| {
            let (training, query) = describe_both(shape.soup.clone(), &parameters, &Cancel::new())?;
            Ok(LabelledShape {
                class: shape.class.clone(),
                name: shape.name.clone(),
                training,
                query,
            })
        })
        .collect::<Result<_, shapelex_core::pipeline::PipelineError>>()?;
    let answer = |rounds: &[Round]| -> Result<Vec<Row>, Box<dyn Error>> {
        let trial = Trial {
            rounds,
            same: &set.same,
            given: &Models::new(),
        };
        let results = run_rounds(&shapes, &trial, &parameters, &Cancel::new(), &|_, _| ())?;
        let asked = rounds
            .iter()
            .enumerate()
            .flat_map(|(r, round)| round.query.iter().map(move |&q| (r, q)));
        Ok(asked
            .zip(results)
            .map(|((round, shape), result)| Row {
                round,
                shape,
                scores: result.ranked.into_iter().collect(),
            })
            .collect())
    };
    let probes: Vec<Round> = set
        .rounds
        .iter()
        .zip(&set.probes)
        .map(|(round, probes)| Round {
            train: round.train.clone(),
            query: probes.clone(),
        })
        .collect();
    let rows = Rows {
        queries: answer(&set.rounds)?,
        probes: answer(&probes)?,
    };
    std::fs::write(&at, serde_json::to_vec(&rows)?)?;
    Ok(rows)
}
