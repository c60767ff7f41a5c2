//! The nine deformations of the robustness benchmark, at five strengths each (Boscaini, Castellani 2013, section 4,
//! after the SHREC 2011 robustness benchmark).
//!
//! Every deformation is a function of the null shape, a strength from 1 to 5 and a seed. Lengths are relative to √area
//! of the null shape, so a strength means the same on every shape.
//!
//! The paper gives its strengths by pictures only, but for scale and down-sampling. Ours were chosen once, on twelve
//! nulls of TOSCA and Sumner, so that area-rescaled Shape DNA scores under `hold` about what the paper reports of it,
//! and without a look at any other method (docs/evaluation/results.md#robustness-benchmark).

pub mod geometry;
pub mod holes;
pub mod local_scale;
pub mod range_scan;
pub mod sampling;
pub mod similarity;
pub mod topology;
pub mod vertices;
pub mod view;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use shapelex_core::mesh::TriangleSoup;

/// A kind of deformation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Deformation {
    /// A linear map that stretches and shears.
    Affine,
    /// A few large discs cut out.
    Holes,
    /// Many single vertices cut out with their faces.
    MicroHoles,
    /// Uniform scale by 0.5, 0.875, 1.25, 1.625 or 2.
    Scale,
    /// Down-sampling, to below 20 % of the vertices at the strongest.
    Sampling,
    /// Gaussian noise on every coordinate.
    Noise,
    /// A few vertices thrown far.
    ShotNoise,
    /// Vertices welded that are near in space and far along the surface.
    Topology,
    /// Only what is visible from one side.
    View,
    /// Smooth local bulges (of the SHREC 2010 robustness set, not of the paper's).
    LocalScale,
    /// A random similarity transform and large holes.
    SimilarityHoles,
    /// A random similarity transform and a range scan from one side.
    SimilarityRange,
}

impl Deformation {
    /// The paper's nine, in the order of its Table 1.
    pub const ALL: [Self; 9] = [
        Self::Affine,
        Self::Holes,
        Self::MicroHoles,
        Self::Scale,
        Self::Sampling,
        Self::Noise,
        Self::ShotNoise,
        Self::Topology,
        Self::View,
    ];

    /// The strengths, weakest first.
    pub const STRENGTHS: std::ops::RangeInclusive<u32> = 1..=5;

    /// The deformation's name in tables and file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Affine => "affine",
            Self::Holes => "holes",
            Self::MicroHoles => "micro_holes",
            Self::Scale => "scale",
            Self::Sampling => "sampling",
            Self::Noise => "noise",
            Self::ShotNoise => "shot_noise",
            Self::Topology => "topology",
            Self::View => "view",
            Self::LocalScale => "local_scale",
            Self::SimilarityHoles => "similarity_holes",
            Self::SimilarityRange => "similarity_range",
        }
    }

    /// Deforms a null shape. The same arguments give the same mesh; different deformations and strengths draw
    /// independent random numbers from one seed.
    pub fn apply(self, null: &TriangleSoup, strength: u32, seed: u64) -> TriangleSoup {
        let strength = strength.clamp(1, 5);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(self as u64 * 8 + u64::from(strength));
        match self {
            Self::Affine => vertices::affine(null, strength, &mut rng),
            Self::Holes => holes::big(null, strength, &mut rng),
            Self::MicroHoles => holes::micro(null, strength, &mut rng),
            Self::Scale => vertices::scale(null, strength),
            Self::Sampling => sampling::down_sample(null, strength),
            Self::Noise => vertices::noise(null, strength, &mut rng),
            Self::ShotNoise => vertices::shot_noise(null, strength, &mut rng),
            Self::Topology => topology::weld(null, strength, &mut rng),
            Self::View => view::visible(null, strength, &mut rng),
            Self::LocalScale => local_scale::bulge(null, strength, &mut rng),
            Self::SimilarityHoles => {
                similarity::similarity(&holes::similarity_holes(null, strength, &mut rng), &mut rng)
            }
            Self::SimilarityRange => similarity::similarity(&range_scan::scan(null, &mut rng), &mut rng),
        }
    }
}
