//! Wavefront OBJ.
//!
//! Shape is all that is kept: `v` and `f` statements of all groups and objects together, in the file's order. Texture
//! coordinates, normals, materials, lines, points and names are passed over, so a missing or unreadable one cannot
//! hurt, and a material file is never opened.
//!
//! tobj is not used: it orders vertices by first use, drops those no face uses, is ten times slower, and holds several
//! copies of a long line. A test compares the two.

use super::builder::SoupBuilder;
use super::precision::{Decimal, Written};
use super::reserved::ReservedVec;
use super::scan::Scanner;
use super::{Format, MeshError, ReadContext, TriangleSoup};

/// Corners of one face between two looks at the stop flag.
const STRIDE: usize = 4096;

/// Reads an OBJ file. Vertices keep the file's order, used or not; a fourth number on a `v` line is a weight that
/// divides the others, and more are colours.
///
/// Errors: [`MeshError::IndexOutOfRange`] gives the index as the file has it, from 1 or negative, and the `f`
/// statement counted from 1. [`MeshError::Malformed`] names the line.
pub fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let scan = Scanner::new(bytes)
        .stopped_by(&context.cancel)
        .with_continued_lines();
    let mut faces = Faces::new(context);
    let mut soup = SoupBuilder::new(Format::Obj, Written::Text, context);
    let read = read_statements(scan, &mut soup, &mut faces);
    // A stopped text ends early; nothing that follows from its end is true.
    context.cancel.check()?;
    read?;
    faces.check_furthest(&soup)?;
    if soup.vertices().is_empty() && soup.face_count() == 0 {
        return Err(MeshError::malformed(Format::Obj, "it has no `v` statement"));
    }
    soup.finish()
}

fn read_statements<'a>(
    mut scan: Scanner<'a>,
    soup: &mut SoupBuilder<'a>,
    faces: &mut Faces<'a>,
) -> Result<(), MeshError> {
    while scan.next_content() {
        let start = scan;
        match scan.word() {
            b"v" => {
                let vertex =
                    vertex(&mut scan).ok_or_else(|| bad_statement(&start, "expected three numbers"))?;
                soup.push_vertex(vertex)?;
            }
            // `fo` is the name faces had in the first version of the format.
            b"f" | b"fo" => faces.read(&start, &mut scan, soup)?,
            _ => {}
        }
        scan.next_line();
    }
    Ok(())
}

fn bad_statement(start: &Scanner<'_>, expected: &str) -> MeshError {
    MeshError::malformed(Format::Obj, format!("{}: {expected}", start.place()))
}

/// The numbers after `v`: three coordinates, or four with a weight, or coordinates and colours.
fn vertex(scan: &mut Scanner<'_>) -> Option<[Decimal; 3]> {
    let point = [scan.decimal()?, scan.decimal()?, scan.decimal()?];
    if scan.line_done() {
        return Some(point);
    }
    let weight = scan.number();
    if !scan.line_done() {
        return Some(point);
    }
    let divided = |w: f64| {
        point.map(|x| Decimal {
            value: x.value / w,
            ..x
        })
    };
    weight.filter(|w| *w != 0.0).map(divided)
}

/// The `f` statements read so far.
struct Faces<'a> {
    context: &'a ReadContext,
    polygon: ReservedVec<'a, u32>,
    statements: usize,
    /// Faces may name vertices of later lines. The largest index so used, with its statement, is checked at the end.
    furthest: (i64, usize),
}

impl<'a> Faces<'a> {
    fn new(context: &'a ReadContext) -> Self {
        Self {
            context,
            polygon: ReservedVec::new(&context.memory),
            statements: 0,
            furthest: (0, 0),
        }
    }

    fn read(
        &mut self,
        start: &Scanner<'a>,
        scan: &mut Scanner<'a>,
        soup: &mut SoupBuilder<'a>,
    ) -> Result<(), MeshError> {
        self.statements += 1;
        self.polygon.clear();
        let known = soup.vertices().len() as i64;
        while !scan.line_done() {
            let index = corner(scan)
                .ok_or_else(|| bad_statement(start, "a corner is none of v, v/vt, v//vn and v/vt/vn"))?;
            let absolute = if index < 0 { known + index } else { index - 1 };
            if index == 0 || absolute < 0 || absolute > i64::from(u32::MAX) {
                return Err(out_of_range(self.statements, index, soup));
            }
            if index > known && index > self.furthest.0 {
                self.furthest = (index, self.statements);
            }
            self.polygon.push(absolute as u32)?;
            if self.polygon.len().is_multiple_of(STRIDE) {
                self.context.cancel.check()?;
                self.context
                    .limits
                    .check_faces(soup.face_count() + self.polygon.len() - 2)?;
            }
        }
        soup.push_polygon(&self.polygon)
    }

    fn check_furthest(&self, soup: &SoupBuilder<'_>) -> Result<(), MeshError> {
        let (index, statement) = self.furthest;
        if index > soup.vertices().len() as i64 {
            return Err(out_of_range(statement, index, soup));
        }
        Ok(())
    }
}

fn out_of_range(statement: usize, index: i64, soup: &SoupBuilder<'_>) -> MeshError {
    MeshError::IndexOutOfRange {
        face: statement,
        index,
        vertices: soup.vertices().len(),
    }
}

/// One corner of a face: its vertex index, with whatever follows a slash passed over; `None` if it is none.
#[inline]
fn corner(scan: &mut Scanner<'_>) -> Option<i64> {
    let index = scan.integer()?;
    if scan.word_done() {
        return Some(index);
    }
    scan.word_rest().starts_with(b"/").then_some(index)
}
