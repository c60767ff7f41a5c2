//! What a range scanner records: a grid of depths from one side.

use super::view::Picture;
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::TriangleSoup;

/// Points of a scan, about.
const POINTS: f64 = 1000.0;
/// Neighbouring points are joined where their depths differ by at most this many times their distance in the picture.
const STEEPEST: f64 = 3.0;

/// Scans a shape from a random viewpoint at infinity: one vertex per point of a square grid that meets the surface,
/// two triangles per cell of four, none across a jump in depth. Lengths are in pixels.
pub fn scan(null: &TriangleSoup, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let Picture { width, depth, .. } = Picture::take(null, rng);
    let covered = depth.iter().filter(|d| d.is_finite()).count();
    let stride = ((covered as f64 / POINTS).sqrt().round() as usize).max(1);
    let columns = width.div_ceil(stride);
    let at = |column: usize, row: usize| {
        let d = *depth.get(row * stride * width + column * stride)?;
        d.is_finite().then_some(d)
    };
    let mut vertices = Vec::new();
    let mut number = vec![u32::MAX; columns * columns];
    for row in 0..columns {
        for column in 0..columns {
            if let Some(d) = at(column, row) {
                number[row * columns + column] = vertices.len() as u32;
                vertices.push([(column * stride) as f64, (row * stride) as f64, d]);
            }
        }
    }
    let mut faces = Vec::new();
    let steep = |a: u32, b: u32| {
        let jump: f64 = vertices[a as usize][2] - vertices[b as usize][2];
        jump.abs() > STEEPEST * stride as f64
    };
    for row in 1..columns {
        for column in 1..columns {
            let corner = |c: usize, r: usize| number[r * columns + c];
            let (a, b) = (corner(column - 1, row - 1), corner(column, row - 1));
            let (c, d) = (corner(column - 1, row), corner(column, row));
            for face in [[a, b, d], [a, d, c]] {
                let whole = face.iter().all(|&v| v != u32::MAX);
                if whole && !(0..3).any(|k| steep(face[k], face[(k + 1) % 3])) {
                    faces.push(face);
                }
            }
        }
    }
    TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    }
}
