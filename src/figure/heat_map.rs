//! A matrix as a labelled heat map (the paper's Figure 5; confusion matrices).

use super::FigureError;
use super::canvas::{self, draw, fill, font, label, number, text_width, upwards};
use super::palette::{INK, MUTED, ink_on, sequential};
use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, VPos};

/// Matrices with more rows or columns show colours only.
const WRITTEN: usize = 24;
/// Colour of a value that is missing.
const MISSING: RGBColor = RGBColor(235, 235, 235);

/// A matrix and what it says.
#[derive(Clone, Debug, PartialEq)]
pub struct HeatMap<'a> {
    /// What the rows are, such as `class of the query`.
    pub row_axis: &'a str,
    /// What the columns are.
    pub column_axis: &'a str,
    /// What the values are, with their unit.
    pub value: &'a str,
    /// One name per row.
    pub rows: &'a [String],
    /// One name per column.
    pub columns: &'a [String],
    /// Rows of values; one that is not finite is missing.
    pub values: &'a [Vec<f64>],
}

/// Draws a cell per value, dark blue for the least and yellow for the greatest, its number written into it where there
/// is room, and a bar that says what the colours mean.
///
/// # Errors
/// [`FigureError::Empty`] without a finite value; [`FigureError::Shape`] where names and values do not fit.
pub fn heat_map(title: &str, map: &HeatMap<'_>) -> Result<String, FigureError> {
    let (r, c) = (map.rows.len(), map.columns.len());
    let fits = |what, expected: usize, found: usize| {
        if expected == found {
            Ok(())
        } else {
            Err(FigureError::Shape {
                what,
                expected,
                found,
            })
        }
    };
    fits("rows", r, map.values.len())?;
    for row in map.values {
        fits("columns", c, row.len())?;
    }
    let finite = || map.values.iter().flatten().copied().filter(|v| v.is_finite());
    let least = finite().fold(f64::INFINITY, f64::min);
    let greatest = finite().fold(f64::NEG_INFINITY, f64::max);
    if least > greatest {
        return Err(FigureError::Empty { what: "values" });
    }
    let share = |v: f64| {
        if greatest > least {
            (v - least) / (greatest - least)
        } else {
            0.5
        }
    };
    let longest = |names: &[String]| {
        names
            .iter()
            .map(|n| text_width(&label(n), 12.0))
            .fold(24.0, f64::max)
    };
    let cell = (720.0 / r.max(c) as f64).clamp(6.0, 48.0);
    let name_size = (cell * 0.75).min(12.0);
    let (left, top) = (40.0 + longest(map.rows), 76.0 + longest(map.columns));
    let (across, down) = (cell * c as f64, cell * r as f64);
    let width = (left + across + 130.0).max(420.0);
    let height = (top + down + 24.0).max(320.0);
    let description = format!(
        "{} for each {} (rows) and {} (columns), from {} to {}.",
        map.value,
        map.row_axis,
        map.column_axis,
        number(least),
        number(greatest)
    );
    draw(title, &description, (width, height), |root| {
        let right = font(name_size, INK, HPos::Right, VPos::Center);
        let up = upwards(&font(name_size, INK, HPos::Left, VPos::Center));
        for (i, name) in map.rows.iter().enumerate() {
            let y = top + cell * (i as f64 + 0.5);
            canvas::write(root, &label(name), (left - 8.0, y), &right)?;
        }
        for (j, name) in map.columns.iter().enumerate() {
            let x = left + cell * (j as f64 + 0.5);
            canvas::write(root, &label(name), (x, top - 8.0), &up)?;
        }
        let axis = font(13.0, MUTED, HPos::Center, VPos::Center);
        canvas::write(root, map.column_axis, (left + across / 2.0, 54.0), &axis)?;
        canvas::write(root, map.row_axis, (14.0, top + down / 2.0), &upwards(&axis))?;
        let whole = finite().all(|v| v == v.round() && v.abs() < 1e6);
        let written = r.max(c) <= WRITTEN;
        for (i, row) in map.values.iter().enumerate() {
            for (j, &v) in row.iter().enumerate() {
                let colour = if v.is_finite() {
                    sequential(share(v))
                } else {
                    MISSING
                };
                let at = (left + cell * j as f64, top + cell * i as f64);
                // A hair's breadth of white between the cells, unless they are tiny.
                let gap = if cell > 10.0 { 1.0 } else { 0.0 };
                fill(root, at, (cell - gap, cell - gap), colour)?;
                if written {
                    let style = font(cell * 0.25, ink_on(colour), HPos::Center, VPos::Center);
                    let text = match v.is_finite() {
                        true if whole => format!("{v:.0}"),
                        true => cell_text(v, greatest - least),
                        false => "–".to_owned(),
                    };
                    let middle = (at.0 + (cell - gap) / 2.0, at.1 + (cell - gap) / 2.0);
                    canvas::write(root, &text, middle, &style)?;
                }
            }
        }
        bar(root, (left + across + 28.0, top), (least, greatest), map.value)
    })
}

/// A number with as many decimals as tell a hundredth of the range.
fn cell_text(v: f64, range: f64) -> String {
    let decimals = (2.0 - range.max(f64::MIN_POSITIVE).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{v:.decimals$}")
}

/// The colour bar, from the greatest at the top to the least.
fn bar(
    root: &canvas::Area<'_>,
    (x, y): (f64, f64),
    (least, greatest): (f64, f64),
    what: &str,
) -> Result<(), FigureError> {
    const STEPS: usize = 60;
    const HEIGHT: f64 = 200.0;
    for k in 0..STEPS {
        let from = y + HEIGHT * k as f64 / STEPS as f64;
        let colour = sequential(1.0 - (k as f64 + 0.5) / STEPS as f64);
        fill(root, (x, from), (14.0, HEIGHT / STEPS as f64 + 0.25), colour)?;
    }
    let text = font(11.5, INK, HPos::Left, VPos::Center);
    for k in 0..=4 {
        let share = f64::from(k) / 4.0;
        let value = greatest + share * (least - greatest);
        let at = y + HEIGHT * share;
        canvas::line(root, &[(x + 14.0, at), (x + 18.0, at)], 1.0, INK)?;
        canvas::write(root, &number(value), (x + 22.0, at), &text)?;
    }
    let side = upwards(&font(12.0, MUTED, HPos::Center, VPos::Center));
    canvas::write(root, what, (x + 74.0, y + HEIGHT / 2.0), &side)
}
