//! Scores of the local signature.

use super::rows::{Row, Rows};
use super::sets::{Set, Shape};
use super::settings::{Settings, Units};
use faer::Mat;
use rayon::prelude::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::coding::{CodingError, Dictionary, Signals, learn, score_signals};
use shapelex_core::signature::local_signatures;
use std::collections::{BTreeMap, HashMap};
use std::error::Error;
use std::sync::{Arc, Mutex};

/// Steps of the logarithm of a scale, so that classes of about one size share a description.
const STEPS_PER_OCTAVE: f64 = 8.0;
/// What an assumed area must be better by than known units.
const PRIOR: f64 = 0.001;

type Described = HashMap<(usize, i32), Arc<Mat<f64>>>;

/// Describes shapes and learns dictionaries as they are asked for.
struct Local<'a> {
    set: &'a Set,
    settings: &'a Settings,
    described: Mutex<Described>,
    /// Area of a common radius, where there is one.
    common: Option<f64>,
    learnt: Mutex<HashMap<Vec<usize>, Arc<Dictionary>>>,
}

pub fn rows(set: &Set, settings: &Settings) -> Result<Rows, Box<dyn Error>> {
    let local = Local {
        set,
        settings,
        described: Mutex::default(),
        common: common(set, settings),
        learnt: Mutex::default(),
    };
    let mut rows = Rows::default();
    for (number, round) in set.rounds.iter().enumerate() {
        let classes: BTreeMap<&str, (Arc<Dictionary>, f64)> = round
            .train
            .iter()
            .map(|(class, members)| Ok((class.as_str(), (local.learn(members)?, local.size(members)))))
            .collect::<Result<_, CodingError>>()?;
        let answer = |&shape: &usize| -> Result<Row, CodingError> {
            let scores = classes
                .iter()
                .map(|(class, (dictionary, area))| {
                    Ok(((*class).to_owned(), local.score(shape, dictionary, *area)?))
                })
                .collect::<Result<_, CodingError>>()?;
            Ok(Row {
                round: number,
                shape,
                scores,
            })
        };
        rows.queries.extend(
            round
                .query
                .par_iter()
                .map(answer)
                .collect::<Result<Vec<_>, _>>()?,
        );
        if let Some(probes) = set.probes.get(number) {
            rows.probes
                .extend(probes.par_iter().map(answer).collect::<Result<Vec<_>, _>>()?);
        }
    }
    Ok(rows)
}

/// Geometric mean of the areas of the training shapes, where open shapes are asked about in the same units.
fn common(set: &Set, settings: &Settings) -> Option<f64> {
    let round = set.rounds.first().filter(|_| settings.units == Units::Common)?;
    let trained: Vec<&Shape> = round.train.values().flatten().map(|&i| &set.shapes[i]).collect();
    let sum: f64 = trained.iter().map(|shape| shape.area.ln()).sum();
    let parts = round.query.iter().any(|&q| set.shapes[q].open);
    (parts && set.name != "deformed").then(|| (sum / trained.len() as f64).exp())
}

/// The step of the scale that a shape of one area has where another counts as 1.
fn step(area: f64, own: f64) -> i32 {
    (STEPS_PER_OCTAVE * 0.5 * (area / own).log2()).round() as i32
}

impl Local<'_> {
    fn shape(&self, shape: usize) -> &Shape {
        &self.set.shapes[shape]
    }

    /// Geometric mean of the areas.
    fn size(&self, members: &[usize]) -> f64 {
        let sum: f64 = members.iter().map(|&i| self.shape(i).area.ln()).sum();
        (sum / members.len() as f64).exp()
    }

    /// Signals with radii of 2^(step/8) times the ones set.
    fn describe(&self, shape: usize, step: i32) -> Arc<Mat<f64>> {
        if let Some(known) = self
            .described
            .lock()
            .ok()
            .and_then(|d| d.get(&(shape, step)).cloned())
        {
            return known;
        }
        let mut parameters = self.settings.local.clone();
        let scale = (f64::from(step) / STEPS_PER_OCTAVE).exp2();
        parameters.radii.iter_mut().for_each(|r| *r *= scale);
        let signals = local_signatures(&self.shape(shape).mesh, &parameters, &Cancel::new())
            .map_or_else(|_| Mat::zeros(0, 0), |s| s.matrix);
        let signals = Arc::new(signals);
        if let Ok(mut described) = self.described.lock() {
            described.insert((shape, step), signals.clone());
        }
        signals
    }

    /// The step of a shape's own scale.
    fn whole(&self, shape: usize) -> i32 {
        self.common.map_or(0, |area| step(area, self.shape(shape).area))
    }

    fn learn(&self, members: &[usize]) -> Result<Arc<Dictionary>, CodingError> {
        if let Some(known) = self.learnt.lock().ok().and_then(|l| l.get(members).cloned()) {
            return Ok(known);
        }
        let signals: Vec<Arc<Mat<f64>>> = members.iter().map(|&i| self.describe(i, self.whole(i))).collect();
        let parts: Vec<_> = signals.iter().map(|s| s.as_ref().as_ref()).collect();
        let (dictionary, _) = learn(&parts, &self.settings.learning, &Cancel::new(), &|_, _| ())?;
        let dictionary = Arc::new(dictionary);
        if let Ok(mut learnt) = self.learnt.lock() {
            learnt.insert(members.to_vec(), dictionary.clone());
        }
        Ok(dictionary)
    }

    /// The score of a shape under a class of an area.
    fn score(&self, shape: usize, dictionary: &Dictionary, area: f64) -> Result<f64, CodingError> {
        let query = self.shape(shape);
        let at = |step: f64| self.objective(shape, step.round() as i32, dictionary);
        if !query.open || self.common.is_some() {
            return self.objective(shape, self.whole(shape), dictionary);
        }
        let known = || self.objective(shape, step(area, query.area), dictionary);
        let unknown = || -> Result<f64, CodingError> {
            let scores = self
                .settings
                .areas
                .iter()
                .map(|full| at(STEPS_PER_OCTAVE * 0.5 * full.log2()))
                .collect::<Result<Vec<_>, _>>()?;
            Ok(soft_minimum(&scores, self.settings.temperature))
        };
        match self.settings.units {
            Units::Known | Units::Common => known(),
            Units::Unknown => unknown(),
            Units::Auto => Ok(known()?.min(unknown()? + PRIOR)),
        }
    }

    /// Mean objective of a shape's signals; of an open one that of the smallest.
    fn objective(&self, shape: usize, step: i32, dictionary: &Dictionary) -> Result<f64, CodingError> {
        let signals = self.describe(shape, step);
        let codes = score_signals(
            dictionary,
            &Signals::new(signals.as_ref().as_ref())?,
            self.settings.learning.lambda,
            &Cancel::new(),
        )?;
        let mut objectives: Vec<f64> = codes.iter().map(|code| code.objective).collect();
        objectives.sort_by(f64::total_cmp);
        if self.shape(shape).open {
            objectives.truncate(((objectives.len() as f64 * self.settings.trimmed).ceil() as usize).max(1));
        }
        Ok(objectives.iter().sum::<f64>() / objectives.len().max(1) as f64)
    }
}

fn soft_minimum(values: &[f64], temperature: f64) -> f64 {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let sum: f64 = values.iter().map(|m| (-(m - least) / temperature).exp()).sum();
    least - temperature * (sum / values.len() as f64).ln()
}
