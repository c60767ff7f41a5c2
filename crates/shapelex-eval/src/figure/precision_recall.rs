//! Precision–recall curves of several methods.

use super::axes::Axis;
use super::lines::{Line, line_chart};
use super::ticks::Quantity;
use super::{FigureError, Series};

/// Marks along a curve.
const MARKS: usize = 6;

/// Draws precision over recall, both shares from 0 to 1, one line per method. Points have (recall, precision); what is
/// not finite is left out.
///
/// # Errors
/// [`FigureError::Empty`] without series.
pub fn precision_recall(title: &str, methods: &[Series]) -> Result<String, FigureError> {
    if methods.is_empty() {
        return Err(FigureError::Empty {
            what: "precision-recall curves",
        });
    }
    let names: Vec<&str> = methods.iter().map(|s| s.label.as_str()).collect();
    let description = format!("Precision over recall for {}.", names.join(", "));
    let x = Axis::linear(
        "recall (share of the relevant found)",
        (0.0, 1.0),
        5,
        Quantity::Share,
    );
    let y = Axis::linear(
        "precision (share of the found relevant)",
        (0.0, 1.02),
        5,
        Quantity::Share,
    );
    line_chart(title, &description, (x, y), &|plot| {
        methods
            .iter()
            .map(|series| {
                let points: Vec<(i32, i32)> = series
                    .points
                    .iter()
                    .filter(|(r, p)| r.is_finite() && p.is_finite())
                    .map(|&(r, p)| plot.place((r.clamp(0.0, 1.0), p.clamp(0.0, 1.0))))
                    .collect();
                let every = (points.len() / MARKS).max(1);
                let marks = points.iter().copied().step_by(every).collect();
                (series.label.clone(), Line { points, marks })
            })
            .collect()
    })
}
