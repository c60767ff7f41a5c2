//! Object File Format (Geomview's OFF), in text.
//!
//! Read: the plain form and those with texture coordinates, colours and normals at the vertices (`ST`, `C`, `N`),
//! comments, blank lines, counts on the keyword's line or the next, colours after faces. The position always comes
//! first on a vertex line (Geomview manual, "OFF Files"), so what follows it is passed over.

use super::scan::Scanner;
use super::{Format, MeshError, ReadContext, TriangleSoup};

/// The keyword's prefix letters and what follows it, if the text begins with one.
struct Keyword {
    /// `4` or `n` before `OFF`: more than three coordinates.
    higher_dimensional: bool,
    binary: bool,
}

/// Reads the keyword: `[ST][C][N][4][n]OFF`, also with a count stuck to it (`OFF490 518 0`, as in ModelNet).
fn keyword(scan: &mut Scanner<'_>) -> Option<Keyword> {
    if !scan.next_content() {
        return None;
    }
    let mut rest = scan.rest();
    let mut higher_dimensional = false;
    for (prefix, dimensional) in [
        (b"ST".as_slice(), false),
        (b"C", false),
        (b"N", false),
        (b"4", true),
        (b"n", true),
    ] {
        if let Some(after) = rest.strip_prefix(prefix) {
            rest = after;
            higher_dimensional |= dimensional;
        }
    }
    let after = rest.strip_prefix(b"OFF")?;
    if after
        .first()
        .is_some_and(|&b| b > b' ' && b != b'#' && !b.is_ascii_digit())
    {
        return None;
    }
    *scan = Scanner::new(after);
    scan.skip_blanks();
    Some(Keyword {
        higher_dimensional,
        binary: scan.rest().starts_with(b"BINARY"),
    })
}

/// Whether the text begins with an OFF keyword.
pub(super) fn has_keyword(bytes: &[u8]) -> bool {
    keyword(&mut Scanner::new(bytes)).is_some()
}

/// Reads an OFF file. Vertices keep the file's order; polygons are split into fans; points and lines are passed over.
///
/// Errors: faces and vertices are counted from 0, as in the file. [`MeshError::Unsupported`] for the binary form and
/// for more than three dimensions. [`MeshError::Truncated`] when the counts promise more than there is.
pub fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let limits = &context.limits;
    let mut scan = Scanner::new(bytes);
    match keyword(&mut scan) {
        Some(k) if k.binary => return Err(unsupported("OFF BINARY")),
        Some(k) if k.higher_dimensional => return Err(unsupported("4OFF or nOFF")),
        // The keyword is optional; counts must follow either way.
        _ => {}
    }
    let vertices = count(&mut scan, "vertices")?;
    let faces = count(&mut scan, "faces")?;
    limits.check_vertices(vertices)?;
    limits.check_faces(faces)?;
    scan.next_line();
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
    let mut soup = TriangleSoup {
        vertices: Vec::with_capacity(vertices),
        faces: Vec::with_capacity(faces),
        ..TriangleSoup::default()
    };
    for k in 0..vertices {
        let mut point = [0.0; 3];
        for x in &mut point {
            *x = scan_content(&mut scan, "vertex", k, vertices)?
                .number()
                .ok_or_else(|| bad_line(&scan, "a coordinate"))?;
        }
        soup.vertices.push(point);
        scan.next_line();
    }
    let mut polygon = Vec::new();
    for face in 0..faces {
        let corners = scan_content(&mut scan, "face", face, faces)?
            .integer()
            .and_then(|n| usize::try_from(n).ok())
            .ok_or_else(|| bad_line(&scan, "a number of corners"))?;
        polygon.clear();
        for _ in 0..corners {
            let index = scan_content(&mut scan, "face", face, faces)?
                .integer()
                .ok_or_else(|| bad_line(&scan, "a vertex index"))?;
            if index < 0 || index >= vertices as i64 {
                return Err(MeshError::IndexOutOfRange {
                    face,
                    index,
                    vertices,
                });
            }
            polygon.push(index as u32);
        }
        soup.push_polygon(&polygon, limits)?;
        scan.next_line();
    }
    soup.checked(Format::Off, limits)
}

fn unsupported(feature: &str) -> MeshError {
    MeshError::Unsupported {
        format: Format::Off,
        feature: feature.into(),
    }
}

fn count(scan: &mut Scanner<'_>, what: &str) -> Result<usize, MeshError> {
    if !scan.next_content() {
        return Err(MeshError::truncated(
            Format::Off,
            format!("it ends before the number of {what}"),
        ));
    }
    scan.integer()
        .and_then(|n| usize::try_from(n).ok())
        .ok_or_else(|| bad_line(scan, &format!("the number of {what}")))
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

fn bad_line(scan: &Scanner<'_>, expected: &str) -> MeshError {
    MeshError::malformed(
        Format::Off,
        format!("expected {expected}, found `{}`", scan.excerpt()),
    )
}
