//! Ascii STL: a stream of words, in which only a solid's name extends to the end of its line.
//!
//! Keywords may be in any case, stuck together or apart (`endloop`, `end loop`). A facet ends at `endfacet`, at the next
//! `facet` and at `endsolid`, whether or not its loop was ended, so that no two facets are merged.

use super::super::builder::SoupBuilder;
use super::super::precision::Written;
use super::super::reserved::ReservedVec;
use super::super::scan::Scanner;
use super::super::{Format, MeshError, ReadContext, TriangleSoup};
use super::corners::Corners;

/// Whether the text begins with `solid`, and is one as far as a binary header goes.
pub(super) fn begins_with_solid(bytes: &[u8]) -> bool {
    let mut scan = Scanner::new(&bytes[..bytes.len().min(1 << 20)]);
    scan.skip_whitespace();
    let start = scan.rest();
    let text = |b: &u8| matches!(b, b'\t'..=b'\r' | b' '..);
    start
        .get(..5)
        .is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && start.iter().take(84).all(text)
}

/// Whether the text is unmistakably ascii STL: it begins with `solid`, and `facet` or the end of the solid is near.
pub(in super::super) fn is_text(bytes: &[u8]) -> bool {
    let head = bytes[..bytes.len().min(4096)].to_ascii_lowercase();
    let contains = |word: &[u8]| memchr::memmem::find(&head, word).is_some();
    begins_with_solid(&head) && (contains(b"facet") || contains(b"endsolid") || contains(b"end solid"))
}

/// A keyword.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Keyword {
    Solid,
    EndSolid,
    Facet,
    EndFacet,
    Loop,
    EndLoop,
    Vertex,
    Colour,
}

/// Reads a keyword with its second word, if it has one; `None`, with nothing consumed, if there is none.
fn keyword(scan: &mut Scanner<'_>) -> Option<Keyword> {
    let start = *scan;
    let read = lower(scan).and_then(|word| match word.as_slice() {
        b"vertex" => Some(Keyword::Vertex),
        b"facet" => {
            let mut ahead = *scan;
            if lower(&mut ahead).is_some_and(|word| word.as_slice() == b"normal") {
                *scan = ahead;
            }
            Some(Keyword::Facet)
        }
        b"facetnormal" => Some(Keyword::Facet),
        b"outer" => (lower(scan)?.as_slice() == b"loop").then_some(Keyword::Loop),
        b"loop" | b"outerloop" => Some(Keyword::Loop),
        b"color" | b"colour" => Some(Keyword::Colour),
        b"end" => match lower(scan)?.as_slice() {
            b"loop" => Some(Keyword::EndLoop),
            b"facet" => Some(Keyword::EndFacet),
            word if word.starts_with(b"solid") => Some(Keyword::EndSolid),
            _ => None,
        },
        b"endloop" => Some(Keyword::EndLoop),
        b"endfacet" => Some(Keyword::EndFacet),
        // A name may be stuck to these.
        word if word.starts_with(b"endsolid") => Some(Keyword::EndSolid),
        word if word.starts_with(b"solid") => Some(Keyword::Solid),
        _ => None,
    });
    if read.is_none() {
        *scan = start;
    }
    read
}

/// The start of a word in lower case, long enough for every keyword.
struct Word {
    letters: [u8; 16],
    length: usize,
}

impl Word {
    fn as_slice(&self) -> &[u8] {
        &self.letters[..self.length]
    }
}

/// The next word, on this line or a later one.
fn lower(scan: &mut Scanner<'_>) -> Option<Word> {
    if !scan.skip_whitespace() {
        return None;
    }
    let word = scan.word();
    let mut lower = Word {
        letters: [0; 16],
        length: word.len().min(16),
    };
    for (letter, b) in lower.letters.iter_mut().zip(word) {
        *letter = b.to_ascii_lowercase();
    }
    Some(lower)
}

/// Steps over a solid's name: to the end of its line, or to a facet that is on it.
fn skip_name(scan: &mut Scanner<'_>) {
    let mut facet = *scan;
    while !facet.line_done() {
        let mut ahead = facet;
        let mut is = |expected: &[u8]| ahead.word().eq_ignore_ascii_case(expected);
        if is(b"facet") && is(b"normal") && ahead.number().is_some() {
            *scan = facet;
            return;
        }
        // A name may hold a `#`.
        facet.word();
        while facet.peek() == Some(b'#') {
            facet.advance(1);
            facet.word_rest();
        }
    }
    scan.next_line();
}

/// Steps over at most `count` words that are no keywords, such as a normal, which may be `nan`, or left out.
fn skip_values(scan: &mut Scanner<'_>, count: usize) {
    for _ in 0..count {
        let mut ahead = *scan;
        ahead.skip_whitespace();
        if ahead.number().is_some() {
            *scan = ahead;
            continue;
        }
        if ahead.at_end() || keyword(&mut ahead).is_some() {
            return;
        }
        scan.skip_whitespace();
        scan.word();
        // `-1.#IND` is one word.
        while scan.peek() == Some(b'#') {
            scan.advance(1);
            scan.word_rest();
        }
    }
}

/// Reads an ascii file.
pub(super) fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let mut scan = Scanner::new(bytes).stopped_by(&context.cancel);
    let mut reader = Reader {
        soup: SoupBuilder::new(Format::Stl, Written::Text, context),
        corners: Corners::new(context),
        polygon: ReservedVec::new(&context.memory),
        facet: scan,
        in_solid: true,
        context,
    };
    let read = reader.statements(&mut scan);
    // A stopped text ends early; nothing that follows from its end is true.
    context.cancel.check()?;
    read?;
    reader.soup.finish()
}

struct Reader<'a> {
    context: &'a ReadContext,
    soup: SoupBuilder<'a>,
    corners: Corners<'a>,
    /// Vertices of the loop not yet ended.
    polygon: ReservedVec<'a, u32>,
    /// Where the last facet began.
    facet: Scanner<'a>,
    in_solid: bool,
}

impl<'a> Reader<'a> {
    fn statements(&mut self, scan: &mut Scanner<'a>) -> Result<(), MeshError> {
        while scan.skip_whitespace() {
            let start = *scan;
            if scan.peek() == Some(b'#') {
                scan.next_line();
                continue;
            }
            match keyword(scan) {
                Some(Keyword::Vertex) => self.vertex(&start, scan)?,
                Some(Keyword::Facet) => {
                    self.end_polygon()?;
                    self.in_solid = true;
                    self.facet = start;
                    skip_values(scan, 3);
                }
                Some(Keyword::Loop | Keyword::EndLoop | Keyword::EndFacet) => self.end_polygon()?,
                Some(Keyword::Colour) => skip_values(scan, 4),
                Some(Keyword::Solid) => {
                    self.end_polygon()?;
                    self.in_solid = true;
                    skip_name(scan);
                }
                Some(Keyword::EndSolid) => {
                    self.end_polygon()?;
                    self.in_solid = false;
                    skip_name(scan);
                }
                None => {
                    let detail = format!("{}: not an STL statement", start.place());
                    return Err(MeshError::malformed(Format::Stl, detail));
                }
            }
        }
        if self.in_solid || !self.polygon.is_empty() {
            let detail = format!(
                "it ends without `endsolid`, after {} facets",
                self.soup.face_count()
            );
            return Err(MeshError::truncated(Format::Stl, detail));
        }
        Ok(())
    }

    fn vertex(&mut self, start: &Scanner<'a>, scan: &mut Scanner<'a>) -> Result<(), MeshError> {
        let mut number = || {
            scan.skip_whitespace();
            scan.decimal().ok_or_else(|| {
                if scan.at_end() {
                    return MeshError::truncated(Format::Stl, "it ends within a vertex");
                }
                let detail = format!("{}: expected three numbers", start.place());
                MeshError::malformed(Format::Stl, detail)
            })
        };
        let corner = [number()?, number()?, number()?];
        let index = self.corners.index(corner, &mut self.soup)?;
        self.polygon.push(index)?;
        let corners = self.polygon.len();
        if corners.is_multiple_of(4096) {
            self.context.cancel.check()?;
            self.context
                .limits
                .check_faces(self.soup.face_count() + corners - 2)?;
        }
        Ok(())
    }

    /// Ends the loop at hand, if any.
    fn end_polygon(&mut self) -> Result<(), MeshError> {
        if matches!(self.polygon.len(), 1 | 2) {
            let detail = format!(
                "{}: a facet of {} vertices, it needs three",
                self.facet.place(),
                self.polygon.len()
            );
            return Err(MeshError::malformed(Format::Stl, detail));
        }
        self.soup.push_polygon(&self.polygon)?;
        self.polygon.clear();
        Ok(())
    }
}
