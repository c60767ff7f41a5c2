//! A query's classes as ranked bars.

use super::FigureError;
use super::canvas::{self, draw, fill, font, label, number};
use super::extent::text_width;
use super::palette::{FAINT, INK, MUTED, series};
use plotters::style::text_anchor::{HPos, VPos};

/// Height of a bar with its gap, in pixels.
const ROW: f64 = 26.0;
/// Length of the longest bar, in pixels.
const LENGTH: f64 = 420.0;

/// A named value.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Its name.
    pub label: String,
    /// Its value, not negative.
    pub value: f64,
}

/// Draws bars from 0 in the order given, the first one emphasised. `value` says what is measured, with its unit.
///
/// # Errors
/// [`FigureError::Empty`] without bars, or where a value is negative or not finite.
pub fn bars(title: &str, value: &str, bars: &[Bar]) -> Result<String, FigureError> {
    let good = |v: f64| v.is_finite() && v >= 0.0;
    if bars.is_empty() || !bars.iter().all(|b| good(b.value)) {
        return Err(FigureError::Empty { what: "bars" });
    }
    let greatest = bars.iter().map(|b| b.value).fold(f64::MIN_POSITIVE, f64::max);
    let names = bars
        .iter()
        .map(|b| text_width(&label(&b.label), 12.5))
        .fold(40.0, f64::max);
    let left = names + 40.0;
    let size = (left + LENGTH + 80.0, 56.0 + ROW * bars.len() as f64 + 36.0);
    let description = bars
        .iter()
        .map(|b| format!("{} {}", b.label, number(b.value)))
        .collect::<Vec<_>>()
        .join(", ");
    draw(title, &format!("{value}: {description}."), size, |root| {
        let name = font(12.5, INK, HPos::Right, VPos::Center);
        let number_style = font(11.5, MUTED, HPos::Left, VPos::Center);
        for (i, bar) in bars.iter().enumerate() {
            let y = 56.0 + ROW * i as f64;
            let length = LENGTH * bar.value / greatest;
            let colour = if i == 0 { series(0) } else { series(5) };
            canvas::write(root, &label(&bar.label), (left - 10.0, y + 9.0), &name)?;
            fill(root, (left, y), (length, 18.0), colour)?;
            let text = format!("{:.5}", bar.value);
            canvas::write(root, &text, (left + length + 6.0, y + 9.0), &number_style)?;
        }
        let bottom = 56.0 + ROW * bars.len() as f64;
        canvas::line(root, &[(left, 50.0), (left, bottom)], 1.0, FAINT)?;
        let axis = font(13.0, INK, HPos::Center, VPos::Center);
        canvas::write(root, value, (left + LENGTH / 2.0, bottom + 16.0), &axis)
    })
}
