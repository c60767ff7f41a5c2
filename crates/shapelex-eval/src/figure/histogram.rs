//! Histograms side by side, such as the distributions of signature distances (the paper's Figure 4).

use super::FigureError;
use super::axes::{Axis, Plot};
use super::canvas::{self, Area, draw, font, label, stroke};
use super::extent::{text_width, widest};
use super::palette::{INK, MUTED, series};
use super::ticks::Quantity;
use plotters::element::{PathElement, Polygon};
use plotters::style::Color;
use plotters::style::text_anchor::{HPos, VPos};

/// A panel's width and height in pixels.
const PANEL: (f64, f64) = (250.0, 170.0);

/// One distribution.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// What it is of.
    pub label: String,
    /// Shares of equally wide bins.
    pub shares: Vec<f64>,
}

/// A panel: a histogram drawn as an area, and further ones as lines over it.
#[derive(Clone, Debug, PartialEq)]
pub struct HistogramPanel {
    /// What stands above the panel.
    pub title: String,
    /// The area.
    pub main: Histogram,
    /// The lines.
    pub others: Vec<Histogram>,
}

/// Draws a panel per entry, at most four in a row, all on the same axes: from 0 to `largest`, the upper end of the
/// last bin, and from 0 to the greatest share.
///
/// # Errors
/// [`FigureError::Empty`] without panels or bins.
pub fn histograms(
    title: &str,
    x_label: &str,
    largest: f64,
    panels: &[HistogramPanel],
) -> Result<String, FigureError> {
    let greatest = panels
        .iter()
        .flat_map(|p| std::iter::once(&p.main).chain(&p.others))
        .flat_map(|h| &h.shares)
        .copied()
        .fold(0.0, f64::max);
    if greatest <= 0.0 || largest.is_nan() || largest <= 0.0 {
        return Err(FigureError::Empty { what: "histograms" });
    }
    let columns = panels.len().min(4);
    let rows = panels.len().div_ceil(columns);
    let mut names: Vec<&str> = Vec::new();
    for other in panels.iter().flat_map(|p| &p.others) {
        if !names.contains(&other.label.as_str()) {
            names.push(&other.label);
        }
    }
    let titles = widest(panels.iter().map(|p| p.title.as_str()), 12.5, 0.0);
    let panel = (PANEL.0.max(titles + 20.0), PANEL.1);
    let width = (columns as f64 * panel.0).max(320.0) + 40.0;
    let legend_lines = legend_lines(&names, width);
    let below = 48.0 + rows as f64 * panel.1;
    let height = below + 40.0 + 20.0 * legend_lines.len() as f64;
    let said: Vec<&str> = panels.iter().map(|p| p.title.as_str()).collect();
    let description = format!("Histograms of {x_label} for {}.", said.join(", "));
    draw(title, &description, (width, height), |root| {
        for (k, one) in panels.iter().enumerate() {
            let at = (
                32.0 + (k % columns) as f64 * panel.0,
                48.0 + (k / columns) as f64 * panel.1,
            );
            draw_panel(root, one, (at, panel), (largest, greatest), &names)?;
        }
        let axis = font(13.0, INK, HPos::Center, VPos::Center);
        canvas::write(root, x_label, (width / 2.0, below + 16.0), &axis)?;
        let side = canvas::upwards(&axis);
        let middle = 48.0 + rows as f64 * panel.1 / 2.0;
        canvas::write(root, "share of the pairs", (16.0, middle), &side)?;
        let text = font(12.0, MUTED, HPos::Left, VPos::Center);
        for (l, line) in legend_lines.iter().enumerate() {
            let y = below + 42.0 + 20.0 * l as f64;
            for &(x, i) in line {
                canvas::line(root, &[(x, y), (x + 20.0, y)], 2.0, series(i + 1))?;
                canvas::write(root, &label(names[i]), (x + 26.0, y), &text)?;
            }
        }
        Ok(())
    })
}

/// Draws one panel into a box given by its corner and size in pixels; the axes end at `largest` and `greatest`.
fn draw_panel(
    root: &Area<'_>,
    panel: &HistogramPanel,
    ((left, top), (width, height)): ((f64, f64), (f64, f64)),
    (largest, greatest): (f64, f64),
    names: &[&str],
) -> Result<(), FigureError> {
    let heading = font(12.5, INK, HPos::Center, VPos::Center);
    canvas::write(
        root,
        &label(&panel.title),
        (left + width / 2.0 + 14.0, top + 10.0),
        &heading,
    )?;
    let x = Axis::linear("", (0.0, largest), 4, Quantity::Real);
    let y = Axis::linear("", (0.0, greatest * 1.05), 4, Quantity::Share);
    let plot = Plot {
        at: (left + y.width(), top + 20.0),
        size: (width - y.width() - 12.0, height - 20.0 - x.height()),
        x,
        y,
    };
    plot.draw(root)?;
    let outline = |histogram: &Histogram| -> Vec<(i32, i32)> {
        steps(&histogram.shares, largest).map(|p| plot.place(p)).collect()
    };
    let main = outline(&panel.main);
    let mut filled = vec![plot.place((0.0, 0.0))];
    filled.extend(&main);
    filled.push(plot.place((largest, 0.0)));
    root.draw(&Polygon::new(filled, series(5).mix(0.55).filled()))?;
    root.draw(&PathElement::new(main, stroke(1.0, series(0))))?;
    for other in &panel.others {
        let i = names.iter().position(|n| *n == other.label).unwrap_or(0);
        root.draw(&PathElement::new(outline(other), stroke(1.0, series(i + 1))))?;
    }
    Ok(())
}

/// The outline of a histogram.
fn steps(shares: &[f64], largest: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
    let width = largest / shares.len().max(1) as f64;
    shares
        .iter()
        .enumerate()
        .flat_map(move |(i, &y)| [(i as f64 * width, y), ((i + 1) as f64 * width, y)])
}

/// Where each name of the legend stands, line by line: x in pixels and which name.
fn legend_lines(names: &[&str], width: f64) -> Vec<Vec<(f64, usize)>> {
    let mut lines: Vec<Vec<(f64, usize)>> = Vec::new();
    let mut x = f64::INFINITY;
    for (i, name) in names.iter().enumerate() {
        let needed = 26.0 + text_width(&label(name), 12.0) + 22.0;
        if x + needed > width - 16.0 {
            lines.push(Vec::new());
            x = 40.0;
        }
        if let Some(line) = lines.last_mut() {
            line.push((x, i));
        }
        x += needed;
    }
    lines
}
