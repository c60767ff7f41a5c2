//! Faces too thin for the spectrum: which they are, and of which kind.

/// A cap is lower than this share of its longest edge. Real meshes have caps from 9e-4 on; the eigen-solve fails for some
/// from 1.5e-6 down.
pub(super) const CAP: f64 = 1e-4;

/// The foot of a cap's height is this many heights away from both ends of the longest edge.
const OBTUSE: f64 = 10.0;

/// The shortest edge of a needle is below this share of its longest. A fan of four million faces has 1.5e-6.
const NEEDLE: f64 = 1e-6;

/// The kind of a face; corners are vertex indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// Not too thin.
    Sound,
    /// The third corner lies on the edge between the `base`, up to a small share of its length.
    Cap { base: [u32; 2] },
    /// The two ends of `edge` are nearly one.
    Needle { edge: [u32; 2] },
}

/// Whether a face may be a sliver, by its area and the squares of its shortest and longest edge: none other is.
pub(super) fn may_be_sliver(area: f64, shortest: f64, longest: f64) -> bool {
    /// Rounding is much less than this.
    const CLEARLY: f64 = 2.0;
    shortest <= CLEARLY * NEEDLE * NEEDLE * longest || 2.0 * area <= CLEARLY * CAP * longest
}

/// The kind of a face with three different vertices, and the square of its longest edge.
pub(super) fn shape(vertices: &[[f64; 3]], face: &[u32; 3]) -> (Shape, f64) {
    let measures = Measures::of(face.map(|v| vertices[v as usize]));
    let (shortest, longest) = (measures.squares[measures.short], measures.squares[measures.long]);
    // The height is twice the area over the longest edge.
    let area = 0.5 * (measures.height * longest).sqrt();
    if may_be_sliver(area, shortest, longest) {
        (thin_shape(vertices, face), longest)
    } else {
        (Shape::Sound, longest)
    }
}

/// The kind of a face that may be a sliver. The corners are taken in the order of their places, so that rounding does not
/// depend on the order in the file.
fn thin_shape(vertices: &[[f64; 3]], face: &[u32; 3]) -> Shape {
    let place = |v: u32| vertices[v as usize];
    let mut corners = *face;
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        if place(corners[j]) < place(corners[i]) {
            corners.swap(i, j);
        }
    }
    let Measures {
        squares,
        long,
        short,
        height,
    } = Measures::of(corners.map(place));
    let opposite = |k: usize| match k {
        0 => [corners[1], corners[2]],
        1 => [corners[0], corners[2]],
        _ => [corners[0], corners[1]],
    };
    let (shortest, longest) = (squares[short], squares[long]);
    let foot = shortest - height;
    if shortest <= NEEDLE * NEEDLE * longest {
        Shape::Needle {
            edge: opposite(short),
        }
    } else if height <= CAP * CAP * longest && foot > OBTUSE * OBTUSE * height {
        Shape::Cap { base: opposite(long) }
    } else {
        Shape::Sound
    }
}

/// Squares of the lengths in a triangle.
struct Measures {
    /// Of the edges; entry k is opposite corner k.
    squares: [f64; 3],
    /// The longest and the shortest of them, the first where there are several.
    long: usize,
    short: usize,
    /// Of the height on the longest edge.
    height: f64,
}

impl Measures {
    fn of(p: [[f64; 3]; 3]) -> Self {
        let squares = [square(p[1], p[2]), square(p[0], p[2]), square(p[0], p[1])];
        let (mut long, mut short) = (0, 0);
        for k in 1..3 {
            if squares[k] > squares[long] {
                long = k;
            }
            if squares[k] < squares[short] {
                short = k;
            }
        }
        let u: [f64; 3] = std::array::from_fn(|i| p[1][i] - p[0][i]);
        let v: [f64; 3] = std::array::from_fn(|i| p[2][i] - p[0][i]);
        let cross = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        let height = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]) / squares[long];
        Self {
            squares,
            long,
            short,
            height,
        }
    }
}

fn square(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn caps_and_needles_are_told_from_thin_faces() {
        let base = [[0.0; 3], [2.0, 0.0, 0.0]];
        let with = |corner: [f64; 3]| shape(&[base[0], base[1], corner], &[0, 1, 2]).0;
        let cap = Shape::Cap { base: [0, 1] };
        for height in [0.0, 1e-15, 1e-7, 1.9e-4] {
            assert_eq!(with([0.7, height, 0.0]), cap, "{height}");
            assert_eq!(with([0.01, height, 0.0]), cap, "{height}");
        }
        assert_eq!(with([0.7, 3e-4, 0.0]), Shape::Sound);
        assert_eq!(with([1e-7, 0.0, 0.0]), Shape::Needle { edge: [0, 2] });
        // A face of a fan, and a half of a thin rectangle.
        assert_eq!(with([2.0, 4e-6, 0.0]), Shape::Sound);
        let (long, _) = shape(&[[0.0; 3], [1.0, 0.0, 0.0], [1.0 - 1e-10, 1e-5, 0.0]], &[2, 0, 1]);
        assert_eq!(long, Shape::Sound);
    }
}
