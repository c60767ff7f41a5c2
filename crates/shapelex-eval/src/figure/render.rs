//! A mesh → the triangles of it that are seen, shaded, from behind to front.

use super::FigureError;
use super::vector::{Vector, cross, dot, minus, unit};
use super::visibility::seen_faces;
use faer::{Mat, Side};
use shapelex_core::mesh::TriMesh;
use shapelex_core::mesh::boundary::boundary_vertices;

/// Turned about the upright axis, so that a side view shows depth; 25°.
const YAW: f64 = 0.436;
/// Seen from a little above; 12°.
const PITCH: f64 = 0.209;
/// Towards the light, in the viewer's frame: from the upper left, behind the viewer.
const LIGHT: Vector = [-0.40, 0.62, 0.675];
/// Brightness of what lies in the shade.
const AMBIENT: f64 = 0.42;
/// Share of a shape's height in which its feet are looked for.
const LOWEST: f64 = 0.12;

/// From where a mesh is looked at: the rows point right, up and towards the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame([Vector; 3]);

/// A triangle as seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Facet {
    /// Corners in the mesh's unit, right and up.
    pub corners: [[f64; 2]; 3],
    /// 0 is black, 1 the colour itself.
    pub brightness: f64,
    /// Whether the inside of an open surface is seen.
    pub inside: bool,
}

impl Frame {
    /// A view that shows most of a shape, standing on its feet.
    ///
    /// Of the directions along the file's axes and the principal axes, down is the one whose outermost vertices lie
    /// farthest apart with the least between them, as feet do; heads, hands and tails come to a point, and backs are
    /// filled. The direction of least spread is not upright. The level direction of least spread points to the viewer.
    pub(super) fn of(mesh: &TriMesh) -> Result<Self, FigureError> {
        let v = mesh.vertices();
        let n = v.len() as f64;
        let mean: Vector = std::array::from_fn(|k| v.iter().map(|p| p[k]).sum::<f64>() / n);
        let centred: Vec<Vector> = v.iter().map(|p| minus(p, &mean)).collect();
        let covariance = Mat::from_fn(3, 3, |i, j| centred.iter().map(|p| p[i] * p[j]).sum::<f64>() / n);
        let eigen = covariance
            .self_adjoint_eigen(Side::Lower)
            .map_err(|error| FigureError::Embedding {
                detail: format!("{error:?}"),
            })?;
        let principal = (0..3).map(|k| std::array::from_fn(|i| eigen.U()[(i, k)]));
        let own = (0..3).map(|k| std::array::from_fn(|i| f64::from(u8::from(i == k))));
        // Nothing stands on its flat side.
        let flat: Vector = std::array::from_fn(|i| eigen.U()[(i, 0)]);
        let up = own
            .chain(principal)
            .filter(|axis| dot(axis, &flat).abs() < 0.7)
            .flat_map(|axis: Vector| [axis, axis.map(|x| -x)])
            .map(|up| (feet(&centred, &up), up))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map_or([0.0, 1.0, 0.0], |(_, up)| up);
        Ok(Self::looking(up, level(&centred, &up)[1]))
    }

    /// Looking against `sight`, with `up` upwards, then turned and tilted a little.
    fn looking(up: Vector, sight: Vector) -> Self {
        let right = cross(&up, &sight);
        let combine = |a: f64, x: &Vector, b: f64, y: &Vector| -> Vector {
            std::array::from_fn(|k| a * x[k] + b * y[k])
        };
        let (sin, cos) = YAW.sin_cos();
        let (turned_right, turned_sight) = (
            combine(cos, &right, -sin, &sight),
            combine(sin, &right, cos, &sight),
        );
        let (sin, cos) = PITCH.sin_cos();
        Self([
            turned_right,
            combine(cos, &up, -sin, &turned_sight),
            combine(sin, &up, cos, &turned_sight),
        ])
    }

    fn see(&self, p: &Vector) -> Vector {
        std::array::from_fn(|k| dot(&self.0[k], p))
    }
}

/// The level directions of most and of least spread.
fn level(centred: &[Vector], up: &Vector) -> [Vector; 2] {
    // Any axis that is not upright gives a first level direction.
    let least = (0..3)
        .min_by(|&a, &b| up[a].abs().total_cmp(&up[b].abs()))
        .unwrap_or(0);
    let first = unit(&cross(
        up,
        &std::array::from_fn(|k| f64::from(u8::from(k == least))),
    ));
    let second = cross(up, &first);
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        centred.iter().map(|p| f(dot(p, &first), dot(p, &second))).sum()
    };
    let angle = 0.5 * (2.0 * sum(&|x, y| x * y)).atan2(sum(&|x, y| x * x - y * y));
    let (sin, cos) = angle.sin_cos();
    let long: Vector = std::array::from_fn(|k| cos * first[k] + sin * second[k]);
    [long, cross(up, &long)]
}

/// How much farther apart the lowest vertices lie than if they filled the range they span evenly: the greater excess of
/// their variance over range²/12, of the two level directions.
fn feet(centred: &[Vector], up: &Vector) -> f64 {
    let range = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        })
    };
    let (low, high) = range(&mut centred.iter().map(|p| dot(p, up)));
    let lowest: Vec<&Vector> = centred
        .iter()
        .filter(|p| dot(p, up) < low + LOWEST * (high - low))
        .collect();
    let n = lowest.len().max(1) as f64;
    level(centred, up)
        .iter()
        .map(|axis| {
            let (low, high) = range(&mut lowest.iter().map(|p| dot(p, axis)));
            let mean = lowest.iter().map(|p| dot(p, axis)).sum::<f64>() / n;
            let variance = lowest.iter().map(|p| (dot(p, axis) - mean).powi(2)).sum::<f64>() / n;
            variance - (high - low).powi(2) / 12.0
        })
        .fold(f64::NEG_INFINITY, f64::max)
}

/// The triangles that own at least one pixel and those that may be seen between them, the farthest first.
/// `resolution` is the number of pixels per unit.
///
/// A triangle thinner than a pixel owns none and would be missed as a slit, through which the background shines.
pub(super) fn facets(mesh: &TriMesh, frame: &Frame, resolution: f64) -> Vec<Facet> {
    let seen: Vec<Vector> = mesh.vertices().iter().map(|p| frame.see(p)).collect();
    let open = boundary_vertices(mesh).contains(&true);
    let outward = if volume(mesh) < 0.0 { -1.0 } else { 1.0 };
    let visible = seen_faces(&seen, mesh.faces(), resolution, (!open).then_some(outward));
    let mut found: Vec<(f64, Facet)> = mesh
        .faces()
        .iter()
        .zip(visible)
        .filter(|(_, visible)| *visible)
        .map(|(face, _)| {
            let [a, b, c] = face.map(|v| seen[v as usize]);
            let normal = unit(&cross(&minus(&b, &a), &minus(&c, &a)));
            let facing = if normal[2] < 0.0 { -1.0 } else { 1.0 };
            let light = dot(&normal, &LIGHT) * facing;
            let facet = Facet {
                corners: [a, b, c].map(|p| [p[0], p[1]]),
                brightness: AMBIENT + (1.0 - AMBIENT) * light.max(0.0),
                inside: open && facing * outward < 0.0,
            };
            ((a[2] + b[2] + c[2]) / 3.0, facet)
        })
        .collect();
    found.sort_by(|x, y| x.0.total_cmp(&y.0));
    found.into_iter().map(|(_, facet)| facet).collect()
}

/// Six times the enclosed volume; for an open surface its sign still tells outside from inside, mostly.
fn volume(mesh: &TriMesh) -> f64 {
    let v = mesh.vertices();
    mesh.faces()
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(|k| v[k as usize]);
            dot(&a, &cross(&b, &c))
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::super::visibility::height_at;
    use super::*;

    /// A box of 4 × 2 × 1 with one corner at the origin.
    fn cuboid() -> TriMesh {
        let vertices = (0..8)
            .map(|i| [4.0 * f64::from(i & 1), f64::from(i & 2), f64::from(i >> 2)])
            .collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let faces = quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .collect();
        TriMesh::new(vertices, faces, 8).unwrap()
    }

    #[test]
    fn the_frame_is_a_rotation() {
        let Frame(rows) = Frame::of(&cuboid()).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((dot(&rows[i], &rows[j]) - expected).abs() < 1e-12);
            }
        }
        assert!((dot(&cross(&rows[0], &rows[1]), &rows[2]) - 1.0).abs() < 1e-12);
    }

    fn covers(mut triangles: impl Iterator<Item = [Vector; 3]>, x: f64, y: f64) -> bool {
        triangles.any(|corners| height_at(&corners, x, y).is_some())
    }

    /// A wavy, closed surface of revolution with slivers among its triangles.
    fn vase() -> TriMesh {
        let (rings, around) = (60u32, 37u32);
        let mut vertices = vec![[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]];
        for i in 1..rings {
            let t = f64::from(i) / f64::from(rings);
            // Rings in pairs, so that every second band is thin.
            let z = -1.0 + 2.0 * (t - 0.4 * f64::from(i % 2) / f64::from(rings));
            let radius = (std::f64::consts::PI * t).sin() * (1.0 + 0.3 * (9.0 * t).sin());
            for k in 0..around {
                let angle = std::f64::consts::TAU * f64::from(k) / f64::from(around);
                vertices.push([radius * angle.cos(), radius * angle.sin(), z]);
            }
        }
        let at = |i: u32, k: u32| 2 + (i - 1) * around + k % around;
        let mut faces = Vec::new();
        for k in 0..around {
            faces.push([0, at(1, k + 1), at(1, k)]);
            faces.push([1, at(rings - 1, k), at(rings - 1, k + 1)]);
            for i in 1..rings - 1 {
                faces.push([at(i, k), at(i, k + 1), at(i + 1, k)]);
                faces.push([at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)]);
            }
        }
        TriMesh::new(vertices, faces, 10_000).unwrap()
    }

    #[test]
    fn no_background_shines_through_a_closed_surface() {
        let mesh = vase();
        let frame = Frame::looking([0.0, 0.0, 1.0], [0.0, -1.0, 0.0]);
        // As coarse as in a gallery: the thin bands own few pixels.
        let shown = facets(&mesh, &frame, 25.0);
        let all: Vec<[Vector; 3]> = mesh
            .faces()
            .iter()
            .map(|face| face.map(|v| frame.see(&mesh.vertices()[v as usize])))
            .collect();
        let lifted = |f: &Facet| f.corners.map(|[x, y]| [x, y, 0.0]);
        let mut inside = 0;
        for i in 0..120 {
            for j in 0..120 {
                let (x, y) = (
                    -1.3 + 2.6 * (f64::from(i) + 0.37) / 120.0,
                    -1.3 + 2.6 * (f64::from(j) + 0.41) / 120.0,
                );
                if covers(all.iter().copied(), x, y) {
                    inside += 1;
                    assert!(covers(shown.iter().map(lifted), x, y), "a hole at {x}, {y}");
                }
            }
        }
        assert!(inside > 2000, "{inside}");
    }

    #[test]
    fn three_sides_of_a_box_are_seen() {
        let mesh = cuboid();
        let frame = Frame::looking([0.0, 0.0, 1.0], [0.0, -1.0, 0.0]);
        let seen = facets(&mesh, &frame, 40.0);
        assert_eq!(seen.len(), 6, "{seen:?}");
        assert!(seen.iter().all(|f| !f.inside && f.brightness <= 1.0));
        // Without its lid the inside shows.
        let open = TriMesh::new(
            mesh.vertices().to_vec(),
            mesh.faces()[..2]
                .iter()
                .chain(&mesh.faces()[4..])
                .copied()
                .collect(),
            8,
        )
        .unwrap();
        assert!(facets(&open, &frame, 40.0).iter().any(|f| f.inside));
    }
}
