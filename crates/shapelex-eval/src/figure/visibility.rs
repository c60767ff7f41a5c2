//! Which triangles of a mesh are seen.

use super::vector::{Vector, cross, minus};

/// The triangles that own at least one pixel and those that may be seen between them. `seen` are the vertices in the
/// viewer's frame, `resolution` is the number of pixels per unit; `outward` tells, for a closed surface, whether corners
/// run counterclockwise as seen from outside (1) or clockwise (−1).
pub(super) fn seen_faces(
    seen: &[Vector],
    faces: &[[u32; 3]],
    resolution: f64,
    outward: Option<f64>,
) -> Vec<bool> {
    let (owners, depth) = visible(seen, faces, resolution);
    match outward {
        None => with_neighbours(seen, faces, owners),
        Some(outward) => with_front(seen, faces, owners, &depth, outward),
    }
}

/// Whether a triangle shows the viewer the side its corners run around counterclockwise.
fn faces_viewer(seen: &[Vector], face: &[u32; 3]) -> bool {
    let [a, b, c] = face.map(|v| seen[v as usize]);
    cross(&minus(&b, &a), &minus(&c, &a))[2] >= 0.0
}

/// The visible triangles, and those that share a corner with one and face the same way.
fn with_neighbours(seen: &[Vector], faces: &[[u32; 3]], visible: Vec<bool>) -> Vec<bool> {
    // Per vertex: whether it belongs to a visible triangle that faces away, and towards the viewer.
    let mut touched = vec![[false; 2]; seen.len()];
    for (face, _) in faces.iter().zip(&visible).filter(|(_, visible)| **visible) {
        let side = usize::from(faces_viewer(seen, face));
        for &v in face {
            touched[v as usize][side] = true;
        }
    }
    let near = |face: &[u32; 3]| {
        let side = usize::from(faces_viewer(seen, face));
        face.iter().any(|&v| touched[v as usize][side])
    };
    faces
        .iter()
        .zip(visible)
        .map(|(face, visible)| visible || near(face))
        .collect()
}

/// The visible triangles of a closed surface, and those whose outside faces the viewer and is not hidden everywhere.
fn with_front(
    seen: &[Vector],
    faces: &[[u32; 3]],
    visible: Vec<bool>,
    depth: &Depth,
    outward: f64,
) -> Vec<bool> {
    let front = |face: &[u32; 3]| faces_viewer(seen, face) == (outward > 0.0);
    let hidden = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| seen[v as usize]);
        let middle = |p: &Vector, q: &Vector| -> Vector { std::array::from_fn(|k| 0.5 * (p[k] + q[k])) };
        let centre: Vector = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
        let points = [a, b, c, middle(&a, &b), middle(&b, &c), middle(&c, &a), centre];
        points.iter().all(|p| depth.hides(p))
    };
    faces
        .iter()
        .zip(visible)
        .map(|(face, visible)| visible || (front(face) && !hidden(face)))
        .collect()
}

/// Pixels around a point that have to be covered too before it counts as hidden: at an outline a pixel may be taken by a
/// triangle that covers only a part of it.
const AROUND: usize = 2;

/// How near to the viewer the nearest triangle is at every pixel; minus infinity where there is none.
struct Depth {
    values: Vec<f64>,
    columns: usize,
    rows: usize,
    left: f64,
    low: f64,
    resolution: f64,
}

impl Depth {
    /// Whether something nearer covers a point's pixel and all around it.
    fn hides(&self, p: &Vector) -> bool {
        let around = |at: f64, from: f64, cells: usize| {
            let cell = (((at - from) * self.resolution).max(0.0) as usize).min(cells - 1);
            cell.saturating_sub(AROUND)..=(cell + AROUND).min(cells - 1)
        };
        let columns = around(p[0], self.left, self.columns);
        // A surface that is level with the pixel's centre is not in front of itself.
        let nearer = p[2] + AROUND as f64 / self.resolution;
        around(p[1], self.low, self.rows).all(|y| {
            columns
                .clone()
                .all(|x| self.values[y * self.columns + x] > nearer)
        })
    }
}

/// Which faces are nearest to the viewer at some pixel's centre, or at their own, and how near that is.
fn visible(seen: &[Vector], faces: &[[u32; 3]], resolution: f64) -> (Vec<bool>, Depth) {
    let bound =
        |axis: usize, pick: fn(f64, f64) -> f64| seen.iter().map(|p| p[axis]).reduce(pick).unwrap_or(0.0);
    let (left, low) = (bound(0, f64::min), bound(1, f64::min));
    let cells = |from: f64, to: f64| ((to - from) * resolution).clamp(0.0, 2000.0) as usize + 1;
    let (columns, rows) = (cells(left, bound(0, f64::max)), cells(low, bound(1, f64::max)));
    let mut depth = vec![f64::NEG_INFINITY; columns * rows];
    let mut owner = vec![usize::MAX; columns * rows];
    for (i, face) in faces.iter().enumerate() {
        let corners = face.map(|v| {
            let p = seen[v as usize];
            [(p[0] - left) * resolution, (p[1] - low) * resolution, p[2]]
        });
        let range = |axis: usize, cells: usize| {
            let values = corners.map(|c| c[axis]);
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(0.0, f64::max);
            (least.max(0.0) as usize).min(cells - 1)..=(most as usize).min(cells - 1)
        };
        let mut claim = |x: usize, y: usize, z: f64| {
            let at = y * columns + x;
            if z > depth[at] {
                depth[at] = z;
                owner[at] = i;
            }
        };
        for y in range(1, rows) {
            for x in range(0, columns) {
                if let Some(z) = height_at(&corners, x as f64 + 0.5, y as f64 + 0.5) {
                    claim(x, y, z);
                }
            }
        }
        let centre: Vector = std::array::from_fn(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 3.0);
        claim(
            (centre[0] as usize).min(columns - 1),
            (centre[1] as usize).min(rows - 1),
            centre[2],
        );
    }
    let mut visible = vec![false; faces.len()];
    for i in owner.into_iter().filter(|&i| i != usize::MAX) {
        visible[i] = true;
    }
    let depth = Depth {
        values: depth,
        columns,
        rows,
        left,
        low,
        resolution,
    };
    (visible, depth)
}

/// The third coordinate of a triangle over a point of the first two; `None` outside of it or where it is seen edge-on.
pub(super) fn height_at(corners: &[Vector; 3], x: f64, y: f64) -> Option<f64> {
    let [a, b, c] = corners;
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    let part = |p: &Vector, q: &Vector| ((p[0] - x) * (q[1] - y) - (q[0] - x) * (p[1] - y)) / area;
    let (u, v, w) = (part(b, c), part(c, a), part(a, b));
    (area != 0.0 && u >= 0.0 && v >= 0.0 && w >= 0.0).then(|| u * a[2] + v * b[2] + w * c[2])
}
