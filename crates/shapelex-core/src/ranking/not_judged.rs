//! Why an answer, or one class of it, cannot be judged.

use std::fmt;

/// The reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotJudged {
    /// The query is a part of a shape, and only whole ones were held out.
    Open,
    /// Ranked by something else than the held-out shapes were.
    OtherMeasure,
    /// Fewer than 19 held-out shapes in all, or none of the class.
    TooFewShapes,
    /// The class was learnt from near copies of one pose, or so were all that there are enough held-out shapes of.
    NearCopies,
    /// The time limit came before all classes were compared with.
    Partial,
}

impl fmt::Display for NotJudged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Open => "the surface is open, and only whole shapes are judged",
            Self::OtherMeasure => "only rankings by the index's own measure are judged",
            Self::TooFewShapes => "too few training shapes to judge by",
            Self::NearCopies => {
                "the training shapes are near copies of one pose, which tell nothing of others"
            }
            Self::Partial => "not all classes were compared with in time",
        })
    }
}
