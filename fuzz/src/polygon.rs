//! Polygons → triangles, through a binary PLY of one face.

use shapelex_core::mesh::{Limits, Source, read};
use std::collections::HashMap;

const LIMITS: Limits = Limits {
    max_vertices: 3000,
    max_faces: 3000,
    max_bytes: 1 << 20,
    max_poses: 1,
};

/// Polygons with more corners are not looked at for crossings, which takes the square of their number.
const CHECKED: usize = 128;

type Point = [f64; 2];

/// The bytes are corners on a grid, in a plane that the first byte tilts. The polygon becomes n − 2 triangles that keep
/// its border; where it does not cross itself, they cover its area once.
pub fn check(bytes: &[u8]) {
    let Some((&tilt, rest)) = bytes.split_first() else {
        return;
    };
    let corners: Vec<Point> = rest
        .chunks_exact(2)
        .take(LIMITS.max_vertices)
        .map(|b| [f64::from(b[0]), f64::from(b[1])])
        .collect();
    let n = corners.len();
    if n < 3 {
        return;
    }
    let (slope_x, slope_y) = (f64::from(tilt & 15), f64::from(tilt >> 4));
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty double x\nproperty double y\n\
         property double z\nelement face 1\nproperty list ushort ushort vertex_indices\nend_header\n"
    )
    .into_bytes();
    for [x, y] in &corners {
        for c in [*x, *y, slope_x * x - slope_y * y] {
            file.extend(c.to_le_bytes());
        }
    }
    file.extend((n as u16).to_le_bytes());
    file.extend((0..n as u16).flat_map(u16::to_le_bytes));
    let source = Source {
        bytes: &file,
        ..Source::default()
    };
    let (_, soup) = read(&source, &LIMITS).expect("a polygon");
    keeps_border(n, &soup.faces);
    if n <= CHECKED && is_simple(&corners) {
        let whole = doubled_area(&corners).abs();
        let covered: f64 = soup
            .faces
            .iter()
            .map(|f| doubled_area(&f.map(|k| corners[k as usize])).abs())
            .sum();
        assert!((covered - whole).abs() <= 1e-9 * whole, "{covered} of {whole}");
    }
}

fn keeps_border(n: usize, faces: &[[u32; 3]]) {
    assert_eq!(faces.len(), n - 2);
    let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
    for [a, b, c] in faces {
        for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
            *edges.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    let last = n as u32 - 1;
    for (edge, sum) in edges {
        let expected = match edge {
            [a, b] if n > 2 && a == 0 && b == last => -1,
            [a, b] => i32::from(a + 1 == b),
        };
        assert_eq!(sum, expected, "{edge:?}");
    }
}

fn doubled_area(points: &[Point]) -> f64 {
    let next = points.iter().cycle().skip(1);
    points
        .iter()
        .zip(next)
        .map(|(p, q)| p[0] * q[1] - p[1] * q[0])
        .sum()
}

fn turn(a: Point, b: Point, c: Point) -> f64 {
    doubled_area(&[a, b, c])
}

/// Whether no two edges touch but neighbours at their common corner. Coordinates are small integers, so this is exact.
fn is_simple(points: &[Point]) -> bool {
    let n = points.len();
    let edge = |k: usize| (points[k], points[(k + 1) % n]);
    (0..n).all(|i| {
        let (a, b) = edge(i);
        a != b
            && (i + 1..n).all(|j| {
                let (c, d) = edge(j);
                if j == i + 1 {
                    return !is_between(a, b, d) && !is_between(c, d, a);
                }
                if i == 0 && j == n - 1 {
                    return !is_between(a, b, c) && !is_between(c, d, b);
                }
                let crosses = turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0;
                let touches =
                    is_between(a, b, c) || is_between(a, b, d) || is_between(c, d, a) || is_between(c, d, b);
                !crosses && !touches
            })
    })
}

/// Whether a point is on an edge, ends included.
fn is_between(a: Point, b: Point, p: Point) -> bool {
    let within = |k: usize| p[k] >= a[k].min(b[k]) && p[k] <= a[k].max(b[k]);
    turn(a, b, p) == 0.0 && within(0) && within(1)
}
