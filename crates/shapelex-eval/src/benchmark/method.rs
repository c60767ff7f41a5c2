//! The methods a benchmark compares, and their names.

use shapelex_core::parameters::Preset;
use shapelex_core::signature::Descriptor;

/// A method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Sparse coding with a preset: `default`, `robust`, `fast`, `paper`.
    Coding(Preset),
    /// Shape DNA of 13 eigenvalues of a surface of unit area; divided by the first of them where relative.
    ShapeDna {
        /// Whether it is.
        relative: bool,
    },
    /// Signature Distance Distribution.
    SignatureDistances(Descriptor),
    /// Bag of 64 words.
    BagOfWords(Descriptor),
}

impl Method {
    /// All of them, in the order of the tables.
    pub const ALL: [Self; 12] = [
        Self::Coding(Preset::Default),
        Self::Coding(Preset::Robust),
        Self::Coding(Preset::Fast),
        Self::Coding(Preset::Paper),
        Self::ShapeDna { relative: false },
        Self::ShapeDna { relative: true },
        Self::SignatureDistances(Descriptor::Wks),
        Self::SignatureDistances(Descriptor::Hks),
        Self::SignatureDistances(Descriptor::SiHks),
        Self::BagOfWords(Descriptor::Wks),
        Self::BagOfWords(Descriptor::Hks),
        Self::BagOfWords(Descriptor::SiHks),
    ];

    /// The method's name in tables, files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Coding(Preset::Default) => "default",
            Self::Coding(Preset::Robust) => "robust",
            Self::Coding(Preset::Fast) => "fast",
            Self::Coding(Preset::Paper) => "paper",
            Self::ShapeDna { relative: false } => "shape_dna",
            Self::ShapeDna { relative: true } => "shape_dna_relative",
            Self::SignatureDistances(Descriptor::Wks) => "sdd_wks",
            Self::SignatureDistances(Descriptor::Hks) => "sdd_hks",
            Self::SignatureDistances(Descriptor::SiHks) => "sdd_si_hks",
            Self::BagOfWords(Descriptor::Wks) => "bow_wks",
            Self::BagOfWords(Descriptor::Hks) => "bow_hks",
            Self::BagOfWords(Descriptor::SiHks) => "bow_si_hks",
        }
    }

    /// The method of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.name() == name)
    }
}
