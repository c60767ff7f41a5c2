//! Precision–recall curves of several methods.

use super::axes::{Axis, legend, mark, mesh, path};
use super::canvas::{draw, size};
use super::{FigureError, Series};
use plotters::chart::ChartBuilder;

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
    let description = format!(
        "Precision over recall for {}.",
        methods
            .iter()
            .map(|s| s.label.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    );
    draw(title, &description, (760.0, 480.0), |root| {
        let area = root.margin(size(48.0), size(16.0), size(16.0), size(240.0));
        let mut chart = ChartBuilder::on(&area)
            .x_label_area_size(size(46.0))
            .y_label_area_size(size(58.0))
            .margin_right(size(12.0))
            .build_cartesian_2d(0.0..1.0, 0.0..1.02)?;
        let share = |v: &f64| format!("{v:.1}");
        let axis = |label| Axis {
            label,
            ticks: 6,
            format: &share,
        };
        mesh(
            &mut chart,
            &axis("recall (share of the relevant found)"),
            &axis("precision (share of the found relevant)"),
        )?;
        for (i, series) in methods.iter().enumerate() {
            let points: Vec<(i32, i32)> = series
                .points
                .iter()
                .filter(|(r, p)| r.is_finite() && p.is_finite())
                .map(|&(r, p)| chart.backend_coord(&(r.clamp(0.0, 1.0), p.clamp(0.0, 1.0))))
                .collect();
            let every = (points.len() / 6).max(1);
            let marked: Vec<(i32, i32)> = points.iter().copied().step_by(every).collect();
            path(root, points, i, 1.8)?;
            for at in marked {
                mark(root, at, i)?;
            }
        }
        let labels: Vec<String> = methods.iter().map(|s| s.label.clone()).collect();
        legend(root, &labels, (540.0, 70.0), true)
    })
}
