//! Body plans that many species share: proportions in, skeleton out.
//!
//! Lengths are in any one unit (poses are scaled at random anyway); heights are above the ground, angles in degrees.

use super::skeleton::{Range, Side, Skeleton, range};
use super::vector::{Vec3, add};

const FIXED: [f64; 2] = [0.0, 0.0];

/// A leg seen from the side, from the joint in the trunk to the toe.
#[derive(Clone, Copy, Debug)]
pub(in crate::sample) struct Leg {
    /// Radii at the upper joint, the knee or elbow, the ankle or wrist, and the foot.
    pub radii: [f64; 4],
    /// Heights of knee and ankle as shares of the upper joint's height.
    pub joints: [f64; 2],
    /// How far knee and ankle stand in front of the upper joint.
    pub forward: [f64; 2],
    /// Length of the foot, forwards from the ankle.
    pub foot: f64,
}

/// Head, in a frame whose z runs along the muzzle.
#[derive(Clone, Copy, Debug)]
pub(in crate::sample) struct Head {
    /// Half-axes of the skull: width, height, length.
    pub skull: Vec3,
    /// Length of the muzzle beyond the skull's centre, and its radii at root and tip.
    pub muzzle: [f64; 3],
    /// Angle of the muzzle below the horizontal.
    pub droop: f64,
    /// Half-axes of an ear: width, height, thickness.
    pub ear: Vec3,
    /// How far the ears lean outwards, and how far up and out on the skull they sit (shares of its half-axes).
    pub ear_set: [f64; 2],
}

/// Anything on four legs.
#[derive(Clone, Copy, Debug)]
pub(in crate::sample) struct Quadruped {
    /// Distance between shoulder and hip joints.
    pub trunk: f64,
    /// Heights of the middle of chest and rump.
    pub height: [f64; 2],
    /// Half-width and half-height of the chest.
    pub chest: [f64; 2],
    /// Half-width and half-height of the belly.
    pub belly: [f64; 2],
    /// Half-width and half-height of the rump.
    pub rump: [f64; 2],
    /// Half the distance between the fore and between the hind feet.
    pub stance: [f64; 2],
    /// Forelegs.
    pub fore: Leg,
    /// Hind legs.
    pub hind: Leg,
    /// Length of the neck, its angle above the horizontal, radii at root and head.
    pub neck: [f64; 4],
    /// Bones in the neck.
    pub neck_bones: usize,
    /// Head.
    pub head: Head,
    /// Length of the tail, its angle above the horizontal, radii at root and tip.
    pub tail: [f64; 4],
    /// Bones in the tail; none for a tail that is only a bump.
    pub tail_bones: usize,
    /// How far the legs swing from rest to either side, in degrees.
    pub swing: f64,
}

/// The bones later additions hang on.
#[derive(Clone, Debug)]
pub(in crate::sample) struct Landmarks {
    /// Rear of the trunk, the root.
    pub hips: usize,
    /// Front of the trunk.
    pub chest: usize,
    /// Head.
    pub head: usize,
    /// Middle of the skull at rest.
    pub skull: Vec3,
    /// Fore and hind legs' or arms' and legs' bones, left then right.
    pub limbs: Vec<Vec<usize>>,
}

/// A point at `length` from `from`, in the plane x = 0, at an angle above the forward horizontal.
pub(in crate::sample) fn ahead(from: Vec3, length: f64, degrees: f64) -> Vec3 {
    let (s, c) = degrees.to_radians().sin_cos();
    add(from, [0.0, length * s, length * c])
}

impl Quadruped {
    /// Builds the creature standing still.
    pub(in crate::sample) fn build(&self) -> (Skeleton, Landmarks) {
        let mut s = Skeleton::default();
        let half = 0.5 * self.trunk;
        let (front, rear) = ([0.0, self.height[0], half], [0.0, self.height[1], -half]);
        let middle = [0.0, 0.5 * (self.height[0] + self.height[1]), 0.0];

        let hips = s.bone(None, middle, Range::default());
        let [w, h] = self.rump;
        s.ellipsoid(hips, rear, [w, h, 0.42 * self.trunk], [0.0; 3]);
        let [w, h] = self.belly;
        s.ellipsoid(hips, middle, [w, h, 0.55 * self.trunk], [0.0; 3]);
        let chest = s.bone(
            Some(hips),
            middle,
            range([-8.0, 12.0], [-14.0, 14.0], [-6.0, 6.0]),
        );
        let [w, h] = self.chest;
        s.ellipsoid(chest, front, [w, h, 0.42 * self.trunk], [0.0; 3]);

        let mut limbs = Vec::new();
        let legs = [
            (chest, &self.fore, front, self.stance[0]),
            (hips, &self.hind, rear, self.stance[1]),
        ];
        for (pair, &(bone, leg, joint, stance)) in legs.iter().enumerate() {
            for side in Side::BOTH {
                let phase = if side == Side::Left { 0.0 } else { 0.5 } + 0.3 * pair as f64;
                let chain = leg.attach(
                    &mut s,
                    side,
                    &Hip {
                        bone,
                        joint: [stance, joint[1], joint[2]],
                        swing: self.swing,
                        hind: pair == 1,
                    },
                );
                s.walks(&chain[..2], phase);
                limbs.push(chain);
            }
        }

        let [length, angle, r0, r1] = self.neck;
        let root = add(front, [0.0, 0.35 * self.chest[1], 0.2 * self.trunk]);
        let points: Vec<(Vec3, f64)> = (0..=self.neck_bones)
            .map(|i| {
                let t = i as f64 / self.neck_bones as f64;
                (ahead(root, t * length, angle), r0 + t * (r1 - r0))
            })
            .collect();
        let give = 1.0 / self.neck_bones as f64;
        let bend = range(
            [-30.0 * give, 45.0 * give],
            [-40.0 * give, 40.0 * give],
            [-10.0 * give, 10.0 * give],
        );
        let neck = s.chain(chest, Side::Left, &points, &[bend]);
        let (top, above) = (points[self.neck_bones].0, neck.last().copied().unwrap_or(chest));
        let (head, skull) = self.head.attach(&mut s, above, top);

        if self.tail_bones > 0 {
            let root = add(rear, [0.0, 0.4 * self.rump[1], -0.32 * self.trunk]);
            s.tail(hips, root, self.tail, self.tail_bones);
        }
        let landmarks = Landmarks {
            hips,
            chest,
            head,
            skull,
            limbs,
        };
        (s, landmarks)
    }
}

/// Where a leg hangs on the body.
struct Hip {
    bone: usize,
    joint: Vec3,
    /// How far it swings, in degrees.
    swing: f64,
    /// Hind legs bend the other way.
    hind: bool,
}

impl Leg {
    /// Hangs the leg on the body. Returns its bones.
    fn attach(&self, s: &mut Skeleton, side: Side, hip: &Hip) -> Vec<usize> {
        let Hip {
            bone,
            joint,
            swing,
            hind,
        } = *hip;
        let [x, y, z] = joint;
        let [r0, r1, r2, r3] = self.radii;
        let ankle = [x, y * self.joints[1], z + self.forward[1]];
        let toe = [x, r3, ankle[2] + self.foot];
        let points = [
            (joint, r0),
            ([x, y * self.joints[0], z + self.forward[0]], r1),
            (ankle, r2),
            (toe, r3),
        ];
        let knee = if hind { [-8.0, 45.0] } else { [-45.0, 8.0] };
        let ranges = [
            range([-swing, swing], [-5.0, 5.0], [-3.0, 12.0]),
            range(knee, FIXED, FIXED),
            range([-12.0, 30.0], FIXED, FIXED),
        ];
        s.chain(bone, side, &points, &ranges)
    }
}

impl Head {
    /// Puts the head on top of a neck. Returns its bone and the middle of the skull.
    pub(in crate::sample) fn attach(&self, s: &mut Skeleton, neck: usize, at: Vec3) -> (usize, Vec3) {
        let [w, h, l] = self.skull;
        let bone = s.bone(Some(neck), at, range([-25.0, 25.0], [-35.0, 35.0], [-15.0, 15.0]));
        let skull = ahead(at, 0.5 * l, -self.droop);
        s.ellipsoid(bone, skull, [w, h, l], [self.droop, 0.0, 0.0]);
        let [length, r0, r1] = self.muzzle;
        if length > 0.0 {
            s.cone(bone, skull, r0, ahead(skull, length, -self.droop), r1);
        }
        let [ew, eh, et] = self.ear;
        if eh > 0.0 {
            let [lean, out] = self.ear_set;
            let sit = lean.to_radians();
            let root = add(
                ahead(skull, -0.35 * l, -self.droop),
                [out * w, 0.75 * h * (1.0 - 0.6 * out * sit.sin()), 0.0],
            );
            let centre = add(root, [0.75 * eh * sit.sin(), 0.75 * eh * sit.cos(), 0.0]);
            s.ellipsoid_pair(bone, centre, [ew, eh, et], [0.0, 0.0, -lean]);
        }
        (bone, skull)
    }
}

impl Skeleton {
    /// A tail of equal bones: its length, its angle above the backward horizontal in degrees, its radius at the root and at
    /// the tip. Returns its bones.
    pub(in crate::sample) fn tail(
        &mut self,
        bone: usize,
        root: Vec3,
        [length, angle, r0, r1]: [f64; 4],
        bones: usize,
    ) -> Vec<usize> {
        let points: Vec<(Vec3, f64)> = (0..=bones)
            .map(|i| {
                let t = i as f64 / bones as f64;
                (ahead(root, t * length, 180.0 - angle), r0 + t * (r1 - r0))
            })
            .collect();
        let give = 1.0 / (bones as f64).sqrt();
        let bend = range([-25.0 * give, 25.0 * give], [-40.0 * give, 40.0 * give], FIXED);
        self.chain(bone, Side::Left, &points, &[bend])
    }
}

/// Anything upright on two legs with two arms. Heights are above the ground.
#[derive(Clone, Copy, Debug)]
pub(in crate::sample) struct Biped {
    /// Heights of hip joints, shoulder joints and chin.
    pub height: [f64; 3],
    /// Half-distance between the shoulder joints and between the hip joints.
    pub width: [f64; 2],
    /// Half-width and half-depth of pelvis, waist and chest.
    pub torso: [[f64; 2]; 3],
    /// Radii of the leg: hip, knee, ankle, toe.
    pub leg: [f64; 4],
    /// Length of the foot.
    pub foot: f64,
    /// Lengths of upper arm, forearm, hand.
    pub arm: [f64; 3],
    /// Radii of the arm: shoulder, elbow, wrist, fingertips.
    pub arm_radii: [f64; 4],
    /// Radius of the neck.
    pub neck: f64,
    /// Half-axes of the head: width, height, depth.
    pub head: Vec3,
    /// Forward lean of the trunk at rest, in degrees.
    pub lean: f64,
}

impl Biped {
    /// Builds the creature standing with its arms held off the body.
    pub(in crate::sample) fn build(&self) -> (Skeleton, Landmarks) {
        let mut s = Skeleton::default();
        let [hip, shoulder, chin] = self.height;
        let up = 90.0 - self.lean;
        let pelvis = [0.0, hip, 0.0];
        let spine = shoulder - hip;
        let at = |share: f64| ahead(pelvis, share * spine, up);

        let hips = s.bone(None, pelvis, Range::default());
        let [lower, waist, upper] = self.torso;
        s.ellipsoid(
            hips,
            at(0.02),
            [lower[0], 0.3 * spine, lower[1]],
            [self.lean, 0.0, 0.0],
        );
        s.ellipsoid(
            hips,
            at(0.35),
            [waist[0], 0.42 * spine, waist[1]],
            [self.lean, 0.0, 0.0],
        );
        let chest = s.bone(
            Some(hips),
            at(0.4),
            range([-10.0, 25.0], [-20.0, 20.0], [-10.0, 10.0]),
        );
        s.ellipsoid(
            chest,
            at(0.78),
            [upper[0], 0.36 * spine, upper[1]],
            [self.lean, 0.0, 0.0],
        );

        let mut limbs = Vec::new();
        for side in Side::BOTH {
            limbs.push(self.attach_arm(&mut s, chest, side, at(0.93)));
        }
        for side in Side::BOTH {
            let x = self.width[1];
            let [r0, r1, r2, r3] = self.leg;
            let points = [
                ([x, hip - 0.02 * spine, 0.0], r0),
                ([1.25 * x, 0.53 * hip, 0.01], r1),
                ([1.4 * x, 0.07 * hip, -0.02], r2),
                ([1.5 * x, r3, self.foot - 0.02], r3),
            ];
            let ranges = [
                range([-55.0, 20.0], [-8.0, 8.0], [-2.0, 22.0]),
                range([0.0, 75.0], FIXED, FIXED),
                range([-15.0, 20.0], FIXED, FIXED),
            ];
            let leg = s.chain(hips, side, &points, &ranges);
            s.walks(&leg[..2], if side == Side::Left { 0.0 } else { 0.5 });
            limbs.push(leg);
        }

        let root = at(1.0);
        let neck = s.bone(
            Some(chest),
            root,
            range([-12.0, 20.0], [-30.0, 30.0], [-12.0, 12.0]),
        );
        let [w, h, d] = self.head;
        let skull = add(
            root,
            [
                0.0,
                chin - shoulder + h,
                0.25 * d + 0.3 * self.lean.to_radians() * h,
            ],
        );
        s.cone(neck, root, self.neck, skull, self.neck);
        let head = s.bone(
            Some(neck),
            add(skull, [0.0, -0.8 * h, 0.0]),
            range([-20.0, 20.0], [-30.0, 30.0], [-12.0, 12.0]),
        );
        s.ellipsoid(head, skull, [w, h, d], [8.0, 0.0, 0.0]);
        (
            s,
            Landmarks {
                hips,
                chest,
                head,
                skull,
                limbs,
            },
        )
    }

    fn attach_arm(&self, s: &mut Skeleton, chest: usize, side: Side, height: Vec3) -> Vec<usize> {
        // Held 40 degrees off the body, so that there is room to move both ways.
        let (sin, cos) = 40f64.to_radians().sin_cos();
        let mut p = add(height, [self.width[0], 0.0, 0.0]);
        let mut points = vec![(p, self.arm_radii[0])];
        for (i, &length) in self.arm.iter().enumerate() {
            p = add(p, [sin * length, -cos * length, 0.05 * length * i as f64]);
            points.push((p, self.arm_radii[i + 1]));
        }
        let ranges = [
            range([-70.0, 30.0], [-20.0, 20.0], [-12.0, 55.0]),
            range([-85.0, -5.0], [-10.0, 10.0], FIXED),
            range([-20.0, 20.0], [-10.0, 10.0], [-15.0, 15.0]),
        ];
        let arm = s.chain(chest, side, &points, &ranges);
        s.walks(&arm[..1], if side == Side::Left { 0.5 } else { 0.0 });
        arm
    }
}
