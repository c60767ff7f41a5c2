//! The implicit body: a smooth union of posed solids.
//!
//! Every solid has a field close to its signed distance (negative inside). Fields are united one after another by
//! the quadratic polynomial minimum: with h = max(k − |a − b|, 0) / k it is min(a, b) − h² k / 4. Its support is
//! compact: a solid further than k above the minimum changes nothing, so whole regions of space need only look at a
//! few solids.

use super::skeleton::{Skeleton, Solid};
use super::vector::{Motion, Vec3, add_scaled, dot, norm, scale, sub};

/// A bound on how fast a solid's field changes per unit of length. The fields are not exact distances; this leaves
/// room for the worst taper and the flattest ellipsoid in use.
const LIPSCHITZ: f64 = 1.4;

#[derive(Clone, Copy, Debug)]
struct Posed {
    bone: usize,
    solid: Solid,
    blend: f64,
}

/// A posed creature as a function of space.
#[derive(Clone, Debug)]
pub struct Body {
    parts: Vec<Posed>,
}

impl Body {
    /// Carries every part of the skeleton along with its bone. `placements` has one motion per bone.
    pub fn new(skeleton: &Skeleton, placements: &[Motion]) -> Self {
        let parts: Vec<Posed> = skeleton
            .parts
            .iter()
            .map(|part| Posed {
                bone: part.bone,
                solid: moved(part.solid, &placements[part.bone]),
                blend: part.blend,
            })
            .collect();
        Self { parts }
    }

    /// Indices of all parts: the list to start pruning from.
    pub fn all_parts(&self) -> Vec<u16> {
        (0..self.parts.len() as u16).collect()
    }

    /// The smallest axis-aligned box around all solids, as lower and upper corner.
    pub fn bounds(&self) -> [Vec3; 2] {
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for part in &self.parts {
            for (centre, radius) in balls(&part.solid) {
                for i in 0..3 {
                    bounds[0][i] = bounds[0][i].min(centre[i] - radius);
                    bounds[1][i] = bounds[1][i].max(centre[i] + radius);
                }
            }
        }
        bounds
    }

    /// A rough surface area: that of all solids, without what the union hides.
    pub fn rough_area(&self) -> f64 {
        use std::f64::consts::PI;
        self.parts
            .iter()
            .map(|part| match part.solid {
                Solid::Cone { ends, radius } => PI * (radius[0] + radius[1]) * norm(sub(ends[1], ends[0])),
                Solid::Ellipsoid { radii: [a, b, c], .. } => {
                    // Knud Thomsen's approximation.
                    let p = 1.6075;
                    let mean = ((a * b).powf(p) + (a * c).powf(p) + (b * c).powf(p)) / 3.0;
                    4.0 * PI * mean.powf(1.0 / p)
                }
            })
            .sum()
    }

    /// The field at a point, looking only at the listed parts.
    pub fn value(&self, p: Vec3, parts: &[u16]) -> f64 {
        let mut d = f64::INFINITY;
        for &i in parts {
            let part = &self.parts[i as usize];
            let e = field(&part.solid, p);
            let gap = (d - e).abs();
            d = d.min(e);
            if gap < part.blend {
                let h = part.blend - gap;
                d -= h * h / (4.0 * part.blend);
            }
        }
        d
    }

    /// The field and its gradient (of about unit length), looking at all parts.
    pub fn value_and_gradient(&self, p: Vec3) -> (f64, Vec3) {
        let (mut d, mut g) = (f64::INFINITY, [0.0; 3]);
        for part in &self.parts {
            let e = field(&part.solid, p);
            if e >= d + part.blend {
                continue;
            }
            let n = direction(&part.solid, p);
            let gap = (d - e).abs();
            let h = (1.0 - gap / part.blend).max(0.0);
            let weight = if e < d { 1.0 - 0.5 * h } else { 0.5 * h };
            g = add_scaled(scale(g, 1.0 - weight), n, weight);
            d = d.min(e) - 0.25 * h * h * part.blend;
        }
        (d, g)
    }

    /// What of `parts` can matter within `radius` of `centre`, or `None` when the surface cannot pass there.
    pub fn prune(&self, centre: Vec3, radius: f64, parts: &[u16]) -> Option<Vec<u16>> {
        let reach = LIPSCHITZ * radius;
        // The union grows no faster than its parts: its gradient is a weighted mean of theirs.
        if self.value(centre, parts).abs() > reach {
            return None;
        }
        let part = |i: u16| &self.parts[i as usize];
        let values: Vec<f64> = parts.iter().map(|&i| field(&part(i).solid, centre)).collect();
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        // A part flows into the minimum within its own blend. The union takes parts in order, not by distance, so
        // the minimum may come later and then looks back as far as the widest blend around.
        let widest = parts.iter().map(|&i| part(i).blend).fold(0.0, f64::max);
        Some(
            parts
                .iter()
                .zip(&values)
                .filter(|&(&i, &v)| v - reach <= least + reach + part(i).blend + widest)
                .map(|(&i, _)| i)
                .collect(),
        )
    }

    /// The gap between two parts: the distance between the surfaces of the capsules that stand for them, negative
    /// when they overlap.
    pub fn gap(&self, i: usize, j: usize) -> f64 {
        let [a, b] = [i, j].map(|k| spine(&self.parts[k].solid));
        let (s, t, distance) = segment_distance(a.0, a.1, b.0, b.1);
        distance - (a.2 + s * (a.3 - a.2)) - (b.2 + t * (b.3 - b.2))
    }

    /// All pairs of parts on different bones, with their gaps.
    pub fn gaps(&self) -> Vec<(usize, usize, f64)> {
        (0..self.parts.len())
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .filter(|&(i, j)| self.parts[i].bone != self.parts[j].bone)
            .map(|(i, j)| (i, j, self.gap(i, j)))
            .collect()
    }

    /// The wider of two parts' blends: below this gap their surfaces begin to flow together.
    pub fn blend(&self, i: usize, j: usize) -> f64 {
        self.parts[i].blend.max(self.parts[j].blend)
    }
}

fn moved(solid: Solid, motion: &Motion) -> Solid {
    match solid {
        Solid::Cone { ends, radius } => Solid::Cone {
            ends: ends.map(|p| motion.apply(p)),
            radius,
        },
        Solid::Ellipsoid { centre, frame, radii } => Solid::Ellipsoid {
            centre: motion.apply(centre),
            frame: motion.rotation.then_inner(&frame),
            radii,
        },
    }
}

/// Parameter in 0..=1 of the point of the segment a–b nearest to p.
fn nearest_on_segment(p: Vec3, a: Vec3, b: Vec3) -> f64 {
    let u = sub(b, a);
    let length = dot(u, u);
    if length > 0.0 {
        (dot(sub(p, a), u) / length).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

fn field(solid: &Solid, p: Vec3) -> f64 {
    match *solid {
        Solid::Cone { ends: [a, b], radius } => {
            let t = nearest_on_segment(p, a, b);
            let centre = add_scaled(a, sub(b, a), t);
            norm(sub(p, centre)) - (radius[0] + t * (radius[1] - radius[0]))
        }
        Solid::Ellipsoid { centre, frame, radii } => {
            let v = sub(p, centre);
            let largest = radii[0].max(radii[1]).max(radii[2]);
            let smallest = radii[0].min(radii[1]).min(radii[2]);
            let ball = (norm(v) - largest).max(-smallest);
            let q = frame.apply_transposed(v);
            let f = norm([q[0] / radii[0], q[1] / radii[1], q[2] / radii[2]]);
            let slope = norm([
                q[0] / (radii[0] * radii[0]),
                q[1] / (radii[1] * radii[1]),
                q[2] / (radii[2] * radii[2]),
            ]);
            // f (f − 1) / |∇| is the distance to first order. Far outside a flat ellipsoid it is too small; there the
            // distance to the ball around it is better. Deep inside it goes below the smallest half-axis, the
            // greatest depth there is.
            if slope > 0.0 {
                (f * (f - 1.0) / slope).max(ball)
            } else {
                ball
            }
        }
    }
}

/// Direction in which a solid's field grows.
fn direction(solid: &Solid, p: Vec3) -> Vec3 {
    let v = match *solid {
        Solid::Cone { ends: [a, b], .. } => sub(p, add_scaled(a, sub(b, a), nearest_on_segment(p, a, b))),
        Solid::Ellipsoid { centre, frame, radii } => {
            let q = frame.apply_transposed(sub(p, centre));
            frame.apply(std::array::from_fn(|i| q[i] / (radii[i] * radii[i])))
        }
    };
    let length = norm(v);
    if length > 0.0 {
        scale(v, 1.0 / length)
    } else {
        [0.0; 3]
    }
}

fn balls(solid: &Solid) -> [(Vec3, f64); 2] {
    match *solid {
        Solid::Cone { ends, radius } => [(ends[0], radius[0]), (ends[1], radius[1])],
        Solid::Ellipsoid { centre, radii, .. } => {
            let largest = radii[0].max(radii[1]).max(radii[2]);
            [(centre, largest); 2]
        }
    }
}

/// A capsule that stands for the solid: its segment and the radii at both ends. An ellipsoid's runs along its
/// longest axis, with the mean of the other two as its radius.
fn spine(solid: &Solid) -> (Vec3, Vec3, f64, f64) {
    match *solid {
        Solid::Cone { ends, radius } => (ends[0], ends[1], radius[0], radius[1]),
        Solid::Ellipsoid { centre, frame, radii } => {
            let mut order = [0, 1, 2];
            order.sort_by(|&i, &j| radii[j].total_cmp(&radii[i]));
            let mut axis = [0.0; 3];
            let r = 0.5 * (radii[order[1]] + radii[order[2]]);
            axis[order[0]] = radii[order[0]] - r;
            let half = frame.apply(axis);
            (sub(centre, half), add_scaled(centre, half, 1.0), r, r)
        }
    }
}

/// Nearest points of two segments, as parameters in 0..=1, and their distance, by alternating projections, which
/// converge because segments are convex.
fn segment_distance(a0: Vec3, a1: Vec3, b0: Vec3, b1: Vec3) -> (f64, f64, f64) {
    let at = |p: Vec3, q: Vec3, t: f64| add_scaled(p, sub(q, p), t);
    let mut best = (0.0, 0.0, f64::INFINITY);
    for start in [0.0, 1.0] {
        let mut s = start;
        let mut t = 0.0;
        for _ in 0..12 {
            t = nearest_on_segment(at(a0, a1, s), b0, b1);
            s = nearest_on_segment(at(b0, b1, t), a0, a1);
        }
        let distance = norm(sub(at(a0, a1, s), at(b0, b1, t)));
        if distance < best.2 {
            best = (s, t, distance);
        }
    }
    best
}
