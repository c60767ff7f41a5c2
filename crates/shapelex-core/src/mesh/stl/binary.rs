//! Binary STL: a header of 80 bytes, a count, and 50 bytes for each triangle.

use super::super::builder::SoupBuilder;
use super::super::precision::{Decimal, Written};
use super::super::scan::excerpt;
use super::super::{Format, MeshError, ReadContext, TriangleSoup};
use super::corners::Corners;

const HEADER: usize = 84;
const TRIANGLE: usize = 50;
/// Bytes some exporters leave after the last triangle.
const TRAILER: usize = 1024;
/// Triangles between two looks at the stop flag.
const STRIDE: usize = 4096;

/// How many triangles the header promises.
fn promised(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER)?;
    Some(u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize)
}

/// What follows the triangles that the header promises; `None` where the file is shorter.
fn after_triangles(bytes: &[u8]) -> Option<&[u8]> {
    let count = promised(bytes).filter(|&n| n > 0)?;
    bytes.get(HEADER.saturating_add(count.saturating_mul(TRIANGLE))..)
}

/// Whether bytes are one binary file with nothing after it.
fn is_exact(bytes: &[u8]) -> bool {
    after_triangles(bytes).is_some_and(<[u8]>::is_empty)
}

/// Whether the file has the size its triangle count demands, give or take a short trailer or another binary file. No
/// text passes: its count would be above half a billion.
pub(in super::super) fn is_binary(bytes: &[u8]) -> bool {
    after_triangles(bytes).is_some_and(|rest| rest.len() <= TRAILER || is_exact(rest))
}

/// Reads a binary file.
pub(super) fn read(bytes: &[u8], context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let count = check_size(bytes, context)?;
    let mut soup = SoupBuilder::new(Format::Stl, Written::Single, context);
    soup.expect_faces(count)?;
    let mut corners = Corners::new(context);
    for (k, triangle) in bytes[HEADER..].chunks_exact(TRIANGLE).take(count).enumerate() {
        if k.is_multiple_of(STRIDE) {
            context.cancel.check()?;
        }
        // The normal comes first.
        let number = |at: usize| {
            let b = [triangle[at], triangle[at + 1], triangle[at + 2], triangle[at + 3]];
            Decimal::exact(f64::from(f32::from_le_bytes(b)))
        };
        let corner = |k: usize| [0, 4, 8].map(|axis| number(12 + 12 * k + axis));
        let face = [
            corners.index(corner(0), &mut soup)?,
            corners.index(corner(1), &mut soup)?,
            corners.index(corner(2), &mut soup)?,
        ];
        soup.push_polygon(&face)?;
    }
    soup.finish()
}

/// The number of triangles, once the file has the size it demands.
fn check_size(bytes: &[u8], context: &ReadContext) -> Result<usize, MeshError> {
    // A count of four printable characters is above half a billion.
    let text = |b: &u8| matches!(b, b'\t' | b'\n' | b'\r' | b' '..);
    let printable = |b: &u8| text(b) && b.is_ascii();
    let is_text = || bytes[..80].iter().all(text) && bytes[80..HEADER].iter().all(printable);
    if bytes.len() < HEADER || is_text() {
        let start = bytes
            .strip_prefix(b"\xef\xbb\xbf")
            .unwrap_or(bytes)
            .trim_ascii_start();
        let detail = format!(
            "it begins with `{}`, neither with `solid …` nor with a binary header of {HEADER} bytes",
            excerpt(start)
        );
        return Err(if bytes.len() < HEADER {
            MeshError::truncated(Format::Stl, detail)
        } else {
            MeshError::malformed(Format::Stl, detail)
        });
    }
    let count = promised(bytes).unwrap_or(0);
    context.limits.check_faces(count)?;
    let follow = bytes.len() - HEADER;
    if follow / TRIANGLE < count {
        return Err(MeshError::truncated(
            Format::Stl,
            format!(
                "its header promises {count} triangles, but there are bytes for {}",
                follow / TRIANGLE
            ),
        ));
    }
    let rest = &bytes[HEADER + count * TRIANGLE..];
    if let Some(second) = promised(rest).filter(|_| is_binary(rest)) {
        return Err(MeshError::malformed(
            Format::Stl,
            format!(
                "after its {count} triangles a second STL of {second} triangles begins; send the files one by one, or merge \
                 their triangles under one count"
            ),
        ));
    }
    if rest.len() > TRAILER {
        return Err(MeshError::malformed(
            Format::Stl,
            format!(
                "its header promises {count} triangles, but {} bytes follow them",
                rest.len()
            ),
        ));
    }
    Ok(count)
}
