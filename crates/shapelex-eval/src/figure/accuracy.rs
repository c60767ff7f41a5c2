//! The share of right answers per class, as bars with the counts behind them.

use super::FigureError;
use super::canvas::{self, draw, fill, font, label};
use super::extent::{text_width, widest};
use super::palette::{FAINT, INK, MUTED, series};
use super::ticks::{Quantity, linear};
use crate::benchmark::wilson;
use plotters::style::text_anchor::{HPos, VPos};

/// Height of a bar with its gap, in pixels.
const ROW: f64 = 24.0;
const BAR: f64 = 16.0;
/// Length of a bar of 100 %, in pixels.
const LENGTH: f64 = 360.0;
const TOP: f64 = 56.0;
const NAME: f64 = 12.5;
const COUNT: f64 = 11.5;

/// A class with its right answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassAccuracy {
    /// The class.
    pub class: String,
    /// Right answers.
    pub correct: usize,
    /// Queries.
    pub total: usize,
}

/// Draws a bar per class in the order given, with a line over the 95 % interval of the share (Wilson 1927), and the
/// counts behind it.
///
/// # Errors
/// [`FigureError::Empty`] without a class that was queried.
pub fn class_accuracy(title: &str, classes: &[ClassAccuracy]) -> Result<String, FigureError> {
    let classes: Vec<&ClassAccuracy> = classes.iter().filter(|c| c.total > 0).collect();
    if classes.is_empty() {
        return Err(FigureError::Empty { what: "classes" });
    }
    let share = |c: &ClassAccuracy| c.correct as f64 / c.total as f64;
    let counts: Vec<String> = classes
        .iter()
        .map(|c| format!("{} of {}, {:.0} %", c.correct, c.total, 100.0 * share(c)))
        .collect();
    let names: Vec<String> = classes.iter().map(|c| label(&c.class)).collect();
    let left = 26.0 + widest(names.iter().map(String::as_str), NAME, 40.0);
    let behind = widest(counts.iter().map(String::as_str), COUNT, 0.0);
    let bottom = TOP + ROW * classes.len() as f64;
    let axis_label = "right answers; the lines are 95 % intervals";
    let width = (left + LENGTH + 16.0 + behind).max(left + text_width(axis_label, 13.0)) + 16.0;
    let said: Vec<String> = names
        .iter()
        .zip(&counts)
        .map(|(n, c)| format!("{n} {c}"))
        .collect();
    let description = format!("Right answers per class: {}.", said.join("; "));
    draw(title, &description, (width, bottom + 50.0), |root| {
        let tick = font(12.0, INK, HPos::Center, VPos::Center);
        for mark in linear((0.0, 1.0), 5, Quantity::Share) {
            let x = left + LENGTH * mark.at;
            canvas::line(root, &[(x, TOP - 6.0), (x, bottom)], 0.75, FAINT)?;
            canvas::write(root, &mark.text, (x, bottom + 12.0), &tick)?;
        }
        let name = font(NAME, INK, HPos::Right, VPos::Center);
        let count = font(COUNT, MUTED, HPos::Left, VPos::Center);
        for (i, class) in classes.iter().enumerate() {
            let y = TOP + ROW * i as f64;
            let middle = y + BAR / 2.0;
            canvas::write(root, &names[i], (left - 10.0, middle), &name)?;
            fill(root, (left, y), (LENGTH * share(class), BAR), series(5))?;
            let (low, high) = wilson(class.correct, class.total);
            let (from, to) = (left + LENGTH * low, left + LENGTH * high);
            canvas::line(root, &[(from, middle), (to, middle)], 1.2, INK)?;
            for end in [from, to] {
                canvas::line(root, &[(end, middle - 3.0), (end, middle + 3.0)], 1.2, INK)?;
            }
            canvas::write(root, &counts[i], (left + LENGTH + 12.0, middle), &count)?;
        }
        canvas::line(root, &[(left, TOP - 6.0), (left, bottom)], 1.0, INK)?;
        let axis = font(13.0, INK, HPos::Center, VPos::Center);
        canvas::write(root, axis_label, (left + LENGTH / 2.0, bottom + 34.0), &axis)
    })
}
