//! Random species: any number of classes for benchmarks at scale.

use super::generate::{Species, stream};
use super::skeleton::{Range, Side, Skeleton, range};
use super::template::Head;
use super::vector::Vec3;
use rand::Rng;

const FIXED: [f64; 2] = [0.0, 0.0];

impl Species {
    /// The species of the given number: a trunk of a few segments on zero to four pairs of legs, with or without
    /// neck, tail, arms, ears and humps, in proportions drawn at random. Two numbers differ in some twenty
    /// proportions, so they give different creatures with high probability.
    pub fn random(seed: u64, index: u64) -> Self {
        Self::new(
            format!("species-{index:05}"),
            skeleton(&mut stream(seed, "species", index)),
        )
    }
}

fn skeleton(rng: &mut impl Rng) -> Skeleton {
    let mut s = Skeleton::default();
    let length = rng.random_range(0.5..1.5);
    let girth = rng.random_range(0.15..0.3);
    let flatness = rng.random_range(0.7..1.3);
    let belly = rng.random_range(0.75..1.35);
    let reach = rng.random_range(0.35..1.2);

    let hips = s.bone(None, [0.0; 3], Range::default());
    let half = 0.5 * length;
    let thick = |f: f64| [girth * f * flatness, girth * f / flatness, 0.32 * length + 0.1];
    s.ellipsoid(
        hips,
        [0.0, 0.0, -0.6 * half],
        thick(rng.random_range(0.8..1.15)),
        [0.0; 3],
    );
    s.ellipsoid(hips, [0.0; 3], thick(belly), [0.0; 3]);
    let chest = s.bone(
        Some(hips),
        [0.0; 3],
        range([-8.0, 10.0], [-12.0, 12.0], [-5.0, 5.0]),
    );
    s.ellipsoid(
        chest,
        [0.0, 0.0, 0.6 * half],
        thick(rng.random_range(0.8..1.15)),
        [0.0; 3],
    );

    let pairs = rng.random_range(0..=4u32);
    // Splay: legs hang down (0) or stand out (1).
    let splay = if pairs > 2 {
        rng.random_range(0.6..1.0)
    } else {
        rng.random_range(0.0..0.8)
    };
    let spacing = 1.4 * half / f64::from(pairs.max(2) - 1);
    let thickness = rng.random_range(0.26..0.45) * girth.min(0.9 * spacing);
    let taper = rng.random_range(0.75..0.95);
    let knee = rng.random_range(0.35..0.65);
    for k in 0..pairs {
        let t = if pairs == 1 {
            0.2
        } else {
            f64::from(k) / f64::from(pairs - 1)
        };
        let z = (0.7 - 1.4 * t) * half;
        let bone = if z > 0.0 { chest } else { hips };
        let limb = Limb {
            joint: [0.75 * girth * flatness, 0.0, z],
            reach,
            splay,
            fan: if pairs > 2 { 1.8 } else { 1.0 },
            foot: (0.15 * reach).min(0.4 * spacing),
            radii: [1.0, taper, taper * taper].map(|r| r * thickness),
            knee,
            swing: 44.0 / f64::from(pairs + 1),
        };
        limb.attach(&mut s, bone);
    }

    let front: Vec3 = [0.0, 0.3 * girth, 0.85 * half];
    let bones = rng.random_range(1..=4u32);
    let (neck, rise) = (
        rng.random_range(0.1..0.9) * length,
        rng.random_range(5.0f64..75.0).to_radians(),
    );
    let (r0, r1) = (
        girth * rng.random_range(0.45..0.75),
        girth * rng.random_range(0.25..0.42),
    );
    let points: Vec<(Vec3, f64)> = (0..=bones)
        .map(|i| {
            let t = f64::from(i) / f64::from(bones);
            let d = t * neck;
            (
                [0.0, front[1] + d * rise.sin(), front[2] + d * rise.cos()],
                r0 + t * (r1 - r0),
            )
        })
        .collect();
    let give = 1.0 / f64::from(bones);
    let bend = range([-25.0 * give, 35.0 * give], [-35.0 * give, 35.0 * give], FIXED);
    let chain = s.chain(chest, Side::Left, &points, &[bend]);
    let above = chain.last().copied().unwrap_or(chest);
    let top = points.last().map_or(front, |p| p.0);
    let size = girth * rng.random_range(0.45..0.85);
    let ears = rng.random_bool(0.6);
    let head = Head {
        skull: [
            size * rng.random_range(0.8..1.1),
            size,
            size * rng.random_range(1.0..1.5),
        ],
        muzzle: [
            size * rng.random_range(0.9..2.4),
            0.65 * size,
            size * rng.random_range(0.3..0.55),
        ],
        droop: rng.random_range(0.0..25.0),
        ear: if ears {
            [0.4 * size, size * rng.random_range(0.5..1.8), 0.32 * size]
        } else {
            [0.0; 3]
        },
        ear_set: [rng.random_range(10.0..60.0), 0.62],
    };
    head.attach(&mut s, above, top);

    if rng.random_bool(0.8) {
        let radius = girth * rng.random_range(0.2..0.55);
        let tip = radius * rng.random_range(0.4..0.9);
        let length = length * rng.random_range(0.3..1.3);
        let angle = rng.random_range(-30.0..35.0);
        s.tail(
            hips,
            [0.0, 0.1 * girth, -0.85 * half],
            [length, angle, radius, tip.max(0.04)],
            4,
        );
    }
    for _ in 0..rng.random_range(0..=2u32) {
        let (z, size) = (
            rng.random_range(-0.4..0.4) * half,
            girth * rng.random_range(0.4..0.7),
        );
        let bone = if z > 0.0 { chest } else { hips };
        s.ellipsoid(
            bone,
            [0.0, girth / flatness, z],
            [0.7 * size, 1.2 * size, size],
            [0.0; 3],
        );
    }
    s
}

/// One pair of legs.
struct Limb {
    /// The left leg's joint in the trunk.
    joint: Vec3,
    /// Length of the leg.
    reach: f64,
    /// From hanging down, 0, to standing out, 1.
    splay: f64,
    /// How much further apart along the body the feet are than the joints.
    fan: f64,
    /// Length of the foot.
    foot: f64,
    /// Radii at joint, knee and foot.
    radii: [f64; 3],
    /// Place of the knee along the leg.
    knee: f64,
    /// Swing to either side, in degrees.
    swing: f64,
}

impl Limb {
    fn attach(&self, s: &mut Skeleton, bone: usize) {
        let [x, y, z] = self.joint;
        let out = (0.2 + 0.8 * self.splay) * self.splay * self.reach;
        let (knee, foot) = (z * (1.0 + 0.7 * (self.fan - 1.0)), z * self.fan);
        let down = (1.0 - 0.4 * self.splay) * self.reach;
        let [r0, r1, r2] = self.radii;
        let points: [(Vec3, f64); 4] = [
            (self.joint, r0),
            (
                [
                    x + 0.7 * out,
                    y - (1.0 - self.splay) * self.knee * self.reach,
                    knee,
                ],
                r1,
            ),
            ([x + out, y - down, foot], r2),
            ([x + out, y - down, foot + self.foot], r2),
        ];
        let swing = self.swing;
        let ranges = [
            range([-swing, swing], [-0.5 * swing, 0.5 * swing], [-4.0, 12.0]),
            range([-8.0, 30.0], FIXED, [-8.0, 8.0]),
            range([-10.0, 15.0], FIXED, FIXED),
        ];
        for side in Side::BOTH {
            let chain = s.chain(bone, side, &points, &ranges);
            s.walks(&chain[..2], if side == Side::Left { 0.0 } else { 0.5 });
        }
    }
}
