//! Joint angles, drawn within their ranges, and where they take the bones.

use super::body::Body;
use super::skeleton::Skeleton;
use super::vector::{Motion, Rotation};
use rand::Rng;
use std::f64::consts::TAU;

/// Share of poses that walk or run; the others draw every joint by itself.
const WALKING: f64 = 0.5;

/// Pitch, yaw and roll of every bone, in radians.
pub type Angles = Vec<[f64; 3]>;

/// Draws one pose. Half of them are a moment of a gait: bones with a phase swing together, the rest of the body
/// moves freely. `reach` in 0..=1 shrinks all angles towards the rest pose.
pub fn draw(skeleton: &Skeleton, reach: f64, rng: &mut impl Rng) -> Angles {
    let walks = rng.random_bool(WALKING);
    let time: f64 = rng.random();
    angles(skeleton, reach, walks.then_some(time), rng)
}

/// A moment of a gait: `time` in 0..1 is the share of the stride that is over. The same random stream at another time gives
/// another moment of the same gait, in which the rest of the body is still.
pub fn stride(skeleton: &Skeleton, reach: f64, time: f64, rng: &mut impl Rng) -> Angles {
    angles(skeleton, reach, Some(time), rng)
}

fn angles(skeleton: &Skeleton, reach: f64, time: Option<f64>, rng: &mut impl Rng) -> Angles {
    let stride = rng.random_range(0.5..1.0);
    let within = |range: [f64; 2], u: f64| (range[0] + u * (range[1] - range[0])).to_radians();
    skeleton
        .bones
        .iter()
        .map(|bone| {
            // The draws come in the same number whatever the bone does, so that one joint does not disturb the next.
            let [u, v, w]: [f64; 3] = rng.random();
            let pitch = match bone.gait.zip(time) {
                Some((phase, time)) => 0.5 + 0.5 * stride * (TAU * (time + phase)).sin(),
                None => u,
            };
            [
                within(bone.range.pitch, pitch),
                within(bone.range.yaw, v),
                within(bone.range.roll, w),
            ]
            .map(|angle| reach * angle)
        })
        .collect()
}

/// Where every bone goes, given the motion of the whole creature.
pub fn place(skeleton: &Skeleton, angles: &[[f64; 3]], whole: Motion) -> Vec<Motion> {
    let mut placed: Vec<Motion> = Vec::with_capacity(skeleton.bones.len());
    for (bone, &a) in skeleton.bones.iter().zip(angles) {
        let own = Motion::about(bone.pivot, Rotation::from_angles(a));
        let above = bone.parent.map_or(whole, |p| placed[p]);
        placed.push(above.then_inner(&own));
    }
    placed
}

/// Which parts must stay apart, and how far.
///
/// Two parts that keep a distance at rest would weld if they met in a pose, and a hand welded to a hip is another
/// shape. So they keep their distance at rest, or that at which their surfaces begin to flow together if it is less.
#[derive(Clone, Debug)]
pub struct Clearance {
    pairs: Vec<(usize, usize, f64)>,
}

impl Clearance {
    /// Measures the distances at rest.
    pub fn at_rest(skeleton: &Skeleton) -> Self {
        let rest = vec![[0.0; 3]; skeleton.bones.len()];
        let still = Motion::about([0.0; 3], Rotation::IDENTITY);
        let body = Body::new(skeleton, &place(skeleton, &rest, still));
        let pairs = body
            .gaps()
            .into_iter()
            .map(|(i, j, gap)| (i, j, gap, body.blend(i, j)))
            .filter(|&(_, _, gap, blend)| gap > 0.6 * blend)
            .map(|(i, j, gap, blend)| (i, j, 0.6 * gap.min(1.2 * blend)))
            .collect();
        Self { pairs }
    }

    /// Whether no two parts are nearer than they may be.
    pub fn holds(&self, body: &Body) -> bool {
        self.pairs.iter().all(|&(i, j, least)| body.gap(i, j) >= least)
    }
}
