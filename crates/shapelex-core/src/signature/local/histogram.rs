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

/// A point of the neighbourhood as the keypoint sees it.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// Squared distance over r².
    distance2: f32,
    /// Cosine between the normals.
    angle: f32,
    /// Height above the tangent plane over r.
    height: f32,
}

/// Counts neighbourhoods of one radius.
pub(super) struct Histogram {
    radius: f32,
    seen: Vec<Seen>,
    counts: [f32; BINS],
}

/// The bin below a value from 0 to 1 and the share of the one above it.
#[inline(always)]
fn interpolate(value: f32, bins: usize) -> (usize, f32) {
    let at = (value * (bins - 1) as f32).clamp(0.0, (bins - 1) as f32);
    let below = (at as usize).min(bins.saturating_sub(2));
    (below, at - below as f32)
}

impl Histogram {
    pub fn new(radius: f64) -> Self {
        Self {
            radius: radius as f32,
            seen: Vec::new(),
            counts: [0.0; BINS],
        }
    }

    /// Counts what is near a keypoint: distances into bins, angles and heights between two.
    pub fn fill(&mut self, cells: &Cells, at: &Point, out: &mut [f64]) {
        self.see(cells, at);
        self.counts.fill(0.0);
        for seen in &self.seen {
            let d = ((seen.distance2.sqrt() * DISTANCES as f32) as usize).min(DISTANCES - 1);
            let (a, above) = interpolate(0.5 * seen.angle + 0.5, ANGLES);
            let (h, over) = interpolate(0.5 * seen.height + 0.5, HEIGHTS);
            let first = (d * ANGLES + a) * HEIGHTS + h;
            let (w0, w1) = (1.0 - above, above);
            self.counts[first] += w0 * (1.0 - over);
            self.counts[first + 1] += w0 * over;
            self.counts[first + HEIGHTS] += w1 * (1.0 - over);
            self.counts[first + HEIGHTS + 1] += w1 * over;
        }
        for (out, count) in out.iter_mut().zip(&self.counts) {
            *out = f64::from(*count);
        }
    }

    /// Collects the points within the radius, but for the keypoint itself.
    fn see(&mut self, cells: &Cells, at: &Point) {
        self.seen.clear();
        let inverse = 1.0 / self.radius;
        let seen = &mut self.seen;
        cells.each_near(at.place, self.radius, |points| {
            let mut kept = seen.len();
            seen.resize(kept + points.len(), Seen::default());
            for point in points {
                let d: [f32; 3] = std::array::from_fn(|k| (point.place[k] - at.place[k]) * inverse);
                let dot = |a: &[f32; 3], b: &[f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let distance2 = dot(&d, &d);
                seen[kept] = Seen {
                    distance2,
                    angle: dot(&point.normal, &at.normal),
                    height: dot(&d, &at.normal),
                };
                kept += usize::from(distance2 < 1.0 && distance2 > 0.0);
            }
            seen.truncate(kept);
        });
    }
}
