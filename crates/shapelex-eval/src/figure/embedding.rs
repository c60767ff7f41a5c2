//! Points in a plane with their names (the paper's Figure 6).

use super::FigureError;
use super::axes::{Axis, Plot, legend, legend_height, legend_width, mark};
use super::canvas::{self, UNIT, draw, font, label, number};
use super::extent::text_width;
use super::palette::{INK, series};
use super::ticks::Quantity;
use plotters::style::text_anchor::{HPos, VPos};

/// Figures with more points name groups, not points.
const NAMED: usize = 60;
/// Size of a name, in pixels.
const NAME: f64 = 12.0;
/// Width and height of the plot, in pixels.
const PLOT: (f64, f64) = (560.0, 440.0);
/// Where the plot begins below the title, in pixels.
const TOP: f64 = 56.0;

/// A point with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct EmbeddedPoint {
    /// Its name.
    pub label: String,
    /// What it belongs to; points of one group share colour and mark. Empty where there are no groups.
    pub group: String,
    /// Its place.
    pub at: (f64, f64),
}

/// Draws points on equal scales in x and y. Up to 60 points are named beside their marks, where the names cover one
/// another least; with more, or where points have groups, a legend names the groups.
///
/// # Errors
/// [`FigureError::Empty`] without points, or where one is not finite.
pub fn embedding(title: &str, unit: &str, points: &[EmbeddedPoint]) -> Result<String, FigureError> {
    let finite = points.iter().all(|p| p.at.0.is_finite() && p.at.1.is_finite());
    if points.is_empty() || !finite {
        return Err(FigureError::Empty { what: "points" });
    }
    let groups = groups(points);
    let description = format!(
        "Points in a plane, near where alike: {}.",
        points
            .iter()
            .take(NAMED)
            .map(|p| format!("{} at {}, {}", p.label, number(p.at.0), number(p.at.1)))
            .collect::<Vec<_>>()
            .join("; ")
    );
    let (x, y) = axes(points, unit);
    let named = points.len() <= NAMED;
    let longest = points
        .iter()
        .filter(|_| named)
        .map(|p| text_width(&label(&p.label), NAME));
    // A name may stand on either side of a point at the edge.
    let overhang = (longest.fold(0.0, f64::max) + 12.0 - PLOT.0 * 0.1).max(0.0);
    let left = 16.0 + y.width().max(overhang);
    let side = if groups.is_empty() {
        overhang
    } else {
        overhang + legend_width(&groups)
    };
    let height = (TOP + PLOT.1 + x.height()).max(TOP + legend_height(&groups)) + 16.0;
    let plot = Plot {
        at: (left, TOP),
        size: PLOT,
        x,
        y,
    };
    draw(
        title,
        &description,
        (left + PLOT.0 + side + 16.0, height),
        |root| {
            plot.draw(root)?;
            let places: Vec<(i32, i32)> = points.iter().map(|p| plot.place(p.at)).collect();
            let kind = |p: &EmbeddedPoint| groups.iter().position(|g| *g == p.group).unwrap_or(0);
            for (point, &at) in points.iter().zip(&places) {
                mark(root, at, kind(point))?;
            }
            if named {
                name_points(root, points, &places, &kind)?;
            }
            if groups.is_empty() {
                return Ok(());
            }
            legend(
                root,
                &groups,
                (left + PLOT.0 + overhang + 24.0, TOP + 12.0),
                false,
            )
        },
    )
}

/// The groups in the order they first appear.
fn groups(points: &[EmbeddedPoint]) -> Vec<String> {
    let mut groups: Vec<String> = Vec::new();
    for point in points {
        if !point.group.is_empty() && !groups.contains(&point.group) {
            groups.push(point.group.clone());
        }
    }
    groups
}

/// Axes that hold all points with some room, a unit as long across as up.
fn axes(points: &[EmbeddedPoint], unit: &str) -> (Axis, Axis) {
    let middle = |pick: fn(&EmbeddedPoint) -> f64| {
        let low = points.iter().map(pick).fold(f64::INFINITY, f64::min);
        let high = points.iter().map(pick).fold(f64::NEG_INFINITY, f64::max);
        (0.5 * (low + high), 0.5 * (high - low))
    };
    let (x, half_x) = middle(|p| p.at.0);
    let (y, half_y) = middle(|p| p.at.1);
    let half = (half_y * 1.15).max(half_x * 1.25 * PLOT.1 / PLOT.0).max(1e-12);
    let wide = half * PLOT.0 / PLOT.1;
    let axis = |which: &str, range| Axis::linear(&format!("{which} axis ({unit})"), range, 6, Quantity::Real);
    (
        axis("first", (x - wide, x + wide)),
        axis("second", (y - half, y + half)),
    )
}

/// A box in pixels: left, top, right, bottom.
type Bounds = [f64; 4];

/// Writes each name at the one of eight places around its mark that covers least of what is there already.
fn name_points(
    root: &canvas::Area<'_>,
    points: &[EmbeddedPoint],
    places: &[(i32, i32)],
    kind: &dyn Fn(&EmbeddedPoint) -> usize,
) -> Result<(), FigureError> {
    let pixel = |v: i32| f64::from(v) / f64::from(UNIT);
    let mut taken: Vec<Bounds> = places
        .iter()
        .map(|&(x, y)| [pixel(x) - 5.0, pixel(y) - 5.0, pixel(x) + 5.0, pixel(y) + 5.0])
        .collect();
    for (point, &(x, y)) in points.iter().zip(places) {
        let text = label(&point.label);
        let (width, height) = (text_width(&text, NAME), NAME);
        let (x, y) = (pixel(x), pixel(y));
        let rise = height / 2.0 + 6.0;
        // Where the text is anchored, the preferred place first.
        let candidates = [
            (x + 9.0, y, HPos::Left),
            (x - 9.0, y, HPos::Right),
            (x, y - rise - 1.0, HPos::Center),
            (x, y + rise + 1.0, HPos::Center),
            (x + 5.0, y - rise, HPos::Left),
            (x + 5.0, y + rise, HPos::Left),
            (x - 5.0, y - rise, HPos::Right),
            (x - 5.0, y + rise, HPos::Right),
        ];
        let bounds = |(x, y, anchor): (f64, f64, HPos)| -> Bounds {
            let left = match anchor {
                HPos::Left => x,
                HPos::Center => x - width / 2.0,
                HPos::Right => x - width,
            };
            [left, y - height / 2.0, left + width, y + height / 2.0]
        };
        let covered = |at| -> f64 { taken.iter().map(|b| overlap(&bounds(at), b)).sum() };
        let best = candidates
            .into_iter()
            .min_by(|a, b| covered(*a).total_cmp(&covered(*b)))
            .unwrap_or(candidates[0]);
        taken.push(bounds(best));
        let colour = if point.group.is_empty() {
            INK
        } else {
            series(kind(point))
        };
        let (x, y, anchor) = best;
        canvas::write(root, &text, (x, y), &font(NAME, colour, anchor, VPos::Center))?;
    }
    Ok(())
}

/// Area two boxes share.
fn overlap(a: &Bounds, b: &Bounds) -> f64 {
    let across = a[2].min(b[2]) - a[0].max(b[0]);
    let down = a[3].min(b[3]) - a[1].max(b[1]);
    across.max(0.0) * down.max(0.0)
}
