//! The histogram of one neighbourhood.

use super::cells::{Cells, Point};

/// Bins of distance.
const DISTANCES: usize = 4;
/// Bins of the angle between normals.
const ANGLES: usize = 9;
/// Bins of the height.
const HEIGHTS: usize = 7;
/// Bins of a histogram.
pub(super) const BINS: usize = DISTANCES * ANGLES * HEIGHTS;

/// Points as a keypoint sees them, each value by itself for wide registers.
#[derive(Default)]
struct Seen {
    /// Squared distance over r².
    distance2: Vec<f32>,
    /// Cosine between the normals.
    angle: Vec<f32>,
    /// Height above the tangent plane over r.
    height: Vec<f32>,
}

/// Counts neighbourhoods of one radius.
pub(super) struct Histogram {
    radius: f32,
    seen: Seen,
    /// The first of the four bins of each point seen.
    first: Vec<i32>,
    /// The points within the radius, in front.
    kept: Vec<u32>,
    counts: [f32; BINS],
}

/// The place of a value from −1 to 1 among `bins` bins: the bin below it, and the share of the one above.
#[inline(always)]
fn interpolate(value: f32, bins: usize) -> (i32, f32) {
    let at = ((0.5 * value + 0.5) * (bins - 1) as f32).clamp(0.0, (bins - 1) as f32);
    let below = (at as i32).min(bins as i32 - 2);
    (below, at - below as f32)
}

impl Histogram {
    /// For neighbourhoods of a radius among the points of some cells.
    pub fn new(radius: f64, cells: &Cells) -> Self {
        let room = || vec![0.0; cells.len()];
        Self {
            radius: radius as f32,
            seen: Seen {
                distance2: room(),
                angle: room(),
                height: room(),
            },
            first: vec![0; cells.len()],
            kept: vec![0; cells.len()],
            counts: [0.0; BINS],
        }
    }

    /// Counts what is near a keypoint: distances into bins, angles and heights between two.
    pub fn fill(&mut self, cells: &Cells, at: &Point, out: &mut [f64]) {
        let seen = self.see(cells, at);
        let kept = self.keep(seen);
        self.counts.fill(0.0);
        for &i in &self.kept[..kept] {
            let i = i as usize;
            let (a, h) = (self.seen.angle[i], self.seen.height[i]);
            let first = self.first[i] as usize;
            // One check of the limits for all four.
            let Some(bins) = self.counts.get_mut(first..first + HEIGHTS + 2) else {
                continue;
            };
            bins[0] += (1.0 - a) * (1.0 - h);
            bins[1] += (1.0 - a) * h;
            bins[HEIGHTS] += a * (1.0 - h);
            bins[HEIGHTS + 1] += a * h;
        }
        for (out, count) in out.iter_mut().zip(&self.counts) {
            *out = f64::from(*count);
        }
    }

    /// Compares the points of the cells around a keypoint with it; returns how many.
    fn see(&mut self, cells: &Cells, at: &Point) -> usize {
        let inverse = 1.0 / self.radius;
        let Seen {
            distance2,
            angle,
            height,
        } = &mut self.seen;
        let mut seen = 0;
        cells.each_near(at.place, self.radius, |[x, y, z, u, v, w]| {
            let to = seen + x.len();
            let (d2, a, h) = (
                &mut distance2[seen..to],
                &mut angle[seen..to],
                &mut height[seen..to],
            );
            for i in 0..x
                .len()
                .min(y.len())
                .min(z.len())
                .min(u.len())
                .min(v.len())
                .min(w.len())
            {
                let [p, q, r] =
                    [x[i] - at.place[0], y[i] - at.place[1], z[i] - at.place[2]].map(|d| d * inverse);
                d2[i] = p * p + q * q + r * r;
                a[i] = u[i] * at.normal[0] + v[i] * at.normal[1] + w[i] * at.normal[2];
                h[i] = p * at.normal[0] + q * at.normal[1] + r * at.normal[2];
            }
            seen = to;
        });
        seen
    }

    /// Finds the bins of all points seen, in place of angle and height the shares of the bins above, and which of them are
    /// within the radius and not the keypoint itself; returns how many.
    fn keep(&mut self, seen: usize) -> usize {
        let Seen {
            distance2,
            angle,
            height,
        } = &mut self.seen;
        let (distance2, angle, height) = (&distance2[..seen], &mut angle[..seen], &mut height[..seen]);
        let first = &mut self.first[..seen];
        for i in 0..seen {
            let d = ((distance2[i].sqrt() * DISTANCES as f32) as i32).min(DISTANCES as i32 - 1);
            let (a, above) = interpolate(angle[i], ANGLES);
            let (h, over) = interpolate(height[i], HEIGHTS);
            first[i] = (d * ANGLES as i32 + a) * HEIGHTS as i32 + h;
            (angle[i], height[i]) = (above, over);
        }
        let mut kept = 0;
        for (i, distance2) in distance2.iter().enumerate() {
            self.kept[kept] = i as u32;
            kept += usize::from(*distance2 < 1.0 && *distance2 > 0.0);
        }
        kept
    }
}
