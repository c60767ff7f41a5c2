//! Walks over the words and lines of ASCII mesh files without copying them.

/// A position in a text. Blanks are spaces, tabs and other control characters but line feeds and carriage returns,
/// either of which ends a line (so a CRLF file has an empty line after each, which every caller skips).
#[derive(Clone, Debug)]
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
}

fn ends_line(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

fn is_blank(byte: u8) -> bool {
    byte <= b' ' && !ends_line(byte)
}

impl<'a> Scanner<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        // A byte-order mark is not part of the text.
        let at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { bytes, at }
    }

    /// Bytes not yet read.
    pub fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Whether the whole text was read.
    pub fn at_end(&self) -> bool {
        self.at >= self.bytes.len()
    }

    /// The rest of the text.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// The next byte, not consumed.
    pub fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Steps over blanks, staying on the line.
    #[inline]
    pub fn skip_blanks(&mut self) {
        while self.peek().is_some_and(is_blank) {
            self.at += 1;
        }
    }

    /// Steps over blanks; true when nothing is left on this line, or only a `#` comment.
    #[inline]
    pub fn line_done(&mut self) -> bool {
        self.skip_blanks();
        self.peek().is_none_or(|b| ends_line(b) || b == b'#')
    }

    /// Goes to the start of the next line.
    #[inline]
    pub fn next_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest
            .iter()
            .position(|&b| ends_line(b))
            .map_or(rest.len(), |k| k + 1);
    }

    /// Goes to the next word, over blank lines and comments; false at the end of the text.
    pub fn next_content(&mut self) -> bool {
        while !self.at_end() {
            if !self.line_done() {
                return true;
            }
            self.next_line();
        }
        false
    }

    /// Steps over blanks and line ends, comments being text; false at the end of the text.
    pub fn skip_whitespace(&mut self) -> bool {
        while self.peek().is_some_and(|b| b <= b' ') {
            self.at += 1;
        }
        !self.at_end()
    }

    /// Reads the word here, up to the next blank or line end.
    pub fn word(&mut self) -> &'a [u8] {
        self.skip_blanks();
        self.word_rest()
    }

    /// Reads from inside a word to its end; empty if it ends here.
    #[inline]
    pub fn word_rest(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&b| b <= b' ').unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    /// Reads a number standing alone on this line; `None`, with nothing consumed but blanks, if there is none.
    /// `nan` and `inf` are numbers here: the caller refuses them by their vertex.
    #[inline]
    pub fn number(&mut self) -> Option<f64> {
        self.skip_blanks();
        let (value, length) = fast_float2::parse_partial::<f64, _>(&self.bytes[self.at..]).ok()?;
        let after = self.bytes.get(self.at + length);
        if after.is_some_and(|&b| b > b' ' && b != b'#') {
            return None;
        }
        self.at += length;
        Some(value)
    }

    /// Reads an integer, whatever follows it; `None` if there is none or it has more than 18 digits.
    #[inline]
    pub fn integer(&mut self) -> Option<i64> {
        self.skip_blanks();
        let mut at = self.at;
        let negative = match self.bytes.get(at) {
            Some(b'-') => true,
            Some(b'+') => false,
            _ => {
                at = at.wrapping_sub(1);
                false
            }
        };
        at = at.wrapping_add(1);
        let start = at;
        let mut value = 0i64;
        while let Some(digit) = self
            .bytes
            .get(at)
            .map(|b| b.wrapping_sub(b'0'))
            .filter(|&d| d < 10)
        {
            if at - start >= 18 {
                return None;
            }
            value = value * 10 + i64::from(digit);
            at += 1;
        }
        if at == start {
            return None;
        }
        self.at = at;
        Some(if negative { -value } else { value })
    }

    /// The line number here, counted from 1. Costs a pass over the text: for messages only.
    pub fn line_number(&self) -> usize {
        let before = &self.bytes[..self.at];
        let feeds = before.iter().filter(|&&b| b == b'\n').count();
        let returns = before.iter().filter(|&&b| b == b'\r').count();
        1 + if feeds == 0 { returns } else { feeds }
    }

    /// The line here, shortened and printable, for messages.
    pub fn excerpt(&self) -> String {
        let rest = self.rest();
        let end = rest.iter().position(|&b| ends_line(b)).unwrap_or(rest.len());
        let shown = &rest[..end.min(40)];
        let text: String = shown
            .iter()
            .map(|&b| {
                if (b' '..=b'~').contains(&b) {
                    b as char
                } else {
                    '?'
                }
            })
            .collect();
        if end > 40 { format!("{text}…") } else { text }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_integers_stop_where_they_should() {
        let mut s = Scanner::new(b"  1.5e3\t-2/3 +7 x 123456789012345678901\n# c\n\n nan 4#");
        assert_eq!(s.number(), Some(1500.0));
        assert_eq!(s.integer(), Some(-2));
        assert_eq!(s.word(), b"/3");
        assert_eq!(s.integer(), Some(7));
        assert_eq!(s.integer(), None);
        assert_eq!(s.word(), b"x");
        assert_eq!(s.integer(), None);
        s.word();
        assert!(s.line_done());
        assert!(s.next_content());
        assert_eq!(s.line_number(), 4);
        assert!(s.number().is_some_and(f64::is_nan));
        assert_eq!(s.number(), Some(4.0));
        assert!(s.line_done());
        assert!(!s.next_content());
    }

    #[test]
    fn a_number_with_letters_after_it_is_none() {
        assert_eq!(Scanner::new(b"12abc").number(), None);
        assert_eq!(Scanner::new(b"").number(), None);
        assert_eq!(Scanner::new(b"-").integer(), None);
    }
}
