//! Bones, their joints, and the solids that hang on them, all given in the rest pose.

use super::vector::{Rotation, Vec3};

/// The angles a joint may take, in degrees, as `[from, to]` about each axis. The rest pose is all zeros.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Range {
    /// About x: a positive angle takes a leg backwards and a head downwards.
    pub pitch: [f64; 2],
    /// About y: a positive angle turns a head to the creature's left.
    pub yaw: [f64; 2],
    /// About z: a positive angle takes a hanging left leg outwards.
    pub roll: [f64; 2],
}

/// Shorthand for a [`Range`].
pub(in crate::sample) fn range(pitch: [f64; 2], yaw: [f64; 2], roll: [f64; 2]) -> Range {
    Range { pitch, yaw, roll }
}

impl Range {
    /// The range on the other side of the body: yaw and roll change sign, pitch does not.
    fn mirrored(self) -> Self {
        let flip = |r: [f64; 2]| [-r[1], -r[0]];
        Self {
            pitch: self.pitch,
            yaw: flip(self.yaw),
            roll: flip(self.roll),
        }
    }
}

/// A rigid piece of the creature.
#[derive(Clone, Debug, PartialEq)]
pub struct Bone {
    /// The bone this one turns against; `None` for the root. A parent stands before its children.
    pub parent: Option<usize>,
    /// The point it turns about, in the rest pose.
    pub pivot: Vec3,
    /// How far it turns.
    pub range: Range,
    /// Where in the cycle of a gait its pitch is, in turns; `None` for a bone that takes no part in walking.
    pub gait: Option<f64>,
}

/// An implicit solid in the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// A capsule whose radius runs linearly from `radius[0]` at `ends[0]` to `radius[1]` at `ends[1]`.
    Cone {
        /// Centres of the two end spheres.
        ends: [Vec3; 2],
        /// Their radii.
        radius: [f64; 2],
    },
    /// An ellipsoid.
    Ellipsoid {
        /// Its centre.
        centre: Vec3,
        /// Takes its own axes to those of the rest pose.
        frame: Rotation,
        /// Half-axes.
        radii: Vec3,
    },
}

/// A solid and the bone that carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Index of the bone.
    pub bone: usize,
    /// The solid.
    pub solid: Solid,
    /// How far its surface flows into that of its neighbours: the width of the smooth union.
    pub blend: f64,
}

/// A creature at rest: a tree of bones and the parts they carry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skeleton {
    /// The bones, parents first.
    pub bones: Vec<Bone>,
    /// The parts, in the order in which they are united.
    pub parts: Vec<Part>,
}

/// Which side of the body a limb is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::sample) enum Side {
    /// x as given.
    Left,
    /// x mirrored.
    Right,
}

impl Side {
    pub(in crate::sample) const BOTH: [Self; 2] = [Self::Left, Self::Right];

    fn point(self, [x, y, z]: Vec3) -> Vec3 {
        match self {
            Self::Left => [x, y, z],
            Self::Right => [-x, y, z],
        }
    }

    fn range(self, range: Range) -> Range {
        match self {
            Self::Left => range,
            Self::Right => range.mirrored(),
        }
    }
}

impl Skeleton {
    /// Adds a bone and returns its index.
    pub(in crate::sample) fn bone(&mut self, parent: Option<usize>, pivot: Vec3, range: Range) -> usize {
        self.bones.push(Bone {
            parent,
            pivot,
            range,
            gait: None,
        });
        self.bones.len() - 1
    }

    /// Adds a tapered capsule to a bone.
    pub(in crate::sample) fn cone(&mut self, bone: usize, a: Vec3, ra: f64, b: Vec3, rb: f64) {
        self.parts.push(Part {
            bone,
            solid: Solid::Cone {
                ends: [a, b],
                radius: [ra, rb],
            },
            blend: 0.5 * ra.min(rb),
        });
    }

    /// Adds an ellipsoid to a bone; `angles` are pitch, yaw and roll of its axes in degrees.
    pub(in crate::sample) fn ellipsoid(&mut self, bone: usize, centre: Vec3, radii: Vec3, angles: Vec3) {
        let blend = 0.6 * radii.iter().copied().fold(f64::INFINITY, f64::min);
        self.parts.push(Part {
            bone,
            solid: Solid::Ellipsoid {
                centre,
                frame: Rotation::from_angles(angles.map(f64::to_radians)),
                radii,
            },
            blend,
        });
    }

    /// Adds an ellipsoid on each side of a bone.
    pub(in crate::sample) fn ellipsoid_pair(
        &mut self,
        bone: usize,
        centre: Vec3,
        radii: Vec3,
        [p, y, r]: Vec3,
    ) {
        self.ellipsoid(bone, centre, radii, [p, y, r]);
        self.ellipsoid(bone, Side::Right.point(centre), radii, [p, -y, -r]);
    }

    /// Adds a chain of bones through `points` (centre and radius), one bone per segment, each turning about its
    /// first point within the range of the same place in `ranges` (the last one is repeated when there are fewer).
    /// Returns the bones' indices.
    pub(in crate::sample) fn chain(
        &mut self,
        parent: usize,
        side: Side,
        points: &[(Vec3, f64)],
        ranges: &[Range],
    ) -> Vec<usize> {
        let mut bones = Vec::with_capacity(points.len());
        let mut above = parent;
        for (i, pair) in points.windows(2).enumerate() {
            let [(a, ra), (b, rb)] = [pair[0], pair[1]].map(|(p, r)| (side.point(p), r));
            let range = ranges.get(i).or(ranges.last()).copied().unwrap_or_default();
            above = self.bone(Some(above), a, side.range(range));
            // Where a limb leaves the trunk the surface should flow; between its segments it should only be smooth.
            let blend = if i == 0 { 0.6 } else { 0.3 };
            self.cone(above, a, ra, b, rb);
            if let Some(part) = self.parts.last_mut() {
                part.blend = blend * ra.min(rb);
            }
            bones.push(above);
        }
        bones
    }

    /// Puts the bones into a gait: their pitch follows a common cycle, each a little behind the one above.
    pub(in crate::sample) fn walks(&mut self, bones: &[usize], phase: f64) {
        for (i, &b) in bones.iter().enumerate() {
            self.bones[b].gait = Some(phase + 0.12 * i as f64);
        }
    }

    /// Multiplies the ranges of a bone's joint by a factor.
    pub(in crate::sample) fn stiffen(&mut self, bone: usize, factor: f64) {
        let range = &mut self.bones[bone].range;
        for r in [&mut range.pitch, &mut range.yaw, &mut range.roll] {
            *r = r.map(|angle| factor * angle);
        }
    }

    /// Radius of the thinnest part: what the polygoniser has to resolve.
    pub fn thinnest(&self) -> f64 {
        self.parts
            .iter()
            .map(|p| match p.solid {
                Solid::Cone { radius, .. } => radius[0].min(radius[1]),
                Solid::Ellipsoid { radii, .. } => radii.iter().copied().fold(f64::INFINITY, f64::min),
            })
            .fold(f64::INFINITY, f64::min)
    }
}
