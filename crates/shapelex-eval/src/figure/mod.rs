//! Figures of results as SVG text: plain data in, one `String` out. Nothing is read, written or timed here.
//!
//! Text stays text, so a figure can be searched and read aloud; it carries its title and a description. Colours are
//! told apart by colour-blind readers (Okabe and Ito 2008 for series, cividis for values) and series differ in their
//! marks too.

pub mod accuracy;
mod axes;
pub mod bars;
mod canvas;
pub mod cost;
pub mod coverage;
pub mod embedding;
pub mod error;
pub mod evaluation;
mod extent;
pub mod gallery;
pub mod heat_map;
pub mod histogram;
mod lines;
pub mod mds;
mod palette;
pub mod precision_recall;
mod render;
pub mod results;
mod ticks;
mod vector;
mod visibility;

pub use accuracy::{ClassAccuracy, class_accuracy};
pub use bars::{Bar, bars};
pub use cost::{CostAxes, PowerLaw, cost_curves, fit_power_law};
pub use coverage::coverage;
pub use embedding::{EmbeddedPoint, embedding};
pub use error::FigureError;
pub use evaluation::{WorstQuery, evaluation_figures, open_set_figure, retrieval_figure, worst_queries};
pub use gallery::{GalleryRow, RowView, as_large_as, gallery};
pub use heat_map::{HeatMap, heat_map};
pub use histogram::{Histogram, HistogramPanel, histograms};
pub use mds::{Embedding, between_classes, classical_mds};
pub use precision_recall::precision_recall;
pub use results::{Sheet, benchmark_figures, deformation_gallery};

/// A named series of points (x, y).
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What the legend calls it.
    pub label: String,
    /// The points, in the order they are joined.
    pub points: Vec<(f64, f64)>,
}
