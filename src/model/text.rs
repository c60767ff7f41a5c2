//! Characters a name must not have, because a reader cannot see them or cannot tell where they are.

/// The hidden characters, as ranges in ascending order: controls (category Cc), format characters such as the bidi
/// controls and the zero-width ones (Cf), line and paragraph separators (Zl, Zp), everything else of the property
/// Default_Ignorable_Code_Point such as fillers and variation selectors, the noncharacters of the first plane, and the
/// blank Braille pattern. A test compares the table with the Unicode character database.
const HIDDEN: &[(u32, u32)] = &[
    (0x0000, 0x001F),
    (0x007F, 0x009F),
    (0x00AD, 0x00AD),
    (0x034F, 0x034F),
    (0x0600, 0x0605),
    (0x061C, 0x061C),
    (0x06DD, 0x06DD),
    (0x070F, 0x070F),
    (0x0890, 0x0891),
    (0x08E2, 0x08E2),
    (0x115F, 0x1160),
    (0x17B4, 0x17B5),
    (0x180B, 0x180F),
    (0x200B, 0x200F),
    (0x2028, 0x202E),
    (0x2060, 0x206F),
    (0x2800, 0x2800),
    (0x3164, 0x3164),
    (0xFDD0, 0xFDEF),
    (0xFE00, 0xFE0F),
    (0xFEFF, 0xFEFF),
    (0xFFA0, 0xFFA0),
    (0xFFF0, 0xFFFB),
    (0xFFFE, 0xFFFF),
    (0x110BD, 0x110BD),
    (0x110CD, 0x110CD),
    (0x13430, 0x1343F),
    (0x1BCA0, 0x1BCA3),
    (0x1D173, 0x1D17A),
    (0xE0000, 0xE0FFF),
];

/// Whether a name with this character could look like another one without it, or be shown in another order.
pub fn is_hidden(c: char) -> bool {
    let code = u32::from(c);
    HIDDEN
        .binary_search_by(|&(first, last)| {
            if last < code {
                std::cmp::Ordering::Less
            } else if first > code {
                std::cmp::Ordering::Greater
            } else {
                std::cmp::Ordering::Equal
            }
        })
        .is_ok()
}

/// The hidden characters as the inside of a regular expression's class. Those of the first plane are escapes; the
/// others stand for themselves, since the dialects of JSON Schema's users have no common escape for them.
pub fn hidden_class() -> String {
    let one = |code: u32| match char::from_u32(code) {
        Some(c) if code > 0xFFFF => c.to_string(),
        _ => format!("\\u{code:04x}"),
    };
    HIDDEN
        .iter()
        .map(|&(first, last)| {
            if first == last {
                one(first)
            } else {
                format!("{}-{}", one(first), one(last))
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use unicode_properties::{GeneralCategory, UnicodeGeneralCategory};

    #[test]
    fn the_table_has_every_control_format_character_and_separator() {
        use GeneralCategory::{Control, Format, LineSeparator, ParagraphSeparator};
        for c in '\0'..=char::MAX {
            let category = c.general_category();
            if [Control, Format, LineSeparator, ParagraphSeparator].contains(&category) {
                assert!(is_hidden(c), "U+{:04X} {category:?}", u32::from(c));
            }
        }
        assert!(HIDDEN.windows(2).all(|pair| pair[0].1 < pair[1].0));
    }

    #[test]
    fn letters_of_every_script_are_shown() {
        for c in "aß中שم한ก👩🦊 -_.'́\u{a0}\u{3000}".chars() {
            assert!(!is_hidden(c), "U+{:04X}", u32::from(c));
        }
        for c in [
            '\u{200b}',
            '\u{202e}',
            '\u{2066}',
            '\u{3164}',
            '\u{fe0f}',
            '\u{e0041}',
        ] {
            assert!(is_hidden(c), "U+{:04X}", u32::from(c));
        }
    }
}
