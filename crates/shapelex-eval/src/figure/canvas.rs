//! The sheet every figure is drawn on.
//!
//! The plotting library places everything on whole numbers, so a figure is drawn eight times as large as it is shown:
//! positions are then exact to an eighth of a pixel.

use super::FigureError;
use super::extent::text_width;
use super::palette::INK;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{PathElement, Rectangle, Text};
use plotters::prelude::SVGBackend;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontTransform, RGBColor, ShapeStyle, TextStyle, WHITE};

/// Drawn units per shown pixel.
pub(super) const UNIT: i32 = 8;

/// Longest label that is drawn whole: the longest name a class may have.
const LABEL: usize = 100;
/// Size of the title and the room beside it, in pixels.
const TITLE: f64 = 17.0;
const BESIDE_TITLE: f64 = 16.0;

/// An area to draw on.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Pixels → drawn units.
pub(super) fn px(pixels: f64) -> i32 {
    (pixels * f64::from(UNIT)).round() as i32
}

/// The same as an unsigned number, which sizes and margins are given in.
pub(super) fn size(pixels: f64) -> u32 {
    px(pixels).max(0) as u32
}

/// Draws a figure of the given size in pixels, wider where its title needs it. The title is drawn on top, 44 pixels high, and is the document's title
/// too; the description is there for those who hear it.
pub(super) fn draw(
    title: &str,
    description: &str,
    (width, height): (f64, f64),
    body: impl FnOnce(&Area<'_>) -> Result<(), FigureError>,
) -> Result<String, FigureError> {
    let width = width.max(text_width(title, TITLE) + 2.0 * BESIDE_TITLE).ceil();
    let mut svg = String::new();
    let drawn = (size(width), size(height));
    {
        let root = SVGBackend::with_string(&mut svg, drawn).into_drawing_area();
        root.fill(&WHITE)?;
        let style = font(TITLE, INK, HPos::Center, VPos::Center);
        write(&root, title, (width / 2.0, 24.0), &style)?;
        body(&root)?;
        root.present()?;
    }
    // The first tag is the library's root element; ours is shown at its own size and names itself.
    let rest = svg.split_once('>').map_or("", |(_, rest)| rest);
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{title}\">\n<title>{title}</title>\n<desc>{}</desc>{rest}",
        drawn.0,
        drawn.1,
        escape(description),
        title = escape(title),
    ))
}

/// A text style; the size is in pixels.
pub(super) fn font(pixels: f64, colour: RGBColor, h: HPos, v: VPos) -> TextStyle<'static> {
    // The library draws fonts smaller by this factor than they are asked for.
    let style: TextStyle<'static> = ("Helvetica, Arial, sans-serif", pixels * f64::from(UNIT) * 1.24).into();
    TextStyle {
        color: colour.to_backend_color(),
        pos: Pos::new(h, v),
        ..style
    }
}

/// The style, its text running upwards.
pub(super) fn upwards(style: &TextStyle<'static>) -> TextStyle<'static> {
    style.transform(FontTransform::Rotate270)
}

/// Writes a text at a place in pixels.
pub(super) fn write(
    area: &Area<'_>,
    text: &str,
    (x, y): (f64, f64),
    style: &TextStyle<'static>,
) -> Result<(), FigureError> {
    Ok(area.draw(&Text::new(clean(text), (px(x), px(y)), style.clone()))?)
}

/// Fills a rectangle given in pixels.
pub(super) fn fill(
    area: &Area<'_>,
    (x, y): (f64, f64),
    (width, height): (f64, f64),
    colour: RGBColor,
) -> Result<(), FigureError> {
    let corners = [(px(x), px(y)), (px(x + width), px(y + height))];
    Ok(area.draw(&Rectangle::new(corners, colour.filled()))?)
}

/// Draws a line through places given in pixels.
pub(super) fn line(
    area: &Area<'_>,
    points: &[(f64, f64)],
    width: f64,
    colour: RGBColor,
) -> Result<(), FigureError> {
    let points: Vec<(i32, i32)> = points.iter().map(|&(x, y)| (px(x), px(y))).collect();
    Ok(area.draw(&PathElement::new(points, stroke(width, colour)))?)
}

/// A line style; the width is in pixels.
pub(super) fn stroke(width: f64, colour: RGBColor) -> ShapeStyle {
    colour.stroke_width(size(width))
}

/// A label short enough for its place.
pub(super) fn label(text: &str) -> String {
    if text.chars().count() <= LABEL {
        return text.to_owned();
    }
    let mut short: String = text.chars().take(LABEL - 1).collect();
    short.push('…');
    short
}

/// What XML 1.0 cannot say is replaced.
fn clean(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '\t' | '\n' | '\r' => ' ',
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => '\u{fffd}',
            c => c,
        })
        .collect()
}

fn escape(text: &str) -> String {
    clean(text)
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A number to three digits or so: 0.0123, 4.5, 1234.
pub(super) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 {
        "0".to_owned()
    } else if !(1e-4..1e6).contains(&magnitude) {
        format!("{value:.1e}")
    } else {
        let decimals = (2 - magnitude.log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{value:.decimals$}");
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        }
    }
}
