//! A matrix as a labelled heat map (the paper's Figure 5; confusion matrices).

use super::FigureError;
use super::canvas::{self, Area, draw, fill, font, label, number, upwards};
use super::extent::{text_width, widest};
use super::palette::{INK, MUTED, ink_on, sequential};
use super::ticks::{Quantity, Tick, linear};
use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, VPos};

/// Matrices with more rows or columns show colours only.
const WRITTEN: usize = 24;
/// Sizes of the axes' titles and of the colour bar, in pixels.
const AXIS: f64 = 13.0;
const BAR_HEIGHT: f64 = 200.0;
const BAR_TEXT: f64 = 11.5;
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
    /// What is written into the cells; the values themselves where it is left out.
    pub texts: Option<&'a [Vec<String>]>,
    /// Whether the values are shares: the colours go from 0 to 100 % then, whatever the values are.
    pub shares: bool,
}

/// Draws a cell per value, dark blue for the least and yellow for the greatest, its number written into it where there
/// is room, and a bar that says what the colours mean.
///
/// # Errors
/// [`FigureError::Empty`] without a finite value; [`FigureError::Shape`] where names and values do not fit.
pub fn heat_map(title: &str, map: &HeatMap<'_>) -> Result<String, FigureError> {
    check(map)?;
    let range = range(map)?;
    let layout = Layout::of(map, range);
    let description = format!(
        "{} for each {} (rows) and {} (columns), from {} to {}.",
        map.value,
        map.row_axis,
        map.column_axis,
        number(range.0),
        number(range.1)
    );
    draw(title, &description, layout.size, |root| {
        names(root, map, &layout)?;
        cells(root, map, &layout, range)?;
        let beside = (layout.left + layout.across + 28.0, layout.top);
        bar(root, beside, &layout.bar_ticks, range, map.value)
    })
}

fn check(map: &HeatMap<'_>) -> Result<(), FigureError> {
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
    fits("rows", map.rows.len(), map.values.len())?;
    for row in map.values {
        fits("columns", map.columns.len(), row.len())?;
    }
    if let Some(texts) = map.texts {
        fits("rows of texts", map.rows.len(), texts.len())?;
        for row in texts {
            fits("columns of texts", map.columns.len(), row.len())?;
        }
    }
    Ok(())
}

/// What the darkest and the brightest colour stand for.
fn range(map: &HeatMap<'_>) -> Result<(f64, f64), FigureError> {
    let finite = || map.values.iter().flatten().copied().filter(|v| v.is_finite());
    let least = finite().fold(f64::INFINITY, f64::min);
    let greatest = finite().fold(f64::NEG_INFINITY, f64::max);
    if least > greatest {
        return Err(FigureError::Empty { what: "values" });
    }
    Ok(if map.shares { (0.0, 1.0) } else { (least, greatest) })
}

/// Where a value lies in a range, 0 to 1.
fn share(v: f64, (least, greatest): (f64, f64)) -> f64 {
    if greatest > least {
        (v - least) / (greatest - least)
    } else {
        0.5
    }
}

/// Places in pixels.
struct Layout {
    cell: f64,
    name_size: f64,
    left: f64,
    top: f64,
    across: f64,
    down: f64,
    size: (f64, f64),
    bar_ticks: Vec<Tick>,
}

impl Layout {
    fn of(map: &HeatMap<'_>, range: (f64, f64)) -> Self {
        let (r, c) = (map.rows.len(), map.columns.len());
        let longest = |names: &[String], size: f64| {
            let names: Vec<String> = names.iter().map(|n| label(n)).collect();
            widest(names.iter().map(String::as_str), size, 24.0)
        };
        let cell = (720.0 / r.max(c) as f64).clamp(6.0, 48.0);
        let name_size = (cell * 0.75).min(12.0);
        let (across, down) = (cell * c as f64, cell * r as f64);
        // The axes' titles are centred on the cells, which may be fewer than they need.
        let aside = |title: &str, cells: f64| (text_width(title, AXIS) - cells).max(0.0) / 2.0;
        let left = 40.0 + longest(map.rows, name_size).max(aside(map.column_axis, across));
        let top = 76.0 + longest(map.columns, name_size).max(aside(map.row_axis, down) - 40.0);
        let bar_ticks = if map.shares {
            linear(range, 5, Quantity::Share)
        } else if map
            .values
            .iter()
            .flatten()
            .all(|v| !v.is_finite() || is_count(*v))
        {
            linear(range, 5, Quantity::Count)
        } else {
            linear(range, 5, Quantity::Real)
        };
        let bar_texts = widest(bar_ticks.iter().map(|t| t.text.as_str()), BAR_TEXT, 0.0);
        let beside = 28.0 + 22.0 + bar_texts + 30.0;
        let width = left + across + beside.max(aside(map.column_axis, across) + 8.0);
        let bar = BAR_HEIGHT.max(text_width(map.value, 12.0) + 8.0);
        let height = top + (down + aside(map.row_axis, down)).max(bar) + 24.0;
        Self {
            cell,
            name_size,
            left,
            top,
            across,
            down,
            size: (width.max(360.0), height),
            bar_ticks,
        }
    }
}

fn is_count(v: f64) -> bool {
    v == v.round() && v.abs() < 1e6
}

/// Writes the names of rows and columns, and of the axes.
fn names(root: &Area<'_>, map: &HeatMap<'_>, at: &Layout) -> Result<(), FigureError> {
    let right = font(at.name_size, INK, HPos::Right, VPos::Center);
    let up = upwards(&font(at.name_size, INK, HPos::Left, VPos::Center));
    for (i, name) in map.rows.iter().enumerate() {
        let y = at.top + at.cell * (i as f64 + 0.5);
        canvas::write(root, &label(name), (at.left - 8.0, y), &right)?;
    }
    for (j, name) in map.columns.iter().enumerate() {
        let x = at.left + at.cell * (j as f64 + 0.5);
        canvas::write(root, &label(name), (x, at.top - 8.0), &up)?;
    }
    let axis = font(AXIS, MUTED, HPos::Center, VPos::Center);
    canvas::write(root, map.column_axis, (at.left + at.across / 2.0, 54.0), &axis)?;
    canvas::write(
        root,
        map.row_axis,
        (14.0, at.top + at.down / 2.0),
        &upwards(&axis),
    )
}

/// Fills the cells and writes into them where there is room.
fn cells(root: &Area<'_>, map: &HeatMap<'_>, at: &Layout, range: (f64, f64)) -> Result<(), FigureError> {
    let finite = || map.values.iter().flatten().filter(|v| v.is_finite());
    let whole = finite().all(|v| is_count(*v));
    let written = map.rows.len().max(map.columns.len()) <= WRITTEN;
    // A hair's breadth of white between the cells, unless they are tiny.
    let gap = if at.cell > 10.0 { 1.0 } else { 0.0 };
    let side = at.cell - gap;
    for (i, row) in map.values.iter().enumerate() {
        for (j, &v) in row.iter().enumerate() {
            let colour = if v.is_finite() {
                sequential(share(v, range))
            } else {
                MISSING
            };
            let corner = (at.left + at.cell * j as f64, at.top + at.cell * i as f64);
            fill(root, corner, (side, side), colour)?;
            if !written {
                continue;
            }
            let text = match (map.texts, v.is_finite()) {
                (Some(texts), _) => texts[i][j].clone(),
                (None, true) if whole => format!("{v:.0}"),
                (None, true) => cell_text(v, range.1 - range.0),
                (None, false) => "–".to_owned(),
            };
            if text.is_empty() {
                continue;
            }
            let fitting = side * 0.9 / text_width(&text, 1.0).max(1e-9);
            let style = font(
                (at.cell * 0.25).min(fitting),
                ink_on(colour),
                HPos::Center,
                VPos::Center,
            );
            canvas::write(
                root,
                &text,
                (corner.0 + side / 2.0, corner.1 + side / 2.0),
                &style,
            )?;
        }
    }
    Ok(())
}

/// A number with as many decimals as tell a hundredth of the range.
fn cell_text(v: f64, range: f64) -> String {
    let decimals = (2.0 - range.max(f64::MIN_POSITIVE).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{v:.decimals$}")
}

/// The colour bar, from the greatest at the top to the least.
fn bar(
    root: &Area<'_>,
    (x, y): (f64, f64),
    ticks: &[Tick],
    range: (f64, f64),
    what: &str,
) -> Result<(), FigureError> {
    const STEPS: usize = 60;
    for k in 0..STEPS {
        let from = y + BAR_HEIGHT * k as f64 / STEPS as f64;
        let colour = sequential(1.0 - (k as f64 + 0.5) / STEPS as f64);
        fill(root, (x, from), (14.0, BAR_HEIGHT / STEPS as f64 + 0.25), colour)?;
    }
    let text = font(BAR_TEXT, INK, HPos::Left, VPos::Center);
    for tick in ticks {
        let at = y + BAR_HEIGHT * (1.0 - share(tick.at, range));
        canvas::line(root, &[(x + 14.0, at), (x + 18.0, at)], 1.0, INK)?;
        canvas::write(root, &tick.text, (x + 22.0, at), &text)?;
    }
    let side = upwards(&font(12.0, MUTED, HPos::Center, VPos::Center));
    let beside = widest(ticks.iter().map(|t| t.text.as_str()), BAR_TEXT, 0.0);
    let middle = y + BAR_HEIGHT.max(text_width(what, 12.0)) / 2.0;
    canvas::write(root, what, (x + 22.0 + beside + 14.0, middle), &side)
}
