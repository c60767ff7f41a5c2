//! Axes, marks and legends, which the charts share.

use super::FigureError;
use super::canvas::{self, Area, font, px, upwards};
use super::extent::{text_width, widest};
use super::palette::{FAINT, INK, series};
use super::ticks::{Quantity, Tick, linear, logarithmic};
use plotters::element::{PathElement, Polygon};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

/// Radius of a mark, in pixels.
const MARK: f64 = 4.0;
/// Distance of two lines of a legend, in pixels.
const LEGEND_LINE: f64 = 20.0;
/// Sizes of the texts, in pixels.
const TICK: f64 = 12.0;
const TITLE: f64 = 13.0;
const LEGEND: f64 = 12.5;
/// Length of a legend's line with the gap to its text, in pixels.
const LEGEND_SAMPLE: f64 = 34.0;

/// How values become places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scale {
    Linear,
    Logarithmic,
}

/// One axis of a chart.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    label: String,
    range: (f64, f64),
    scale: Scale,
    ticks: Vec<Tick>,
}

impl Axis {
    /// A linear axis. `label` says what is measured, with its unit; it may be empty.
    pub(super) fn linear(label: &str, range: (f64, f64), aim: usize, quantity: Quantity) -> Self {
        Self {
            label: label.to_owned(),
            range,
            scale: Scale::Linear,
            ticks: linear(range, aim, quantity),
        }
    }

    /// A logarithmic axis over a range above 0.
    pub(super) fn logarithmic(label: &str, range: (f64, f64), aim: usize) -> Self {
        Self {
            label: label.to_owned(),
            range,
            scale: Scale::Logarithmic,
            ticks: logarithmic(range, aim),
        }
    }

    /// Where a value lies, 0 at the axis' beginning and 1 at its end.
    fn share(&self, value: f64) -> f64 {
        let (low, high) = self.range;
        match self.scale {
            Scale::Linear => (value - low) / (high - low),
            Scale::Logarithmic => (value / low).ln() / (high / low).ln(),
        }
    }

    /// Pixels that ticks and label take to the left of an upright axis.
    pub(super) fn width(&self) -> f64 {
        let ticks = widest(self.ticks.iter().map(|t| t.text.as_str()), TICK, 0.0);
        ticks + 10.0 + if self.label.is_empty() { 0.0 } else { TITLE + 12.0 }
    }

    /// Pixels that ticks and label take below a level axis.
    pub(super) fn height(&self) -> f64 {
        TICK + 12.0 + if self.label.is_empty() { 0.0 } else { TITLE + 8.0 }
    }
}

/// Where the data are drawn, in pixels, and what its axes say.
#[derive(Clone, Debug)]
pub(super) struct Plot {
    /// Left and upper edge.
    pub at: (f64, f64),
    /// Width and height.
    pub size: (f64, f64),
    /// The level axis.
    pub x: Axis,
    /// The upright axis.
    pub y: Axis,
}

impl Plot {
    /// The place of a point, in drawn units.
    pub(super) fn place(&self, (x, y): (f64, f64)) -> (i32, i32) {
        let (x, y) = self.pixel((x, y));
        (px(x), px(y))
    }

    /// The place of a point, in pixels.
    pub(super) fn pixel(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (
            self.at.0 + self.size.0 * self.x.share(x),
            self.at.1 + self.size.1 * (1.0 - self.y.share(y)),
        )
    }

    /// Draws grid, axes, ticks and the axes' labels.
    pub(super) fn draw(&self, area: &Area<'_>) -> Result<(), FigureError> {
        let ((left, top), (width, height)) = (self.at, self.size);
        let (right, bottom) = (left + width, top + height);
        let text = font(TICK, INK, HPos::Center, VPos::Center);
        for tick in &self.x.ticks {
            let x = left + width * self.x.share(tick.at);
            canvas::line(area, &[(x, top), (x, bottom)], 0.75, FAINT)?;
            canvas::line(area, &[(x, bottom), (x, bottom + 4.0)], 1.0, INK)?;
            canvas::write(area, &tick.text, (x, bottom + 4.0 + TICK), &text)?;
        }
        let text = font(TICK, INK, HPos::Right, VPos::Center);
        for tick in &self.y.ticks {
            let y = top + height * (1.0 - self.y.share(tick.at));
            canvas::line(area, &[(left, y), (right, y)], 0.75, FAINT)?;
            canvas::line(area, &[(left - 4.0, y), (left, y)], 1.0, INK)?;
            canvas::write(area, &tick.text, (left - 7.0, y), &text)?;
        }
        canvas::line(area, &[(left, top), (left, bottom), (right, bottom)], 1.0, INK)?;
        let title = font(TITLE, INK, HPos::Center, VPos::Center);
        if !self.x.label.is_empty() {
            let below = bottom + self.x.height() - TITLE / 2.0;
            canvas::write(area, &self.x.label, (left + width / 2.0, below), &title)?;
        }
        if !self.y.label.is_empty() {
            let beside = left - self.y.width() + TITLE / 2.0;
            canvas::write(
                area,
                &self.y.label,
                (beside, top + height / 2.0),
                &upwards(&title),
            )?;
        }
        Ok(())
    }
}

/// Joins points given in drawn units.
pub(super) fn path(
    area: &Area<'_>,
    points: Vec<(i32, i32)>,
    i: usize,
    width: f64,
) -> Result<(), FigureError> {
    Ok(area.draw(&PathElement::new(points, canvas::stroke(width, series(i))))?)
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

/// Pixels that a legend takes, with the gap to what stands before it.
pub(super) fn legend_width(labels: &[String]) -> f64 {
    36.0 + LEGEND_SAMPLE + labels.iter().map(|l| text_width(l, LEGEND)).fold(0.0, f64::max)
}

/// Names the series, one below the other from a place in pixels; `lines` where they are drawn as lines.
pub(super) fn legend(
    area: &Area<'_>,
    labels: &[String],
    (x, y): (f64, f64),
    lines: bool,
) -> Result<(), FigureError> {
    let text = font(LEGEND, INK, HPos::Left, VPos::Center);
    for (i, name) in labels.iter().enumerate() {
        let y = y + LEGEND_LINE * i as f64;
        if lines {
            path(area, vec![(px(x), px(y)), (px(x + 26.0), px(y))], i, 2.0)?;
        }
        mark(area, (px(x + 13.0), px(y)), i)?;
        canvas::write(area, name, (x + LEGEND_SAMPLE, y), &text)?;
    }
    Ok(())
}

/// Height a legend needs, in pixels.
pub(super) fn legend_height(labels: &[String]) -> f64 {
    LEGEND_LINE * labels.len() as f64
}
