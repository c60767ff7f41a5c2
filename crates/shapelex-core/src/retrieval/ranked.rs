//! Classes and shapes in their order, whichever method ranked them.

use crate::ranking::ClassScore;

/// A class, best first.
#[derive(Clone, Debug, PartialEq)]
pub struct RankedClass {
    /// Its label in the index.
    pub label: String,
    /// What people call it.
    pub name: String,
    /// What the ranking is ordered by, ascending.
    pub score: f64,
    /// (score of the next class − score) / score of the next class; `None` for the last.
    pub margin: Option<f64>,
    /// The share of held-out training shapes of the class that score no better; `None` where that is not known.
    pub p_value: Option<f64>,
    /// The errors of sparse coding; `None` where a baseline ranked.
    pub coded: Option<ClassScore>,
}

/// A training shape, best first.
#[derive(Clone, Debug, PartialEq)]
pub struct RankedShape {
    /// Its class's label in the index.
    pub class: String,
    /// Its label in the index.
    pub label: String,
    /// What the ranking is ordered by, ascending.
    pub score: f64,
    /// ‖S − DA‖_F (Eq. 5); `None` where a baseline ranked.
    pub frobenius_error: Option<f64>,
}
