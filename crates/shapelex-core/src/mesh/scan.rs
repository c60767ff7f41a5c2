//! Walks over the words and lines of ASCII mesh files without copying them.

use super::precision::Decimal;
use crate::cancel::Cancel;

/// Bytes walked over between two looks at the stop flag: well below a millisecond.
const BLOCK: usize = 1 << 18;

/// Longest number read, in bytes.
const LONGEST_NUMBER: usize = 1024;

/// What a backslash before a line end means.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Backslash {
    Text,
    /// The statement continues on the next line (OBJ).
    Continues,
}

/// A position in a text. Blanks are spaces, tabs and other control characters but line feeds and carriage returns,
/// either of which ends a line (so a CRLF file has an empty line after each, which every caller skips).
///
/// Once the stop flag is set, the text ends here: a reader asks the flag before it believes in a text cut short.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
    cancel: Option<&'a Cancel>,
    backslash: Backslash,
}

fn ends_line(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

fn is_blank(byte: u8) -> bool {
    byte <= b' ' && !ends_line(byte)
}

impl<'a> Scanner<'a> {
    /// The start of a text, after its byte-order mark.
    pub fn new(bytes: &'a [u8]) -> Self {
        let at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self {
            bytes,
            at,
            cancel: None,
            backslash: Backslash::Text,
        }
    }

    /// The same position; the text ends as soon as `cancel` is set.
    pub fn stopped_by(self, cancel: &'a Cancel) -> Self {
        Self {
            cancel: Some(cancel),
            ..self
        }
    }

    /// The same position; a backslash that ends a line counts as a blank together with the line end, but in a comment.
    pub fn with_continued_lines(self) -> Self {
        Self {
            backslash: Backslash::Continues,
            ..self
        }
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
    #[inline]
    pub fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Steps over `count` bytes, at most to the end.
    pub fn advance(&mut self, count: usize) {
        self.at = (self.at + count).min(self.bytes.len());
    }

    /// Goes to the end of the text if a stop was asked for.
    pub fn look_at_cancel(&mut self) {
        if self.cancel.is_some_and(Cancel::is_cancelled) {
            self.at = self.bytes.len();
        }
    }

    #[inline]
    fn skip_while(&mut self, skipped: impl Fn(u8) -> bool) {
        // Most runs have a byte or two.
        while self.peek().is_some_and(&skipped) {
            self.at += 1;
            if self.at.is_multiple_of(BLOCK) {
                self.look_at_cancel();
            }
        }
    }

    /// Bytes of a backslash with the line end after it, if it continues the line.
    #[inline]
    fn continuation(&self) -> Option<usize> {
        if self.backslash == Backslash::Text || self.peek() != Some(b'\\') {
            return None;
        }
        match &self.bytes[self.at + 1..] {
            [b'\r', b'\n', ..] => Some(3),
            [b'\n' | b'\r', ..] => Some(2),
            [] => Some(1),
            _ => None,
        }
    }

    /// Steps over blanks, staying on the line.
    #[inline]
    pub fn skip_blanks(&mut self) {
        self.skip_while(is_blank);
        while let Some(length) = self.continuation() {
            self.at += length;
            self.skip_while(is_blank);
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
        let start = self.at;
        // A comment that began on this line, and from where it is looked for: never twice over the same bytes.
        let (mut comment, mut searched) = (false, start);
        loop {
            self.look_at_cancel();
            let block = &self.bytes[self.at..self.bytes.len().min(self.at + BLOCK)];
            if block.is_empty() {
                return;
            }
            let Some(k) = memchr::memchr2(b'\n', b'\r', block) else {
                self.at += block.len();
                continue;
            };
            let end = self.at + k;
            self.at = end + 1;
            let backslash =
                self.backslash == Backslash::Continues && end > start && self.bytes[end - 1] == b'\\';
            if !backslash {
                return;
            }
            comment |= memchr::memchr(b'#', &self.bytes[searched..end]).is_some();
            searched = end;
            if comment {
                return;
            }
            // The line feed of a CRLF belongs to the line end that was continued.
            if self.bytes[end] == b'\r' && self.peek() == Some(b'\n') {
                self.at += 1;
            }
        }
    }

    /// Goes to the next word, over blank lines and comments; false at the end of the text.
    #[inline]
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
    #[inline]
    pub fn skip_whitespace(&mut self) -> bool {
        self.skip_while(|b| b <= b' ');
        !self.at_end()
    }

    /// Reads the word here, up to the next blank, comment or line end.
    pub fn word(&mut self) -> &'a [u8] {
        self.skip_blanks();
        self.word_rest()
    }

    /// Whether no further byte of a word is here.
    #[inline]
    pub fn word_done(&self) -> bool {
        self.peek().is_none_or(|b| b <= b' ' || b == b'#') || self.continuation().is_some()
    }

    /// Reads from inside a word to its end; empty if it ends here.
    #[inline]
    pub fn word_rest(&mut self) -> &'a [u8] {
        let start = self.at;
        while !self.word_done() {
            self.at += 1;
            if self.at.is_multiple_of(BLOCK) {
                self.look_at_cancel();
            }
        }
        &self.bytes[start..self.at]
    }

    /// Reads a number standing alone on this line; `None`, with nothing consumed but blanks, if there is none.
    ///
    /// `nan` and `inf` are numbers here, in the spellings of C libraries too (`-nan(ind)`, `1.#QNAN`): the caller
    /// refuses them by their vertex. A number ends at a blank, a line end, or a comment.
    #[inline]
    pub fn decimal(&mut self) -> Option<Decimal> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..self.bytes.len().min(self.at + LONGEST_NUMBER)];
        let Ok((value, length)) = fast_float2::parse_partial::<f64, _>(rest) else {
            return None;
        };
        let end = Self {
            at: self.at + length,
            ..*self
        };
        // `1.#INF` is no number with a comment after it.
        let ended = length < LONGEST_NUMBER && end.word_done();
        if !ended || (end.peek() == Some(b'#') && rest[length - 1] == b'.') {
            return self.spelled_not_finite();
        }
        self.at += length;
        Some(Decimal::written(&rest[..length], value))
    }

    /// As [`decimal`](Self::decimal), the value alone.
    #[inline]
    pub fn number(&mut self) -> Option<f64> {
        self.decimal().map(|d| d.value)
    }

    /// Reads what C libraries print for a value that is no finite number: `nan(ind)`, `1.#IND`, `1.#INF00`.
    #[cold]
    fn spelled_not_finite(&mut self) -> Option<Decimal> {
        let rest = &self.bytes[self.at..self.bytes.len().min(self.at + 32)];
        let length = rest.iter().position(|&b| b <= b' ').unwrap_or(rest.len());
        let word = rest[..length].to_ascii_lowercase();
        let unsigned = word
            .strip_prefix(b"-")
            .or(word.strip_prefix(b"+"))
            .unwrap_or(&word);
        let letters = |b: &[u8]| b.first().is_some_and(u8::is_ascii_alphabetic);
        let spelled = (unsigned.starts_with(b"nan(") && unsigned.ends_with(b")"))
            || unsigned.strip_prefix(b"1.#").is_some_and(letters);
        spelled.then(|| {
            self.at += length;
            Decimal::exact(f64::NAN)
        })
    }

    /// Reads an integer, whatever follows it; `None` if there is none or it has more than 18 digits.
    #[inline]
    pub fn integer(&mut self) -> Option<i64> {
        self.skip_blanks();
        let sign = self.peek().filter(|b| matches!(b, b'-' | b'+'));
        let start = self.at + usize::from(sign.is_some());
        let mut at = start;
        let mut value = 0i64;
        while let Some(digit) = self.bytes.get(at).map(|b| b.wrapping_sub(b'0')) {
            if digit > 9 {
                break;
            }
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
        Some(if sign == Some(b'-') { -value } else { value })
    }

    /// Reads an integer with nothing after it in its word; `None`, with nothing consumed but blanks, if there is none.
    #[inline]
    pub fn whole_integer(&mut self) -> Option<i64> {
        let start = *self;
        let value = self.integer()?;
        if !self.word_done() {
            self.at = start.at;
            return None;
        }
        Some(value)
    }

    /// How many of the following lines hold more than blanks and comments, this one included, counted up to `enough`.
    pub fn content_lines(&self, enough: usize) -> usize {
        let mut scan = *self;
        let mut lines = 0;
        while lines < enough && scan.next_content() {
            lines += 1;
            scan.next_line();
        }
        lines
    }

    /// The line number here, counted from 1. Costs a pass over the text: for messages only.
    pub fn line_number(&self) -> usize {
        let before = &self.bytes[..self.at];
        let feeds = memchr::memchr_iter(b'\n', before).count();
        if feeds > 0 {
            return 1 + feeds;
        }
        1 + memchr::memchr_iter(b'\r', before).count()
    }

    /// The rest of the line here, shortened and printable, for messages.
    pub fn excerpt(&self) -> String {
        excerpt(self.rest())
    }

    /// The line here by number and text, for messages: ``line 7, `f 1 2 x` ``.
    pub fn place(&self) -> String {
        format!("line {}, `{}`", self.line_number(), self.excerpt())
    }
}

/// The first line of a text, shortened and printable, for messages.
pub(super) fn excerpt(text: &[u8]) -> String {
    const LENGTH: usize = 40;
    let start = &text[..text.len().min(LENGTH + 1)];
    let end = start.iter().position(|&b| ends_line(b)).unwrap_or(start.len());
    let printable = |&b: &u8| {
        if (b' '..=b'~').contains(&b) {
            b as char
        } else {
            '?'
        }
    };
    let shown: String = start[..end.min(LENGTH)].iter().map(printable).collect();
    if end > LENGTH {
        format!("{shown}…")
    } else {
        shown
    }
}

#[cfg(test)]
mod tests;
