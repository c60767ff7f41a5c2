//! Stanford PLY, ascii and binary of either byte order.
//!
//! ply-rs-bw reads the header; the payload is read here into the soup directly, with every count checked against the
//! limits and against the bytes that remain. (The crate's own payload reader asks for each property of each element by
//! name and fails on `nan` and on a list longer than its line; a test holds the two together on well-formed files.)
//!
//! Read: `x`, `y`, `z` of `vertex`; `vertex_indices` or `vertex_index` of `face`, polygons split into fans, and of
//! `tristrips`. All else is passed over.

use super::scan::Scanner;
use super::{Format, Limits, MeshError, ReadContext, TriangleSoup};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, ElementDef, Encoding, Header, PropertyType, ScalarType};

/// Longest header read, in bytes.
const MAX_HEADER: usize = 1 << 20;

/// Reads a PLY file. Vertices keep the file's order.
///
/// Errors: faces and vertices are counted from 0, as in the file. [`MeshError::Truncated`] when the header promises
/// more than there is.
pub fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let limits = &context.limits;
    let (header, payload) = read_header(bytes)?;
    let mut payload = Payload::new(header.encoding, payload);
    let mut soup = TriangleSoup::default();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => limits.check_vertices(element.count)?,
            "face" => limits.check_faces(element.count)?,
            _ => {}
        }
        payload.check(name, element)?;
        match name.as_str() {
            "vertex" => read_vertices(&mut payload, element, &mut soup)?,
            "face" => read_faces(&mut payload, element, Fan, &mut soup, limits)?,
            "tristrips" => read_faces(&mut payload, element, Strip, &mut soup, limits)?,
            _ => skip(&mut payload, element)?,
        }
    }
    if !header.elements.contains_key("vertex") {
        return Err(malformed("its header has no `element vertex`"));
    }
    soup.checked(Format::Ply, limits)
}

fn malformed(detail: impl Into<String>) -> MeshError {
    MeshError::malformed(Format::Ply, detail)
}

/// Parses the header and returns it with the bytes after it.
fn read_header(bytes: &[u8]) -> Result<(Header, &[u8]), MeshError> {
    const END: &[u8] = b"end_header";
    let start = &bytes[..bytes.len().min(MAX_HEADER)];
    if !start.starts_with(b"ply") {
        return Err(malformed("it does not begin with a line `ply`"));
    }
    let end = (1..start.len().saturating_sub(END.len() - 1))
        .find(|&k| start[k..].starts_with(END) && matches!(start[k - 1], b'\n' | b'\r'))
        .ok_or_else(|| MeshError::truncated(Format::Ply, "its header has no line `end_header`"))?;
    let mut after = end + END.len();
    while matches!(bytes.get(after), Some(b' ' | b'\t')) {
        after += 1;
    }
    after += match bytes.get(after..) {
        Some([b'\r', b'\n', ..]) => 2,
        Some([b'\n' | b'\r', ..]) => 1,
        Some([]) | None => 0,
        Some(_) => return Err(malformed("`end_header` is not alone on its line")),
    };
    // Comments may be in any encoding, and lines may end in a carriage return.
    let mut text: String = String::from_utf8_lossy(&start[..end])
        .lines()
        .flat_map(|line| line.split('\r'))
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .flat_map(|line| [line, "\n"])
        .collect();
    text.push_str("end_header\n");
    let header = Parser::<DefaultElement>::new()
        .read_header(&mut Reader::new(text.as_bytes()))
        .map_err(|error| malformed(format!("header: {}", error.to_string().replace("\n\t", " "))))?;
    Ok((header, &bytes[after..]))
}

/// The bytes after the header, read scalar by scalar.
enum Payload<'a> {
    Ascii(Scanner<'a>),
    Binary { rest: &'a [u8], little: bool },
}

fn size(scalar: &ScalarType) -> usize {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

fn decode(scalar: &ScalarType, bytes: &[u8], little: bool) -> f64 {
    let mut b = [0u8; 8];
    let n = bytes.len();
    b[..n].copy_from_slice(bytes);
    if !little {
        b[..n].reverse();
    }
    match scalar {
        ScalarType::Char => f64::from(b[0] as i8),
        ScalarType::UChar => f64::from(b[0]),
        ScalarType::Short => f64::from(i16::from_le_bytes([b[0], b[1]])),
        ScalarType::UShort => f64::from(u16::from_le_bytes([b[0], b[1]])),
        ScalarType::Int => f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        ScalarType::UInt => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        ScalarType::Float => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        ScalarType::Double => f64::from_le_bytes(b),
    }
}

impl<'a> Payload<'a> {
    fn new(encoding: Encoding, bytes: &'a [u8]) -> Self {
        match encoding {
            Encoding::Ascii => Self::Ascii(Scanner::new(bytes)),
            Encoding::BinaryLittleEndian => Self::Binary {
                rest: bytes,
                little: true,
            },
            Encoding::BinaryBigEndian => Self::Binary {
                rest: bytes,
                little: false,
            },
        }
    }

    fn remaining(&self) -> usize {
        match self {
            Self::Ascii(scan) => scan.remaining(),
            Self::Binary { rest, .. } => rest.len(),
        }
    }

    /// The fewest bytes a scalar takes: a digit and a blank in ascii.
    fn least(&self, scalar: &ScalarType) -> usize {
        match self {
            Self::Ascii(_) => 2,
            Self::Binary { .. } => size(scalar),
        }
    }

    /// Refuses an element whose count promises more than the remaining bytes could hold.
    fn check(&self, name: &str, element: &ElementDef) -> Result<(), MeshError> {
        let least: usize = element
            .properties
            .values()
            .map(|p| match &p.data_type {
                PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => self.least(scalar),
            })
            .sum();
        // The last number of an ascii file needs no blank after it.
        if element.count.saturating_mul(least) > self.remaining() + 1 {
            return Err(MeshError::truncated(
                Format::Ply,
                format!(
                    "its header promises {} of `{name}`, but only {} bytes follow",
                    element.count,
                    self.remaining()
                ),
            ));
        }
        Ok(())
    }

    #[inline]
    fn scalar(&mut self, scalar: &ScalarType) -> Result<f64, MeshError> {
        match self {
            Self::Binary { rest, little } => {
                let Some((head, tail)) = rest.split_at_checked(size(scalar)) else {
                    return Err(MeshError::truncated(Format::Ply, "it ends within an element"));
                };
                *rest = tail;
                Ok(decode(scalar, head, *little))
            }
            Self::Ascii(scan) => {
                if !scan.skip_whitespace() {
                    return Err(MeshError::truncated(Format::Ply, "it ends within an element"));
                }
                scan.number().ok_or_else(|| {
                    malformed(format!(
                        "expected a number after the header, found `{}`",
                        scan.excerpt()
                    ))
                })
            }
        }
    }

    /// Reads the length of a list whose items are of type `item`.
    #[inline]
    fn length(&mut self, count: &ScalarType, item: &ScalarType) -> Result<usize, MeshError> {
        let length = self.scalar(count)?;
        if !(length >= 0.0 && length.fract() == 0.0) {
            return Err(malformed(format!("a list has the length {length}")));
        }
        let length = length as usize;
        if length.saturating_mul(self.least(item)) > self.remaining() + 1 {
            return Err(MeshError::truncated(
                Format::Ply,
                format!("a list promises {length} items, more than follow"),
            ));
        }
        Ok(length)
    }

    fn skip(&mut self, property: &PropertyType) -> Result<(), MeshError> {
        match property {
            PropertyType::Scalar(scalar) => self.scalar(scalar).map(|_| ()),
            PropertyType::List(count, item) => {
                for _ in 0..self.length(count, item)? {
                    self.scalar(item)?;
                }
                Ok(())
            }
        }
    }
}

fn skip(payload: &mut Payload<'_>, element: &ElementDef) -> Result<(), MeshError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for _ in 0..element.count {
        for property in element.properties.values() {
            payload.skip(&property.data_type)?;
        }
    }
    Ok(())
}

fn read_vertices(
    payload: &mut Payload<'_>,
    element: &ElementDef,
    soup: &mut TriangleSoup,
) -> Result<(), MeshError> {
    // Which coordinate each property is, if any.
    let axes: Vec<(Option<usize>, &PropertyType)> = element
        .properties
        .iter()
        .map(|(name, p)| {
            let axis = ["x", "y", "z"].iter().position(|axis| name == axis);
            (axis, &p.data_type)
        })
        .collect();
    for axis in 0..3 {
        let scalar = |&(a, t): &(Option<usize>, &PropertyType)| {
            a == Some(axis) && matches!(t, PropertyType::Scalar(_))
        };
        if !axes.iter().any(scalar) {
            return Err(malformed(format!(
                "its vertices have no number `{}`",
                ["x", "y", "z"][axis]
            )));
        }
    }
    soup.vertices.reserve_exact(element.count);
    for _ in 0..element.count {
        let mut point = [0.0; 3];
        for &(axis, property) in &axes {
            match (axis, property) {
                (Some(axis), PropertyType::Scalar(scalar)) => point[axis] = payload.scalar(scalar)?,
                _ => payload.skip(property)?,
            }
        }
        soup.vertices.push(point);
    }
    Ok(())
}

/// How a list of indices becomes triangles.
#[derive(Clone, Copy, PartialEq)]
enum Surface {
    Fan,
    Strip,
}
use Surface::{Fan, Strip};

fn read_faces(
    payload: &mut Payload<'_>,
    element: &ElementDef,
    surface: Surface,
    soup: &mut TriangleSoup,
    limits: &Limits,
) -> Result<(), MeshError> {
    let is_index_list =
        |name: &str, t: &PropertyType| name.starts_with("vertex_ind") && matches!(t, PropertyType::List(..));
    let properties: Vec<(bool, &PropertyType)> = element
        .properties
        .iter()
        .map(|(name, p)| (is_index_list(name, &p.data_type), &p.data_type))
        .collect();
    if element.count > 0 && !properties.iter().any(|p| p.0) {
        return Err(malformed("its faces have no list `vertex_indices`"));
    }
    if surface == Fan {
        soup.faces.reserve_exact(element.count);
    }
    let mut indices: Vec<i64> = Vec::new();
    let mut polygon: Vec<u32> = Vec::new();
    for face in 0..element.count {
        for &(wanted, property) in &properties {
            let (true, PropertyType::List(count, item)) = (wanted, property) else {
                payload.skip(property)?;
                continue;
            };
            indices.clear();
            for _ in 0..payload.length(count, item)? {
                indices.push(payload.scalar(item)? as i64);
            }
            // −1 ends a strip and begins another.
            let pieces = indices.split(|&k| surface == Strip && k == -1);
            for piece in pieces {
                polygon.clear();
                for &index in piece {
                    // Where faces come before vertices, the number of vertices is checked at the end.
                    let vertices = soup.vertices.len();
                    let limit = if vertices > 0 {
                        vertices as i64
                    } else {
                        i64::from(u32::MAX)
                    };
                    if index < 0 || index >= limit {
                        return Err(MeshError::IndexOutOfRange {
                            face,
                            index,
                            vertices,
                        });
                    }
                    polygon.push(index as u32);
                }
                match surface {
                    Fan => soup.push_polygon(&polygon, limits)?,
                    Strip => soup.push_strip(&polygon, limits)?,
                }
            }
        }
    }
    Ok(())
}
