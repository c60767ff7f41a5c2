//! Every parameter of the method, with its named presets.

use crate::coding::LearnParameters;
use crate::mesh::{Components, PrepareOptions};
use crate::signature::descriptor::{Descriptor, DescriptorParameters, WksRange};
use crate::signature::normalise::Normalisation;
use serde::{Deserialize, Serialize};

/// Goes into the fingerprints, and changes where the same parameters come to describe training shapes differently, so
/// that what was kept is made anew: 3 since the grid of parts follows their number of eigenpairs.
const DESCRIBED: &str = "3";

/// A parameter is outside its range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name} must be {expected}, got {found}")]
pub struct ParameterError {
    /// The parameter's name, as in [`Parameters`].
    pub name: &'static str,
    /// What it may be.
    pub expected: String,
    /// What it was.
    pub found: String,
}

/// A named setting of all parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// What a newcomer should use: n 200, M 60, unit √WKS, L 128, holes filled, open queries doubled too
    /// (docs/method.md#hypotheses), ranked by objective.
    #[default]
    Default,
    /// The paper's literal setting: n 200, M 500, unit WKS, L 500, nothing filled, ranked by Eq. 5.
    Paper,
    /// `default` with the affine-whitened hypothesis (docs/method.md#hypotheses), for stretched shapes.
    Robust,
    /// `default` with less of most, for answers within some 20 ms: 1000 vertices, n 130, 600
    /// signatures of a training shape and 200 of a query.
    Fast,
}

impl Preset {
    /// Every preset.
    pub const ALL: [Self; 4] = [Self::Default, Self::Paper, Self::Robust, Self::Fast];
}

/// What classes are ordered by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RankBy {
    /// Mean Lasso objective per signature; the trimmed one where a surface has a boundary.
    #[default]
    Objective,
    /// Mean of the smallest 80 % of the objectives.
    TrimmedObjective,
    /// ‖S − DA‖_F, the paper's Eq. 5.
    Frobenius,
}

/// A way to prepare a query (docs/method.md#hypotheses). Each class keeps its best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hypothesis {
    /// As it is.
    Plain,
    /// Whitened by its second moments, so that an affine map of a known mesh is undone.
    Whitened,
    /// An open surface doubled along its boundary, its full area guessed.
    Doubled,
}

/// A kind of signature a class has a dictionary for. Every hypothesis is coded under one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// The descriptor on the shape's own energy grid.
    Plain,
    /// The same of the whitened shape.
    Whitened,
    /// WKS on the fixed energy grid, which open queries are compared on, doubled and as they are.
    FixedGrid,
}

/// All parameters of the method. Two indexes learnt with equal parameters from equal files are equal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    /// The preset these parameters started from; only a name, the values below count.
    pub preset: Preset,
    /// Which connected components of a mesh are kept.
    pub components: Components,
    /// Boundary loops with a perimeter below this many times √area are closed; 0 closes none.
    pub fill_holes_below: f64,
    /// Meshes with more vertices are simplified to this many; 0 never does.
    pub working_size: usize,
    /// Closed meshes with fewer vertices are refined to this many, on the same surface; 0 never does.
    pub refine_below: usize,
    /// n, the number of eigenpairs.
    pub eigenpairs: usize,
    /// Eigenpairs on the fixed grid, where open queries are compared with training shapes; no fewer than n are solved
    /// for. Parts agree with the whole in what is small, which takes more of them to see.
    #[serde(default = "part_eigenpairs_before")]
    pub part_eigenpairs: usize,
    /// The local descriptor.
    pub descriptor: Descriptor,
    /// M, the length of a signature: energies of the WKS, times of the HKS, frequencies of the SI-HKS.
    pub energies: usize,
    /// σ of the WKS in steps of the energy grid.
    pub sigma_steps: f64,
    /// Where the WKS's energies lie.
    pub range: WksRange,
    /// How a signature becomes a signal.
    pub normalisation: Normalisation,
    /// λ of the Lasso, in the convention ½‖s − Da‖² + λ‖a‖₁.
    pub lambda: f64,
    /// L, the number of atoms of a dictionary.
    pub atoms: usize,
    /// Mini-batches of the dictionary learning.
    pub iterations: usize,
    /// Signals per mini-batch.
    pub batch: usize,
    /// Signatures sampled per training shape, by area; 0 takes all.
    pub samples_per_shape: usize,
    /// Signatures of a query that are coded, sampled by area; 0 codes all.
    pub query_samples: usize,
    /// What classes are ordered by.
    pub rank_by: RankBy,
    /// The ways a query is prepared; always starts with plain.
    pub hypotheses: Vec<Hypothesis>,
    /// Whether every training shape gets a dictionary of its own too (docs/method.md#ranking).
    pub per_shape: bool,
    /// Seed of everything that is random.
    pub seed: u64,
}

/// What an index has that was learnt before there was a choice: its grid ended at log 3000, which is log 15n.
fn part_eigenpairs_before() -> usize {
    200
}

impl Default for Parameters {
    fn default() -> Self {
        Self::preset(Preset::Default)
    }
}

impl Parameters {
    /// The values of a preset.
    pub fn preset(preset: Preset) -> Self {
        let default = Self {
            preset,
            components: Components::Largest,
            fill_holes_below: 1.2,
            working_size: 2000,
            refine_below: 1000,
            eigenpairs: 200,
            part_eigenpairs: 300,
            descriptor: Descriptor::Wks,
            energies: 60,
            sigma_steps: 6.0,
            range: WksRange::Code,
            normalisation: Normalisation::SqrtUnit,
            lambda: 0.5,
            atoms: 128,
            iterations: 25,
            batch: 256,
            samples_per_shape: 900,
            query_samples: 1000,
            rank_by: RankBy::Objective,
            hypotheses: vec![Hypothesis::Plain, Hypothesis::Doubled],
            per_shape: false,
            seed: 1,
        };
        match preset {
            Preset::Default => default,
            Preset::Paper => Self {
                fill_holes_below: 0.0,
                working_size: 1500,
                refine_below: 0,
                energies: 500,
                normalisation: Normalisation::Unit,
                atoms: 500,
                samples_per_shape: 0,
                query_samples: 0,
                rank_by: RankBy::Frobenius,
                hypotheses: vec![Hypothesis::Plain],
                ..default
            },
            Preset::Robust => Self {
                part_eigenpairs: 500,
                hypotheses: vec![Hypothesis::Plain, Hypothesis::Whitened, Hypothesis::Doubled],
                ..default
            },
            Preset::Fast => Self {
                working_size: 1000,
                refine_below: 650,
                eigenpairs: 130,
                part_eigenpairs: 130,
                samples_per_shape: 600,
                query_samples: 200,
                ..default
            },
        }
    }

    /// Checks every range. The message names the parameter, what it may be and what it was.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = |name: &'static str, ok: bool, expected: &str, found: String| {
            if ok {
                Ok(())
            } else {
                Err(ParameterError {
                    name,
                    expected: expected.to_owned(),
                    found,
                })
            }
        };
        let within = |name, value: usize, low: usize, high: usize| {
            check(
                name,
                (low..=high).contains(&value),
                &format!("between {low} and {high}"),
                value.to_string(),
            )
        };
        within("eigenpairs", self.eigenpairs, 3, 1000)?;
        within("part_eigenpairs", self.part_eigenpairs, 3, 1000)?;
        within("energies", self.energies, 2, 2000)?;
        within("atoms", self.atoms, 1, 5000)?;
        within("iterations", self.iterations, 1, 10_000)?;
        within("batch", self.batch, 1, 100_000)?;
        if self.working_size != 0 {
            within("working_size", self.working_size, 50, 200_000)?;
        }
        within("refine_below", self.refine_below, 0, 200_000)?;
        let positive = |x: f64| x.is_finite() && x > 0.0;
        check(
            "lambda",
            positive(self.lambda),
            "a finite number above 0",
            self.lambda.to_string(),
        )?;
        check(
            "sigma_steps",
            positive(self.sigma_steps),
            "a finite number above 0",
            self.sigma_steps.to_string(),
        )?;
        check(
            "fill_holes_below",
            self.fill_holes_below.is_finite() && self.fill_holes_below >= 0.0,
            "a finite number, 0 or more",
            self.fill_holes_below.to_string(),
        )?;
        check(
            "hypotheses",
            self.hypotheses.first() == Some(&Hypothesis::Plain)
                && (1..self.hypotheses.len()).all(|i| !self.hypotheses[..i].contains(&self.hypotheses[i])),
            "a list that starts with plain and names each hypothesis once",
            format!("{:?}", self.hypotheses),
        )
    }

    /// The channels a training shape needs under these hypotheses.
    pub fn channels(&self) -> Vec<Channel> {
        self.hypotheses
            .iter()
            .map(|h| match h {
                Hypothesis::Plain => Channel::Plain,
                Hypothesis::Whitened => Channel::Whitened,
                Hypothesis::Doubled => Channel::FixedGrid,
            })
            .collect()
    }

    /// How meshes are prepared.
    pub fn prepare_options(&self) -> PrepareOptions {
        PrepareOptions {
            components: self.components,
            fill_holes_below: self.fill_holes_below,
            working_size: self.working_size,
        }
    }

    /// How vertices are described.
    pub fn descriptor_parameters(&self) -> DescriptorParameters {
        DescriptorParameters {
            descriptor: self.descriptor,
            dimension: self.energies,
            sigma_steps: self.sigma_steps,
            range: self.range,
        }
    }

    /// How dictionaries are learnt.
    pub fn learn_parameters(&self) -> LearnParameters {
        LearnParameters {
            atoms: self.atoms,
            lambda: self.lambda,
            iterations: self.iterations,
            batch: self.batch,
            seed: self.seed,
        }
    }

    /// A name, 32 hexadecimal digits, shared by exactly the parameters that give a training shape the same
    /// signatures.
    pub fn description_fingerprint(&self) -> String {
        let part = Self {
            rank_by: RankBy::Objective,
            query_samples: 0,
            per_shape: false,
            ..self.clone()
        };
        let part = Self {
            lambda: 0.5,
            atoms: 1,
            iterations: 1,
            batch: 1,
            preset: Preset::Default,
            ..part
        };
        part.digest(DESCRIBED)
    }

    /// A name, 32 hexadecimal digits, shared by exactly the parameters that learn the same dictionaries from the same
    /// shapes.
    pub fn learning_fingerprint(&self) -> String {
        let part = Self {
            rank_by: RankBy::Objective,
            query_samples: 0,
            preset: Preset::Default,
            ..self.clone()
        };
        part.digest(DESCRIBED)
    }

    fn digest(&self, prefix: &str) -> String {
        // A struct of numbers and unit enums always serialises; field order is the declaration's.
        let mut bytes = prefix.as_bytes().to_vec();
        bytes.extend(serde_json::to_vec(self).unwrap_or_default());
        blake3::hash(&bytes).to_hex()[..32].to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_from_before_parts_had_their_own_number_of_eigenpairs_keeps_its_grid() {
        for preset in Preset::ALL {
            let parameters = Parameters::preset(preset);
            let mut kept = serde_json::to_value(&parameters).unwrap();
            kept.as_object_mut().unwrap().remove("part_eigenpairs");
            let read: Parameters = serde_json::from_value(kept).unwrap();
            let expected = Parameters {
                part_eigenpairs: 200,
                ..parameters
            };
            assert_eq!(read, expected);
        }
    }
}
