//! What one side sees.

use super::geometry::{map, rotation};
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::TriangleSoup;

/// Pixels across the longer side of the picture.
const PIXELS: usize = 400;
/// Depths closer than this many pixels count as the same surface.
const DEPTH_SLACK: f64 = 1.5;

/// The faces visible from a viewpoint at infinity. Each strength is another random viewpoint: a view has no strength.
///
/// A picture of depths is drawn; a face is kept if its centroid or a corner-near point of it lies at the front.
pub fn visible(null: &TriangleSoup, _strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let Picture { points, width, depth } = Picture::take(null, rng);
    let front = |p: [f64; 3]| {
        let (x, y) = ((p[0] + 0.5) as usize, (p[1] + 0.5) as usize);
        let nearest = depth[y.min(width - 1) * width + x.min(width - 1)];
        p[2] >= nearest - DEPTH_SLACK
    };
    let faces = null
        .faces
        .iter()
        .copied()
        .filter(|f| {
            let corners = f.map(|v| points[v as usize]);
            let centroid: [f64; 3] =
                std::array::from_fn(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
            let towards = |c: [f64; 3]| std::array::from_fn(|k| 0.25 * centroid[k] + 0.75 * c[k]);
            front(centroid) || corners.into_iter().filter(|&c| front(towards(c))).count() >= 2
        })
        .collect();
    TriangleSoup {
        vertices: null.vertices.clone(),
        faces,
        ..TriangleSoup::default()
    }
}

/// A picture of depths from a random viewpoint at infinity.
pub struct Picture {
    /// The vertices, turned to the camera: pixels to the right, pixels up, and nearness in pixels.
    pub points: Vec<[f64; 3]>,
    /// Pixels in a row.
    pub width: usize,
    /// Nearness of the surface, row by row; −∞ where there is none.
    pub depth: Vec<f64>,
}

impl Picture {
    /// Draws all faces.
    pub fn take(null: &TriangleSoup, rng: &mut ChaCha8Rng) -> Self {
        let camera = rotation(rng);
        let seen: Vec<[f64; 3]> = null.vertices.iter().map(|p| map(&camera, p)).collect();
        let bound =
            |k: usize, pick: fn(f64, f64) -> f64, start: f64| seen.iter().map(|p| p[k]).fold(start, pick);
        let low = [
            bound(0, f64::min, f64::INFINITY),
            bound(1, f64::min, f64::INFINITY),
        ];
        let high = [
            bound(0, f64::max, f64::NEG_INFINITY),
            bound(1, f64::max, f64::NEG_INFINITY),
        ];
        let pixel = ((high[0] - low[0]).max(high[1] - low[1]) / PIXELS as f64).max(f64::MIN_POSITIVE);
        let points: Vec<[f64; 3]> = seen
            .iter()
            .map(|p| [(p[0] - low[0]) / pixel, (p[1] - low[1]) / pixel, p[2] / pixel])
            .collect();
        let width = PIXELS + 1;
        let mut depth = vec![f64::NEG_INFINITY; width * width];
        for f in &null.faces {
            draw(&f.map(|v| points[v as usize]), width, &mut depth);
        }
        Self { points, width, depth }
    }
}

/// Draws one triangle into the picture of depths; greater is nearer.
fn draw(corners: &[[f64; 3]; 3], width: usize, depth: &mut [f64]) {
    let [a, b, c] = corners;
    let twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    if twice == 0.0 {
        return;
    }
    let range = |k: usize| {
        let low = a[k].min(b[k]).min(c[k]).ceil().max(0.0) as usize;
        let high = a[k].max(b[k]).max(c[k]).floor().max(0.0) as usize;
        low..=high.min(width - 1)
    };
    for y in range(1) {
        for x in range(0) {
            let (px, py) = (x as f64, y as f64);
            let u = ((px - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (py - a[1])) / twice;
            let v = ((b[0] - a[0]) * (py - a[1]) - (px - a[0]) * (b[1] - a[1])) / twice;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                let z = a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]);
                let slot = &mut depth[y * width + x];
                *slot = slot.max(z);
            }
        }
    }
}
