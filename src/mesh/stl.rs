//! Stereolithography STL, binary and ascii.
//!
//! Binary files are read by stl_io, once their size agrees with their count. Ascii files are read here, because
//! stl_io stops at the first `endsolid` of several, and refuses `solid` without a name, capitals and the `nan` normals
//! that exporters write for slivers. Normals and attributes are passed over. An STL repeats each vertex in each of its
//! triangles; corners with the same bits become one vertex.

use super::scan::Scanner;
use super::{Format, Limits, MeshError, ReadContext, TriangleSoup};
use std::collections::HashMap;
use std::io::Cursor;

const HEADER: usize = 84;
const TRIANGLE: usize = 50;
/// Bytes some exporters leave after the last triangle.
const TRAILER: usize = 1024;

/// How many triangles the header of a binary file promises.
fn promised(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize)
}

/// Whether the file has the size its triangle count demands, give or take a short trailer. No text passes: its count
/// would be above half a billion.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    promised(bytes).is_some_and(|n| {
        let needed = HEADER.saturating_add(n.saturating_mul(TRIANGLE));
        n > 0 && (needed..=needed + TRAILER).contains(&bytes.len())
    })
}

fn is_ascii(bytes: &[u8]) -> bool {
    let mut scan = Scanner::new(bytes);
    scan.skip_whitespace();
    let word = scan.word();
    let printable = |&b: &u8| b == b'\t' || b == b'\n' || b == b'\r' || b >= b' ';
    word.eq_ignore_ascii_case(b"solid") && bytes[..bytes.len().min(HEADER)].iter().all(printable)
}

/// Reads an STL file. Vertices are ordered by first use.
///
/// Errors: [`MeshError::Truncated`] when a binary file is shorter than its count demands or an ascii one ends within a
/// facet; vertices of [`MeshError::NotFinite`] are numbered after merging.
pub fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let limits = &context.limits;
    let soup = if !is_binary(bytes) && is_ascii(bytes) {
        read_ascii(bytes, limits)?
    } else {
        read_binary(bytes, limits)?
    };
    soup.checked(Format::Stl, limits)
}

fn read_binary(bytes: &[u8], limits: &Limits) -> Result<TriangleSoup, MeshError> {
    let Some(count) = promised(bytes) else {
        return Err(MeshError::truncated(
            Format::Stl,
            format!(
                "{} bytes, neither ascii (`solid …`) nor the {HEADER} bytes of a binary header",
                bytes.len()
            ),
        ));
    };
    limits.check_faces(count)?;
    let found = (bytes.len() - HEADER) / TRIANGLE;
    if found < count {
        return Err(MeshError::truncated(
            Format::Stl,
            format!("its header promises {count} triangles, but there are bytes for {found}"),
        ));
    }
    // stl_io takes a header that begins with `solid` for ascii, so it gets the file with an empty header.
    let mut file = vec![0u8; 80];
    file.extend_from_slice(&bytes[80..HEADER + count * TRIANGLE]);
    let mesh = stl_io::read_stl(&mut Cursor::new(file))
        .map_err(|error| MeshError::malformed(Format::Stl, error.to_string()))?;
    Ok(TriangleSoup {
        vertices: mesh.vertices.iter().map(|v| v.0.map(f64::from)).collect(),
        faces: mesh.faces.iter().map(|f| f.vertices.map(|k| k as u32)).collect(),
        ..TriangleSoup::default()
    })
}

fn read_ascii(bytes: &[u8], limits: &Limits) -> Result<TriangleSoup, MeshError> {
    let mut soup = TriangleSoup::default();
    let mut seen: HashMap<[u64; 3], u32> = HashMap::new();
    let mut polygon = Vec::new();
    let mut scan = Scanner::new(bytes);
    let mut open = true;
    while scan.skip_whitespace() {
        let start = scan.clone();
        match scan.word().to_ascii_lowercase().as_slice() {
            b"vertex" => {
                let mut point = [0.0; 3];
                for x in &mut point {
                    *x = scan.number().ok_or_else(|| {
                        if scan.at_end() {
                            return MeshError::truncated(Format::Stl, "it ends within a vertex");
                        }
                        MeshError::malformed(
                            Format::Stl,
                            format!(
                                "line {}, `{}`: expected three numbers",
                                start.line_number(),
                                start.excerpt()
                            ),
                        )
                    })?;
                }
                let next = soup.vertices.len() as u32;
                let index = *seen.entry(point.map(f64::to_bits)).or_insert(next);
                if index == next {
                    soup.vertices.push(point);
                    limits.check_vertices(soup.vertices.len())?;
                }
                polygon.push(index);
            }
            b"endloop" => {
                soup.push_polygon(&polygon, limits)?;
                polygon.clear();
            }
            b"solid" => {
                open = true;
                scan.next_line();
            }
            b"endsolid" => {
                open = false;
                scan.next_line();
            }
            b"outer" | b"endfacet" => {}
            // A facet's normal may be `nan`, a solid's name anything.
            b"facet" => scan.next_line(),
            b"loop" => {}
            _ => {
                return Err(MeshError::malformed(
                    Format::Stl,
                    format!(
                        "line {}, `{}`: not an STL statement",
                        start.line_number(),
                        start.excerpt()
                    ),
                ));
            }
        }
    }
    if open || !polygon.is_empty() {
        return Err(MeshError::truncated(
            Format::Stl,
            format!("it ends without `endsolid`, after {} facets", soup.faces.len()),
        ));
    }
    Ok(soup)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Well-formed ascii text reads as stl_io reads it.
        #[test]
        fn ascii_agrees_with_stl_io(triangles in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-100i32..100)), 1..40)) {
            let mut text = String::from("solid a name facet\n");
            for t in &triangles {
                text += "facet normal 0 0 1\nouter loop\n";
                for v in t {
                    text += &format!("vertex {} {:e} {}\n", f64::from(v[0]) / 8.0, f64::from(v[1]), v[2]);
                }
                text += "endloop\nendfacet\n";
            }
            text += "endsolid a name facet\n";
            let ours = read_ascii(text.as_bytes(), &Limits::default()).expect("well-formed");
            let theirs = stl_io::read_stl(&mut Cursor::new(text.as_bytes())).expect("well-formed");
            let vertices: Vec<_> = theirs.vertices.iter().map(|v| v.0.map(f64::from)).collect();
            let faces: Vec<_> = theirs.faces.iter().map(|f| f.vertices.map(|k| k as u32)).collect();
            prop_assert_eq!(ours, TriangleSoup { vertices, faces, ..TriangleSoup::default() });
        }
    }
}
