//! Stanford PLY, ascii and binary of either byte order.
//!
//! Read: `x`, `y`, `z` of `vertex`; `vertex_indices` or `vertex_index` of `face`, polygons split into triangles, and of
//! `tristrips`. All else is passed over. Of properties of one name the first counts; of an element that is declared
//! several times, all are read. ([`payload`] says how ascii lines are read.)
//!
//! ply-rs-bw is not used: it refuses names with a `#`, keeps the last of two properties of one name, and asks for each
//! property of each element by name. A test compares the two on well-formed files.

mod header;
mod payload;

use super::builder::SoupBuilder;
use super::precision::{Decimal, Written};
use super::reserved::ReservedVec;
use super::{Format, MeshError, ReadContext, TriangleSoup};
use header::{Element, Encoding, Header, Property, Scalar, Type, malformed};
use payload::Payload;

pub(super) use header::has_magic;

/// Elements, or items of one list, between two looks at the stop flag.
const STRIDE: usize = 4096;

/// Reads a PLY file. Vertices keep the file's order.
///
/// Errors: faces and vertices are counted from 0, as in the file. [`MeshError::Truncated`] when the header promises
/// more than there is.
pub fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let read = Header::parse(bytes).and_then(|(header, rest)| read_elements(&header, rest, context));
    // A stopped text ends early; nothing that follows from its end is true.
    context.cancel.check()?;
    read
}

fn read_elements(header: &Header, bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let mut reader = Reader {
        context,
        payload: Payload::new(header, bytes, &context.cancel),
        soup: SoupBuilder::new(Format::Ply, written(header), context),
        polygon: ReservedVec::new(&context.memory),
        faces: 0,
    };
    for element in &header.elements {
        reader
            .element(element)
            .map_err(|error| reader.payload.explain(error))?;
    }
    if !header.elements.iter().any(|e| e.name == b"vertex") {
        return Err(malformed("its header has no `element vertex`"));
    }
    reader.soup.finish()
}

/// In which form the header says the coordinates are held.
fn written(header: &Header) -> Written {
    let is_single = |p: &Property| p.axis().is_some() && p.value == Type::Scalar(Scalar::F32);
    let vertices = || header.elements.iter().filter(|e| e.name == b"vertex");
    if header.encoding == Encoding::Ascii {
        Written::Text
    } else if vertices().any(|e| e.properties.iter().any(is_single)) {
        Written::Single
    } else {
        Written::Exact
    }
}

/// What lists of indices are.
#[derive(Clone, Copy, PartialEq)]
enum Surface {
    Polygons,
    /// Triangle strips, where −1 ends a strip and begins another.
    Strips,
}

struct Reader<'a> {
    context: &'a ReadContext,
    payload: Payload<'a>,
    soup: SoupBuilder<'a>,
    polygon: ReservedVec<'a, u32>,
    /// Faces read so far, for messages.
    faces: usize,
}

impl Reader<'_> {
    fn element(&mut self, element: &Element) -> Result<(), MeshError> {
        match element.name.as_slice() {
            b"vertex" => self.context.limits.check_vertices(element.count)?,
            b"face" => self.context.limits.check_faces(element.count)?,
            _ => {}
        }
        self.payload.check(element)?;
        match element.name.as_slice() {
            b"vertex" => self.vertices(element),
            b"face" => self.faces(element, Surface::Polygons),
            b"tristrips" => self.faces(element, Surface::Strips),
            _ => self.skip(element),
        }
    }

    fn skip(&mut self, element: &Element) -> Result<(), MeshError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        for k in 0..element.count {
            if k.is_multiple_of(STRIDE) {
                self.context.cancel.check()?;
            }
            self.payload.begin(element, k)?;
            for property in &element.properties {
                self.payload.skip(property.value)?;
            }
            self.payload.end();
        }
        Ok(())
    }

    fn vertices(&mut self, element: &Element) -> Result<(), MeshError> {
        // Which coordinate each property is, if any.
        let mut axes: Vec<Option<usize>> = vec![None; element.properties.len()];
        for axis in 0..3 {
            let is = |p: &Property| p.axis() == Some(axis);
            let first = element.properties.iter().position(is).ok_or_else(|| {
                malformed(format!("its vertices have no number `{}`", ["x", "y", "z"][axis]))
            })?;
            axes[first] = Some(axis);
        }
        self.soup.expect_vertices(element.count)?;
        for k in 0..element.count {
            let mut point = [Decimal::exact(0.0); 3];
            self.payload.begin(element, k)?;
            for (&axis, property) in axes.iter().zip(&element.properties) {
                match (axis, property.value) {
                    (Some(axis), Type::Scalar(scalar)) => point[axis] = self.payload.scalar(scalar)?,
                    (_, other) => self.payload.skip(other)?,
                }
            }
            self.payload.end();
            self.soup.push_vertex(point)?;
        }
        Ok(())
    }

    fn faces(&mut self, element: &Element, surface: Surface) -> Result<(), MeshError> {
        let indices = element.properties.iter().position(Property::is_index_list);
        if indices.is_none() && element.count > 0 {
            return Err(malformed("its faces have no list `vertex_indices`"));
        }
        if surface == Surface::Polygons {
            self.soup.expect_faces(element.count)?;
        }
        for k in 0..element.count {
            self.payload.begin(element, k)?;
            for (p, property) in element.properties.iter().enumerate() {
                match property.value {
                    Type::List { count, item } if Some(p) == indices => self.indices(count, item, surface)?,
                    other => self.payload.skip(other)?,
                }
            }
            self.payload.end();
            self.faces += 1;
        }
        Ok(())
    }

    /// Reads one list of indices and appends what it stands for.
    fn indices(&mut self, count: Scalar, item: Scalar, surface: Surface) -> Result<(), MeshError> {
        self.polygon.clear();
        // Where faces come before vertices, the number of vertices is checked at the end.
        let vertices = self.soup.vertices().len();
        let limit = if vertices > 0 {
            vertices as f64
        } else {
            f64::from(u32::MAX)
        };
        for k in 1..=self.payload.length(count, item)? {
            let index = self.payload.index(item)?;
            if surface == Surface::Strips && index == -1.0 {
                self.soup.push_strip(&self.polygon)?;
                self.polygon.clear();
                continue;
            }
            if index.fract() != 0.0 {
                return Err(malformed(format!(
                    "face {} refers to a vertex of number {index}",
                    self.faces
                )));
            }
            if !(0.0..limit).contains(&index) {
                return Err(MeshError::IndexOutOfRange {
                    face: self.faces,
                    index: index as i64,
                    vertices,
                });
            }
            self.polygon.push(index as u32)?;
            if k.is_multiple_of(STRIDE) {
                self.context.cancel.check()?;
                let triangles = self.polygon.len().saturating_sub(2);
                self.context
                    .limits
                    .check_faces(self.soup.face_count() + triangles)?;
            }
        }
        match surface {
            Surface::Polygons => self.soup.push_polygon(&self.polygon),
            Surface::Strips => self.soup.push_strip(&self.polygon),
        }
    }
}
