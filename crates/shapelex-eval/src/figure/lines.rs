//! Charts of lines with a legend.

use super::FigureError;
use super::axes::{Axis, Plot, legend, legend_height, legend_width, mark, path};
use super::canvas::draw;

/// Width and height of the plot, in pixels.
const PLOT: (f64, f64) = (440.0, 360.0);
/// Where the plot begins below the title, in pixels.
const TOP: f64 = 56.0;

/// A line, in drawn units.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Line {
    /// The points that are joined.
    pub points: Vec<(i32, i32)>,
    /// The points that are marked.
    pub marks: Vec<(i32, i32)>,
}

/// Draws named lines over a level and an upright axis. `lines` places them in the plot.
///
/// # Errors
/// [`FigureError::Drawing`].
pub(super) fn line_chart(
    title: &str,
    description: &str,
    (x, y): (Axis, Axis),
    lines: &dyn Fn(&Plot) -> Vec<(String, Line)>,
) -> Result<String, FigureError> {
    let left = 16.0 + y.width();
    let below = x.height();
    let plot = Plot {
        at: (left, TOP),
        size: PLOT,
        x,
        y,
    };
    let lines = lines(&plot);
    let labels: Vec<String> = lines.iter().map(|(label, _)| label.clone()).collect();
    let width = left + PLOT.0 + legend_width(&labels) + 16.0;
    let height = (TOP + PLOT.1 + below).max(TOP + legend_height(&labels)) + 16.0;
    draw(title, description, (width, height), |root| {
        plot.draw(root)?;
        for (i, (_, line)) in lines.iter().enumerate() {
            path(root, line.points.clone(), i, 1.8)?;
            for &at in &line.marks {
                mark(root, at, i)?;
            }
        }
        legend(root, &labels, (left + PLOT.0 + 24.0, TOP + 12.0), true)
    })
}
