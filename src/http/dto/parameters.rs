//! The method's parameters on the wire.

use serde::{Deserialize, Serialize};
use shapelex_core::baseline::Baseline;
use shapelex_core::mesh::Components;
use shapelex_core::parameters::{Hypothesis, Parameters, Preset, RankBy};
use shapelex_core::retrieval::RankingMethod;
use shapelex_core::signature::descriptor::{Descriptor, WksRange};
use shapelex_core::signature::normalise::Normalisation;
use utoipa::ToSchema;

/// Mirrors a domain enum of unit variants.
macro_rules! mirrored {
    ($(#[$meta:meta])* $name:ident of $domain:ident { $($(#[$doc:meta])* $variant:ident),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum $name { $($(#[$doc])* $variant,)* }

        impl From<$domain> for $name {
            fn from(value: $domain) -> Self {
                match value { $($domain::$variant => Self::$variant,)* }
            }
        }

        impl From<$name> for $domain {
            fn from(value: $name) -> Self {
                match value { $($name::$variant => Self::$variant,)* }
            }
        }
    };
}

mirrored! {
    /// A named setting of all parameters.
    PresetName of Preset {
        /// What a newcomer should use.
        Default,
        /// The paper's literal setting.
        Paper,
        /// `default` with further hypotheses about the query.
        Robust,
        /// `default` with less of everything, for answers within some 20 ms.
        Fast,
    }
}
mirrored! {
    /// What classes are ordered by.
    RankByName of RankBy {
        /// Mean Lasso objective per signature.
        Objective,
        /// Mean of the smallest 80 % of the objectives.
        TrimmedObjective,
        /// The reconstruction error of Eq. 5.
        Frobenius,
    }
}
/// What a query's classes are ordered by: the ways of sparse coding, and the methods the paper compares with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum QueryRankByName {
    /// Mean Lasso objective per signature.
    Objective,
    /// Mean of the smallest 80 % of the objectives.
    TrimmedObjective,
    /// The reconstruction error of Eq. 5.
    Frobenius,
    /// Distance of the first 13 eigenvalues to those of the class's nearest shape.
    ShapeDna,
    /// The same with eigenvalues divided by the first.
    ShapeDnaRelative,
    /// Distance of the histograms of signature distances.
    SignatureDistances,
    /// Distance of the histograms of words.
    BagOfWords,
}

impl From<RankBy> for QueryRankByName {
    fn from(value: RankBy) -> Self {
        match value {
            RankBy::Objective => Self::Objective,
            RankBy::TrimmedObjective => Self::TrimmedObjective,
            RankBy::Frobenius => Self::Frobenius,
        }
    }
}

impl QueryRankByName {
    /// Every way, sparse coding first.
    pub const ALL: [Self; 7] = [
        Self::Objective,
        Self::TrimmedObjective,
        Self::Frobenius,
        Self::ShapeDna,
        Self::ShapeDnaRelative,
        Self::SignatureDistances,
        Self::BagOfWords,
    ];

    /// The method of this name.
    pub fn method(self) -> RankingMethod {
        match self {
            Self::Objective => RankBy::Objective.into(),
            Self::TrimmedObjective => RankBy::TrimmedObjective.into(),
            Self::Frobenius => RankBy::Frobenius.into(),
            Self::ShapeDna => RankingMethod::Baseline(Baseline::ShapeDna),
            Self::ShapeDnaRelative => RankingMethod::Baseline(Baseline::ShapeDnaRelative),
            Self::SignatureDistances => RankingMethod::Baseline(Baseline::SignatureDistances),
            Self::BagOfWords => RankingMethod::Baseline(Baseline::BagOfWords),
        }
    }

    /// The name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Objective => "objective",
            Self::TrimmedObjective => "trimmed_objective",
            Self::Frobenius => "frobenius",
            Self::ShapeDna => "shape_dna",
            Self::ShapeDnaRelative => "shape_dna_relative",
            Self::SignatureDistances => "signature_distances",
            Self::BagOfWords => "bag_of_words",
        }
    }
}

mirrored! {
    /// A way to prepare a query.
    HypothesisName of Hypothesis {
        /// As it is.
        Plain,
        /// Whitened by its second moments, so that an affine map is undone.
        Whitened,
        /// An open surface doubled along its boundary.
        Doubled,
    }
}
mirrored! {
    /// Which connected components of a mesh are kept.
    ComponentsName of Components {
        /// The one with the largest area.
        Largest,
        /// All with at least 1 % of the area.
        All,
    }
}
mirrored! {
    /// A local descriptor.
    DescriptorName of Descriptor {
        /// Wave Kernel Signature.
        Wks,
        /// Heat Kernel Signature.
        Hks,
        /// Scale-invariant Heat Kernel Signature.
        SiHks,
    }
}
mirrored! {
    /// How a signature is scaled before it is coded.
    NormalisationName of Normalisation {
        /// The root of each value, then unit length.
        SqrtUnit,
        /// Unit length.
        Unit,
        /// As it is.
        Raw,
    }
}

/// Where the energies of the Wave Kernel Signature lie.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RangeDto {
    /// From the first non-zero eigenvalue to the last one divided by 1.02 (in the logarithm), as the code released
    /// with the WKS paper does.
    Code,
    /// From the first non-zero eigenvalue to the last.
    ScaleFree,
    /// The WKS paper's text.
    Paper7,
    /// The same logarithmic energies for every shape.
    Fixed {
        /// First energy.
        low: f64,
        /// Last energy.
        high: f64,
    },
}

impl From<WksRange> for RangeDto {
    fn from(range: WksRange) -> Self {
        match range {
            WksRange::Code => Self::Code,
            WksRange::ScaleFree => Self::ScaleFree,
            WksRange::Paper7 => Self::Paper7,
            WksRange::Fixed { low, high } => Self::Fixed { low, high },
        }
    }
}

impl From<RangeDto> for WksRange {
    fn from(range: RangeDto) -> Self {
        match range {
            RangeDto::Code => Self::Code,
            RangeDto::ScaleFree => Self::ScaleFree,
            RangeDto::Paper7 => Self::Paper7,
            RangeDto::Fixed { low, high } => Self::Fixed { low, high },
        }
    }
}

/// One list of fields for three things: the full set, the overrides, and the mapping between them and the domain.
macro_rules! parameter_set {
    ($($(#[$doc:meta])* $field:ident: $wire:ty;)*) => {
        /// All parameters of the method.
        #[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
        pub struct ParametersDto {
            /// The preset these values started from.
            pub preset: PresetName,
            $($(#[$doc])* pub $field: $wire,)*
        }

        /// Values to change; those left out stay.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
        #[serde(default, deny_unknown_fields)]
        pub struct ParameterOverrides {
            $($(#[$doc])* pub $field: Option<$wire>,)*
        }

        impl From<Parameters> for ParametersDto {
            fn from(from: Parameters) -> Self {
                Self { preset: from.preset.into(), $($field: Wire::wire(from.$field),)* }
            }
        }

        impl ParameterOverrides {
            /// The given parameters with these values in place of theirs.
            pub fn apply(self, mut to: Parameters) -> Parameters {
                $(if let Some(value) = self.$field { to.$field = Wire::domain(value); })*
                to
            }
        }
    };
}

/// A value that has a form on the wire.
trait Wire<W> {
    fn wire(self) -> W;
    fn domain(wire: W) -> Self;
}

macro_rules! wire_as {
    ($($domain:ty => $wire:ty),* $(,)?) => {
        $(impl Wire<$wire> for $domain {
            fn wire(self) -> $wire { self.into() }
            fn domain(wire: $wire) -> Self { wire.into() }
        })*
    };
}

wire_as! {
    usize => usize, u64 => u64, f64 => f64, bool => bool,
    Components => ComponentsName, Descriptor => DescriptorName, WksRange => RangeDto,
    Normalisation => NormalisationName, RankBy => RankByName,
}

impl Wire<Vec<HypothesisName>> for Vec<Hypothesis> {
    fn wire(self) -> Vec<HypothesisName> {
        self.into_iter().map(Into::into).collect()
    }
    fn domain(wire: Vec<HypothesisName>) -> Self {
        wire.into_iter().map(Into::into).collect()
    }
}

parameter_set! {
    /// Which connected components of a mesh are kept.
    components: ComponentsName;
    /// Boundary loops with a perimeter below this many times the root of the area are closed; 0 closes none.
    fill_holes_below: f64;
    /// Meshes with more vertices are simplified to this many; 0 never does.
    working_size: usize;
    /// Closed meshes with fewer vertices are refined to this many, on the same surface; 0 never does.
    refine_below: usize;
    /// n, the number of eigenpairs.
    eigenpairs: usize;
    /// Eigenpairs on the grid where open queries are compared with training shapes.
    part_eigenpairs: usize;
    /// The local descriptor.
    descriptor: DescriptorName;
    /// M, the length of a signature.
    energies: usize;
    /// Width of the WKS in steps of its energy grid.
    sigma_steps: f64;
    /// Where the energies of the WKS lie.
    range: RangeDto;
    /// How a signature is scaled before it is coded.
    normalisation: NormalisationName;
    /// λ of the Lasso.
    lambda: f64;
    /// L, the number of atoms of a dictionary.
    atoms: usize;
    /// Mini-batches of the dictionary learning.
    iterations: usize;
    /// Signals per mini-batch.
    batch: usize;
    /// Signatures sampled per training shape; 0 takes all.
    samples_per_shape: usize;
    /// Signatures of a query that are coded; 0 codes all.
    query_samples: usize;
    /// What classes are ordered by.
    rank_by: RankByName;
    /// The ways a query is prepared; starts with `plain`.
    hypotheses: Vec<HypothesisName>;
    /// Whether every training shape gets a dictionary of its own too.
    per_shape: bool;
    /// Seed of everything that is random.
    #[schema(format = "uint64")]
    seed: u64;
}

/// A preset and its values.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct PresetDto {
    /// Its name.
    pub name: PresetName,
    /// Its values.
    pub parameters: ParametersDto,
}

/// The presets, and what a reindex without parameters uses.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ParametersAnswer {
    /// What a reindex without a preset starts from.
    pub current: ParametersDto,
    /// The presets.
    pub presets: Vec<PresetDto>,
}
