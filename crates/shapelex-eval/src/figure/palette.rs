//! Colours that colour-blind readers tell apart.

use plotters::style::RGBColor;

/// Text and axes.
pub(super) const INK: RGBColor = RGBColor(34, 34, 34);
/// What should stay behind the data.
pub(super) const FAINT: RGBColor = RGBColor(222, 222, 222);
/// Secondary text.
pub(super) const MUTED: RGBColor = RGBColor(110, 110, 110);

/// The colours of Okabe and Ito (2008), the yellow, which is lost on white, as a grey.
const SERIES: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 120),
    RGBColor(0, 0, 0),
];

/// Colour of the i-th series; they repeat after eight.
pub(super) fn series(i: usize) -> RGBColor {
    SERIES[i % SERIES.len()]
}

/// Cividis (Nuñez, Anderton, Renslow 2018) at ten equidistant places.
const CIVIDIS: [[u8; 3]; 10] = [
    [0, 34, 78],
    [18, 53, 112],
    [59, 73, 108],
    [87, 93, 109],
    [112, 113, 115],
    [138, 134, 120],
    [165, 156, 116],
    [195, 179, 105],
    [225, 204, 85],
    [254, 232, 56],
];

/// Colour of a share between 0 (dark blue) and 1 (yellow).
pub(super) fn sequential(share: f64) -> RGBColor {
    let at = share.clamp(0.0, 1.0) * (CIVIDIS.len() - 1) as f64;
    let low = (at as usize).min(CIVIDIS.len() - 2);
    let t = at - low as f64;
    let mix = |k: usize| {
        let (a, b) = (f64::from(CIVIDIS[low][k]), f64::from(CIVIDIS[low + 1][k]));
        (a + t * (b - a)).round() as u8
    };
    RGBColor(mix(0), mix(1), mix(2))
}

/// The colour times a brightness.
pub(super) fn shaded(colour: RGBColor, brightness: f64) -> RGBColor {
    let part = |c: u8| (f64::from(c) * brightness).round().clamp(0.0, 255.0) as u8;
    RGBColor(part(colour.0), part(colour.1), part(colour.2))
}

/// Ink that is legible on the colour.
pub(super) fn ink_on(colour: RGBColor) -> RGBColor {
    let luminance = 0.299 * f64::from(colour.0) + 0.587 * f64::from(colour.1) + 0.114 * f64::from(colour.2);
    if luminance > 140.0 {
        INK
    } else {
        RGBColor(255, 255, 255)
    }
}
