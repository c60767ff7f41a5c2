//! Whether sets of possible classes hold what they promise: coverage against level.

use super::axes::Axis;
use super::lines::{Line, line_chart};
use super::ticks::Quantity;
use super::{FigureError, Series};

/// Draws shares over the coverage that is promised, 1 − level, with the diagonal that a promise kept lies on. Points have
/// (promised, measured), both from 0 to 1.
///
/// # Errors
/// [`FigureError::Empty`] without points.
pub fn coverage(title: &str, measured: &[Series]) -> Result<String, FigureError> {
    let all = || measured.iter().flat_map(|s| &s.points);
    if all().next().is_none() {
        return Err(FigureError::Empty { what: "levels" });
    }
    let least = all().map(|p| p.0.min(p.1)).fold(1.0, f64::min).max(0.0);
    let low = ((least * 10.0 - 1e-9).floor() / 10.0).clamp(0.0, 0.9);
    let names: Vec<&str> = measured.iter().map(|s| s.label.as_str()).collect();
    let description = format!("Over the promised coverage: {}.", names.join("; "));
    let x = Axis::linear("promised coverage (1 − level)", (low, 1.0), 5, Quantity::Share);
    let y = Axis::linear("share of the queries", (low, 1.005), 5, Quantity::Share);
    let promise = Series {
        label: "as promised".to_owned(),
        points: vec![(low, low), (1.0, 1.0)],
    };
    line_chart(title, &description, (x, y), &|plot| {
        measured
            .iter()
            .chain([&promise])
            .enumerate()
            .map(|(i, series)| {
                let points: Vec<(i32, i32)> = series.points.iter().map(|&p| plot.place(p)).collect();
                let marks = if i < measured.len() {
                    points.clone()
                } else {
                    Vec::new()
                };
                (series.label.clone(), Line { points, marks })
            })
            .collect()
    })
}
