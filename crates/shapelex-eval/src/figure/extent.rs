//! How wide texts are, so that nothing is cut and nothing overlaps.

/// Widths of Helvetica's characters from the space to the tilde, in thousandths of the size (Adobe's metrics).
const HELVETICA: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556,
    556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278,
    500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469,
    556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500,
    278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];
/// Room for a viewer's font that is wider than Helvetica.
const SLACK: f64 = 1.06;
/// From here on scripts are written in squares.
const SQUARE: u32 = 0x1100;

/// Width of a text in the unit its size is given in, a little more than it takes in Helvetica.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let thousandths: f64 = text
        .chars()
        .map(|c| match (u32::from(c)).checked_sub(32) {
            Some(at) if (at as usize) < HELVETICA.len() => f64::from(HELVETICA[at as usize]),
            _ if u32::from(c) >= SQUARE && !('\u{2000}'..='\u{22ff}').contains(&c) => 1000.0,
            _ => 650.0,
        })
        .sum();
    SLACK * size * thousandths / 1000.0
}

/// Width of the widest of some texts, at least `least`.
pub(super) fn widest<'a>(texts: impl IntoIterator<Item = &'a str>, size: f64, least: f64) -> f64 {
    texts
        .into_iter()
        .map(|text| text_width(text, size))
        .fold(least, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_letters_are_wider() {
        assert!((text_width("0", 1000.0) - 556.0 * SLACK).abs() < 1e-9);
        assert!(text_width("WWWW", 12.0) > 4.0 * text_width("i", 12.0));
        assert!(text_width("猫", 10.0) > 10.0);
        assert_eq!(text_width("", 12.0), 0.0);
        assert!((widest(["a", "mmm"], 10.0, 0.0) - text_width("mmm", 10.0)).abs() < 1e-12);
        assert!((widest([], 10.0, 24.0) - 24.0).abs() < 1e-12);
    }
}
