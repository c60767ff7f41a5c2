//! A surface as points with normals, each for an equal share of the area.

use super::cells::{Cells, Point};
use crate::mesh::TriMesh;
use crate::mesh::outward::outward_faces;
use crate::mesh::trimesh::face_area;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Steps of the R2 sequence (Roberts 2018), which spreads points evenly over a square.
const R2: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// Points on a surface in the order of its faces.
pub(super) struct OrientedPoints {
    points: Vec<Point>,
    /// Corner of the face each lies on that is nearest to it.
    corners: Vec<u32>,
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn cross(u: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ]
}

fn unit(v: [f64; 3]) -> [f32; 3] {
    let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| if norm > 0.0 { (x / norm) as f32 } else { 0.0 })
}

impl OrientedPoints {
    /// `count` points, every one at an equal step of area along the faces, in which it is placed by a sequence that fills
    /// the triangle evenly. Normals are those of the corners, summed over their faces by area, and interpolated.
    pub fn on(mesh: &TriMesh, count: usize, seed: u64) -> Self {
        let vertices = mesh.vertices();
        let on_file = |face: &&[u32; 3]| face.iter().all(|v| (*v as usize) < mesh.signature_vertices());
        let faces: Vec<[u32; 3]> = mesh.faces().iter().filter(on_file).copied().collect();
        let faces = outward_faces(vertices, &faces);
        let mut normals = vec![[0.0; 3]; vertices.len()];
        let mut area = 0.0;
        for face in &faces {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let normal = cross(minus(b, a), minus(c, a));
            area += face_area(vertices, face);
            for v in face {
                for (sum, x) in normals[*v as usize].iter_mut().zip(normal) {
                    *sum += x;
                }
            }
        }
        let normals: Vec<[f32; 3]> = normals.into_iter().map(unit).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let [start, mut s, mut t]: [f64; 3] = std::array::from_fn(|_| random.random());
        let step = area / count.max(1) as f64;
        let (mut reached, mut drawn) = (0.0, 0);
        let mut points = Self::with_capacity(count);
        for face in &faces {
            reached += face_area(vertices, face);
            while drawn < count && (drawn as f64 + start) * step < reached {
                drawn += 1;
                (s, t) = ((s + R2[0]).fract(), (t + R2[1]).fract());
                let (u, v) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                points.push(vertices, &normals, *face, [1.0 - u - v, u, v]);
            }
        }
        points
    }

    fn with_capacity(count: usize) -> Self {
        Self {
            points: Vec::with_capacity(count),
            corners: Vec::with_capacity(count),
        }
    }

    fn push(&mut self, vertices: &[[f64; 3]], normals: &[[f32; 3]], face: [u32; 3], weights: [f64; 3]) {
        let mix = |value: &dyn Fn(usize, usize) -> f64| -> [f64; 3] {
            std::array::from_fn(|k| (0..3).map(|i| weights[i] * value(face[i] as usize, k)).sum())
        };
        let nearest = (0..3)
            .max_by(|&i, &j| weights[i].total_cmp(&weights[j]))
            .unwrap_or(0);
        self.points.push(Point {
            place: mix(&|v, k| vertices[v][k]).map(|x| x as f32),
            normal: unit(mix(&|v, k| f64::from(normals[v][k]))),
        });
        self.corners.push(face[nearest]);
    }

    /// The vertex nearest to a point on its face.
    pub fn corner(&self, point: u32) -> u32 {
        self.corners[point as usize]
    }

    /// One of the points.
    pub fn point(&self, point: u32) -> &Point {
        &self.points[point as usize]
    }

    /// Averages the normals within a radius, those that look to the same side.
    pub fn smooth_normals(&mut self, radius: f64) {
        if radius <= 0.0 {
            return;
        }
        let cells = self.cells(1.0, radius);
        let reach = (radius * radius) as f32;
        let smoothed = |at: &Point| {
            let mut sum = [0.0f32; 3];
            cells.each_near(at.place, radius as f32, |near| {
                for (i, x) in near[0].iter().enumerate() {
                    let place = [*x, near[1][i], near[2][i]];
                    let normal = [near[3][i], near[4][i], near[5][i]];
                    let (mut distance2, mut facing) = (0.0, 0.0);
                    for k in 0..3 {
                        distance2 += (place[k] - at.place[k]).powi(2);
                        facing += normal[k] * at.normal[k];
                    }
                    if facing > 0.0 && distance2 < reach {
                        let share = 1.0 - distance2 / reach;
                        (0..3).for_each(|k| sum[k] += share * normal[k]);
                    }
                }
            });
            unit(sum.map(f64::from))
        };
        let normals: Vec<[f32; 3]> = self.points.iter().map(smoothed).collect();
        for (point, normal) in self.points.iter_mut().zip(normals) {
            point.normal = normal;
        }
    }

    /// At most `count` points spread evenly over the surface; all where `count` is 0.
    pub fn keypoints(&self, count: usize) -> Vec<u32> {
        let n = self.points.len();
        let count = if count == 0 { n } else { count.min(n) };
        (0..count).map(|i| (i * n / count) as u32).collect()
    }

    /// One of `step` points, in cells made for a search radius.
    pub fn cells(&self, step: f64, radius: f64) -> Cells {
        let kept = (self.points.len() as f64 / step.max(1.0)).ceil() as usize;
        let points = (0..kept).map(|i| self.points[((i as f64 * step) as usize).min(self.points.len() - 1)]);
        Cells::new(points, radius)
    }
}
