//! What is tried.

use shapelex_core::coding::LearnParameters;
use shapelex_core::signature::LocalParameters;
use std::error::Error;
use std::fmt;

/// How large an open query's neighbourhoods are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Units {
    /// Those of the training shapes, whose sizes tell classes apart: one radius for all.
    Common,
    /// Those of the training shapes: a class's own radius.
    Known,
    /// The full area is one of several times the visible one.
    Unknown,
    /// Both, with a prior for known ones.
    Auto,
}

#[derive(Clone, Debug)]
pub struct Settings {
    pub sets: Vec<String>,
    pub local: LocalParameters,
    pub learning: LearnParameters,
    pub working_size: usize,
    pub units: Units,
    /// Full area over visible area of an open query of unknown scale.
    pub areas: Vec<f64>,
    /// Temperature of the soft minimum over them.
    pub temperature: f64,
    /// Weights of the local signature in the fused score.
    pub weights: Vec<f64>,
    /// Share of an open query's signatures that the trimmed mean keeps.
    pub trimmed: f64,
    /// Whether each wrong answer is listed.
    pub list: bool,
}

pub const ALL: [&str; 11] = [
    "cuts",
    "holes",
    "shrec07-loo",
    "shrec07-one",
    "faust-loo",
    "faust-one",
    "animals-one",
    "tosca-one",
    "deformed",
    "animals-loo",
    "tosca-loo",
];

impl Default for Settings {
    fn default() -> Self {
        Self {
            sets: ALL[..9].iter().map(|s| (*s).to_owned()).collect(),
            local: LocalParameters {
                keypoints: 400,
                ..LocalParameters::default()
            },
            learning: LearnParameters {
                lambda: 0.3,
                ..LearnParameters::default()
            },
            working_size: 2000,
            units: Units::Common,
            areas: vec![1.0, 1.25, 1.6, 2.0],
            temperature: 0.003,
            weights: vec![0.25, 0.5, 1.0, 2.0, 4.0],
            trimmed: 0.8,
            list: false,
        }
    }
}

fn numbers(text: &str) -> Result<Vec<f64>, std::num::ParseFloatError> {
    text.split(',').map(str::parse).collect()
}

impl Settings {
    /// Defaults, changed by `name=value` each.
    pub fn parse(arguments: &[String]) -> Result<Self, Box<dyn Error>> {
        let mut settings = Self::default();
        for argument in arguments {
            let (name, value) = argument.split_once('=').ok_or("expected NAME=VALUE")?;
            settings
                .set(name, value)
                .map_err(|error| format!("{argument}: {error}"))?;
        }
        Ok(settings)
    }

    fn set(&mut self, name: &str, value: &str) -> Result<(), Box<dyn Error>> {
        match name {
            "set" => self.sets = value.split(',').map(str::to_owned).collect(),
            "radii" => self.local.radii = numbers(value)?,
            "keypoints" => self.local.keypoints = value.parse()?,
            "points" => self.local.points = value.parse()?,
            "smoothing" => self.local.smoothing = value.parse()?,
            "seed" => self.local.seed = value.parse()?,
            "lambda" => self.learning.lambda = value.parse()?,
            "atoms" => self.learning.atoms = value.parse()?,
            "iterations" => self.learning.iterations = value.parse()?,
            "size" => self.working_size = value.parse()?,
            "units" => {
                self.units = match value {
                    "common" => Units::Common,
                    "known" => Units::Known,
                    "unknown" => Units::Unknown,
                    "auto" => Units::Auto,
                    _ => return Err("expected common, known, unknown or auto".into()),
                }
            }
            "areas" => self.areas = numbers(value)?,
            "temperature" => self.temperature = value.parse()?,
            "weights" => self.weights = numbers(value)?,
            "trimmed" => self.trimmed = value.parse()?,
            "list" => self.list = value == "yes",
            _ => return Err("there is no such setting".into()),
        }
        Ok(())
    }
}

impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} lambda={} atoms={} size={} units={:?} trimmed={}",
            serde_json::to_string(&self.local).unwrap_or_default(),
            self.learning.lambda,
            self.learning.atoms,
            self.working_size,
            self.units,
            self.trimmed
        )
    }
}
