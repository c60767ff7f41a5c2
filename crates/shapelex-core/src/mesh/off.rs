//! Object File Format (Geomview's OFF), in text.
//!
//! Read: all forms of the keyword, `[ST][C][N][4][n]OFF` with its prefixes in any order, for three dimensions. The
//! position always comes first of what a vertex has (Geomview manual, "OFF Files"), so what follows it is passed over.
//!
//! A text is a stream of words, and lines matter where words alone do not tell what they are: colours follow a face to
//! the end of its line, and many writers put colours after vertices without saying so in the keyword. So where there is
//! a line for each vertex, what is left on a vertex's last line is passed over, and the same for faces. Where there are
//! fewer lines, a vertex has the numbers its keyword tells, and a face none after its corners.

use super::builder::SoupBuilder;
use super::precision::{Decimal, Written};
use super::reserved::ReservedVec;
use super::scan::Scanner;
use super::{Format, MeshError, ReadContext, TriangleSoup};

/// Corners of one face between two looks at the stop flag.
const STRIDE: usize = 4096;

/// What the keyword says about the vertices.
#[derive(Clone, Copy, Debug, Default)]
struct Keyword {
    texture: bool,
    colour: bool,
    normal: bool,
    /// `4`: a weight follows the coordinates and divides them.
    weight: bool,
    /// `n`: the number of dimensions follows the keyword.
    dimensions: bool,
}

impl Keyword {
    /// Reads the keyword, also with a count stuck to it (`OFF490 518 0`, as in ModelNet). `None`, with nothing consumed,
    /// if there is none.
    fn read(scan: &mut Scanner<'_>) -> Option<Self> {
        let start = *scan;
        let read = scan.next_content().then(|| Self::parse(scan)).flatten();
        if read.is_none() {
            *scan = start;
        }
        read
    }

    fn parse(scan: &mut Scanner<'_>) -> Option<Self> {
        let mut keyword = Self::default();
        loop {
            let rest = scan.rest();
            let (length, seen) = match rest {
                [b'S', b'T', ..] => (2, &mut keyword.texture),
                [b'C', ..] => (1, &mut keyword.colour),
                [b'N', ..] => (1, &mut keyword.normal),
                [b'4', ..] => (1, &mut keyword.weight),
                [b'n', ..] => (1, &mut keyword.dimensions),
                _ => break,
            };
            if std::mem::replace(seen, true) {
                return None;
            }
            scan.advance(length);
        }
        if !scan.rest().get(..3)?.eq_ignore_ascii_case(b"OFF") {
            return None;
        }
        scan.advance(3);
        (scan.word_done() || scan.peek().is_some_and(|b| b.is_ascii_digit())).then_some(keyword)
    }

    /// Numbers after the coordinates and the weight. Colours have four, those of bytes too.
    fn passed_over(&self) -> usize {
        3 * usize::from(self.normal) + 4 * usize::from(self.colour) + 2 * usize::from(self.texture)
    }
}

/// Whether the text begins with an OFF keyword and what may follow one.
pub(super) fn has_keyword(bytes: &[u8]) -> bool {
    let mut scan = Scanner::new(bytes);
    if Keyword::read(&mut scan).is_none() {
        return false;
    }
    // Prose may begin with the word "off".
    scan.line_done() || scan.rest().starts_with(b"BINARY") || scan.integer().is_some()
}

/// Reads an OFF file. Vertices keep the file's order; polygons are split into triangles; points and lines are passed
/// over.
///
/// Errors: faces and vertices are counted from 0, as in the file. [`MeshError::Unsupported`] for the binary form and
/// for other than three dimensions. [`MeshError::Truncated`] when the counts promise more than there is.
pub fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let mut scan = Scanner::new(bytes).stopped_by(&context.cancel);
    let read = Reader::begin(&mut scan, context).and_then(|reader| reader.elements(&mut scan));
    // A stopped text ends early; nothing that follows from its end is true.
    context.cancel.check()?;
    read
}

struct Reader<'a> {
    context: &'a ReadContext,
    soup: SoupBuilder<'a>,
    keyword: Keyword,
    vertices: usize,
    faces: usize,
    /// Lines after the counts that are not blank, as far as they are needed.
    lines: usize,
}

impl<'a> Reader<'a> {
    /// Reads the keyword, which is optional, and the counts.
    fn begin(scan: &mut Scanner<'a>, context: &'a ReadContext) -> Result<Self, MeshError> {
        let keyword = Keyword::read(scan).unwrap_or_default();
        scan.skip_blanks();
        if scan.rest().starts_with(b"BINARY") {
            return Err(unsupported("OFF BINARY".into()));
        }
        if keyword.dimensions {
            let dimensions = count(scan, "dimensions")?;
            if dimensions != 3 {
                return Err(unsupported(format!("nOFF of {dimensions} dimensions")));
            }
        }
        let vertices = count(scan, "vertices")?;
        let faces = count(scan, "faces")?;
        skip_edge_count(scan);
        let mut soup = SoupBuilder::new(Format::Off, Written::Text, context);
        context.limits.check_vertices(vertices)?;
        context.limits.check_faces(faces)?;
        // `0 0 0` with its line end is the shortest vertex, `0` with its line end the shortest face.
        if vertices.saturating_mul(6).saturating_add(faces.saturating_mul(2)) > scan.remaining() + 1 {
            return Err(MeshError::truncated(
                Format::Off,
                format!(
                    "its header promises {vertices} vertices and {faces} faces, but only {} bytes follow",
                    scan.remaining()
                ),
            ));
        }
        soup.expect_vertices(vertices)?;
        soup.expect_faces(faces)?;
        Ok(Self {
            context,
            soup,
            keyword,
            vertices,
            faces,
            lines: scan.content_lines(vertices + faces),
        })
    }

    fn elements(mut self, scan: &mut Scanner<'a>) -> Result<TriangleSoup, MeshError> {
        let (lines, elements) = (self.lines, self.vertices + self.faces);
        self.vertices(scan)
            .and_then(|()| self.faces(scan))
            .map_err(|error| error.unless_cut_short(Format::Off, lines, elements))?;
        self.soup.finish()
    }

    fn vertices(&mut self, scan: &mut Scanner<'a>) -> Result<(), MeshError> {
        let on_lines = self.lines == self.vertices + self.faces;
        for k in 0..self.vertices {
            let mut next = || {
                scan_content(scan, "vertex", k, self.vertices)?
                    .decimal()
                    .ok_or_else(|| bad_word(scan, "a coordinate"))
            };
            let mut point = [next()?, next()?, next()?];
            if self.keyword.weight {
                let weight = next()?.value;
                point = point.map(|x| Decimal {
                    value: x.value / weight,
                    ..x
                });
            }
            if on_lines {
                scan.next_line();
            } else {
                for _ in 0..self.keyword.passed_over() {
                    next()?;
                }
            }
            self.soup.push_vertex(point)?;
        }
        Ok(())
    }

    fn faces(&mut self, scan: &mut Scanner<'a>) -> Result<(), MeshError> {
        let on_lines = scan.content_lines(self.faces) == self.faces;
        let mut polygon = ReservedVec::new(&self.context.memory);
        for face in 0..self.faces {
            let corners = scan_content(scan, "face", face, self.faces)?
                .whole_integer()
                .and_then(|n| usize::try_from(n).ok())
                .ok_or_else(|| bad_word(scan, "a number of corners"))?;
            if corners > scan.remaining() {
                return Err(MeshError::truncated(
                    Format::Off,
                    format!("face {face} promises {corners} corners, more than follow"),
                ));
            }
            polygon.clear();
            for k in 1..=corners {
                let index = scan_content(scan, "face", face, self.faces)?
                    .whole_integer()
                    .ok_or_else(|| bad_word(scan, "a vertex index"))?;
                if index < 0 || index >= self.vertices as i64 {
                    return Err(MeshError::IndexOutOfRange {
                        face,
                        index,
                        vertices: self.vertices,
                    });
                }
                polygon.push(index as u32)?;
                if k.is_multiple_of(STRIDE) {
                    self.context.cancel.check()?;
                    self.context.limits.check_faces(self.soup.face_count() + k - 2)?;
                }
            }
            self.soup.push_polygon(&polygon)?;
            if on_lines {
                scan.next_line();
            }
        }
        Ok(())
    }
}

fn unsupported(feature: String) -> MeshError {
    MeshError::Unsupported {
        format: Format::Off,
        feature,
    }
}

fn count(scan: &mut Scanner<'_>, what: &str) -> Result<usize, MeshError> {
    if !scan.next_content() {
        return Err(MeshError::truncated(
            Format::Off,
            format!("it ends before the number of {what}"),
        ));
    }
    scan.whole_integer()
        .and_then(|n| usize::try_from(n).ok())
        .ok_or_else(|| bad_word(scan, &format!("the number of {what}")))
}

/// Steps over the number of edges, which some writers leave out: it is on the line of the number of faces, or alone on
/// the next.
fn skip_edge_count(scan: &mut Scanner<'_>) {
    if !scan.line_done() {
        let mut ahead = *scan;
        if ahead.whole_integer().is_some() {
            *scan = ahead;
        }
        return;
    }
    let mut ahead = *scan;
    if ahead.next_content() && ahead.whole_integer().is_some() && ahead.line_done() {
        *scan = ahead;
    }
}

/// The scanner at its next word, or the error that the file ended within element `k` of `n`.
fn scan_content<'s, 'a>(
    scan: &'s mut Scanner<'a>,
    element: &str,
    k: usize,
    n: usize,
) -> Result<&'s mut Scanner<'a>, MeshError> {
    if !scan.next_content() {
        return Err(MeshError::truncated(
            Format::Off,
            format!("it ends within {element} {k} of {n}"),
        ));
    }
    Ok(scan)
}

fn bad_word(scan: &Scanner<'_>, expected: &str) -> MeshError {
    MeshError::malformed(Format::Off, format!("{}: expected {expected}", scan.place()))
}
