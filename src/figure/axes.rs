//! Axes, marks and legends, which the charts share.

use super::FigureError;
use super::canvas::{self, Area, font, px, size, stroke};
use super::palette::{FAINT, INK, series};
use plotters::chart::ChartContext;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::element::{PathElement, Polygon};
use plotters::prelude::SVGBackend;
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

/// Radius of a mark, in pixels.
const MARK: f64 = 4.0;
/// Distance of two lines of a legend, in pixels.
const LEGEND_LINE: f64 = 20.0;

/// One axis of a chart.
pub(super) struct Axis<'a> {
    /// What is measured, with its unit.
    pub label: &'a str,
    /// Ticks aimed at.
    pub ticks: usize,
    /// How a value is written.
    pub format: &'a dyn Fn(&f64) -> String,
}

/// Draws grid, axes, ticks and the axes' labels.
pub(super) fn mesh<X, Y>(
    chart: &mut ChartContext<'_, SVGBackend<'_>, Cartesian2d<X, Y>>,
    x: &Axis<'_>,
    y: &Axis<'_>,
) -> Result<(), FigureError>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let text = font(12.0, INK, HPos::Center, VPos::Center);
    let mut style = chart.configure_mesh();
    style
        .bold_line_style(stroke(0.75, FAINT))
        .light_line_style(FAINT.mix(0.0))
        .axis_style(stroke(1.0, INK))
        .set_all_tick_mark_size(size(4.0))
        .label_style(text.clone())
        .axis_desc_style(font(13.0, INK, HPos::Center, VPos::Center))
        .x_labels(x.ticks)
        .y_labels(y.ticks)
        .x_label_formatter(x.format)
        .y_label_formatter(y.format);
    if !x.label.is_empty() {
        style.x_desc(x.label);
    }
    if !y.label.is_empty() {
        style.y_desc(y.label);
    }
    Ok(style.draw()?)
}

/// Joins points given in drawn units.
pub(super) fn path(
    area: &Area<'_>,
    points: Vec<(i32, i32)>,
    i: usize,
    width: f64,
) -> Result<(), FigureError> {
    Ok(area.draw(&PathElement::new(points, stroke(width, series(i))))?)
}

/// The mark of the i-th series at a place in drawn units: discs, squares, triangles … so that colour is not needed.
pub(super) fn mark(area: &Area<'_>, (x, y): (i32, i32), i: usize) -> Result<(), FigureError> {
    let (sides, turn, radius) = match i % 8 {
        0 => (24, 0.0, 1.0),
        1 => (4, 0.5, 1.25),
        2 => (3, 0.75, 1.35),
        3 => (4, 0.0, 1.35),
        4 => (3, 0.25, 1.35),
        5 => (5, 0.75, 1.2),
        6 => (6, 0.0, 1.15),
        _ => (3, 0.5, 1.35),
    };
    let quarter = if turn == 0.5 { 0.125 } else { turn };
    let corners = (0..sides)
        .map(|k| {
            let angle = std::f64::consts::TAU * (f64::from(k) / f64::from(sides) + quarter);
            let r = radius * MARK;
            (x + px(r * angle.cos()), y + px(r * angle.sin()))
        })
        .collect::<Vec<_>>();
    Ok(area.draw(&Polygon::new(corners, series(i).filled()))?)
}

/// Names the series, one below the other from a place in pixels; `lines` where they are drawn as lines.
pub(super) fn legend(
    area: &Area<'_>,
    labels: &[String],
    (x, y): (f64, f64),
    lines: bool,
) -> Result<(), FigureError> {
    let text = font(12.5, INK, HPos::Left, VPos::Center);
    for (i, name) in labels.iter().enumerate() {
        let y = y + LEGEND_LINE * i as f64;
        if lines {
            path(area, vec![(px(x), px(y)), (px(x + 26.0), px(y))], i, 2.0)?;
        }
        mark(area, (px(x + 13.0), px(y)), i)?;
        canvas::write(area, &canvas::label(name), (x + 34.0, y), &text)?;
    }
    Ok(())
}
