//! The named species.

use super::generate::Species;
use super::skeleton::{Range, Side, Skeleton, range};
use super::template::{Biped, Head, Leg, Quadruped, ahead};
use super::vector::Vec3;

const FIXED: [f64; 2] = [0.0, 0.0];

impl Species {
    /// The sixteen named species, always in this order.
    pub fn named() -> Vec<Self> {
        let zoo: [(&str, fn() -> Skeleton); 16] = [
            ("man", man),
            ("woman", woman),
            ("dog", dog),
            ("cat", cat),
            ("horse", horse),
            ("camel", camel),
            ("elephant", elephant),
            ("flamingo", flamingo),
            ("lioness", lioness),
            ("gorilla", gorilla),
            ("giraffe", giraffe),
            ("crocodile", crocodile),
            ("octopus", octopus),
            ("spider", spider),
            ("kangaroo", kangaroo),
            ("rabbit", rabbit),
        ];
        zoo.into_iter()
            .map(|(name, build)| Self::new(name, build()))
            .collect()
    }
}

fn man() -> Skeleton {
    let body = Biped {
        height: [0.92, 1.46, 1.56],
        width: [0.20, 0.105],
        torso: [[0.165, 0.115], [0.15, 0.105], [0.20, 0.125]],
        leg: [0.095, 0.062, 0.045, 0.036],
        foot: 0.17,
        arm: [0.30, 0.27, 0.15],
        arm_radii: [0.065, 0.045, 0.034, 0.03],
        neck: 0.058,
        head: [0.085, 0.125, 0.1],
        lean: 0.0,
    };
    body.build().0
}

fn woman() -> Skeleton {
    let body = Biped {
        height: [0.9, 1.34, 1.46],
        width: [0.155, 0.1],
        torso: [[0.18, 0.125], [0.115, 0.085], [0.15, 0.1]],
        leg: [0.1, 0.054, 0.036, 0.03],
        foot: 0.14,
        arm: [0.27, 0.24, 0.14],
        arm_radii: [0.046, 0.035, 0.028, 0.026],
        neck: 0.043,
        head: [0.083, 0.118, 0.095],
        lean: 0.0,
    };
    let (mut s, at) = body.build();
    s.ellipsoid_pair(at.chest, [0.065, 1.24, 0.085], [0.055, 0.055, 0.055], [0.0; 3]);
    // Hair tied in a knot.
    let [_, y, z] = at.skull;
    s.ellipsoid(
        at.head,
        [0.0, y + 0.06, z - 0.12],
        [0.055, 0.055, 0.055],
        [0.0; 3],
    );
    s
}

fn gorilla() -> Skeleton {
    let body = Biped {
        height: [0.62, 1.2, 1.24],
        width: [0.29, 0.15],
        torso: [[0.22, 0.19], [0.27, 0.24], [0.32, 0.24]],
        leg: [0.13, 0.095, 0.075, 0.055],
        foot: 0.22,
        arm: [0.42, 0.4, 0.2],
        arm_radii: [0.12, 0.095, 0.075, 0.06],
        neck: 0.13,
        head: [0.13, 0.18, 0.15],
        lean: 24.0,
    };
    let (mut s, at) = body.build();
    let [x, y, z] = at.skull;
    s.ellipsoid(at.head, [x, y - 0.08, z + 0.1], [0.095, 0.075, 0.1], [0.0; 3]);
    s
}

fn dog() -> Skeleton {
    let body = Quadruped {
        trunk: 0.62,
        height: [0.58, 0.58],
        chest: [0.125, 0.165],
        belly: [0.105, 0.12],
        rump: [0.115, 0.13],
        stance: [0.1, 0.105],
        fore: Leg {
            radii: [0.07, 0.046, 0.036, 0.034],
            joints: [0.56, 0.15],
            forward: [-0.05, 0.0],
            foot: 0.08,
        },
        hind: Leg {
            radii: [0.09, 0.056, 0.036, 0.034],
            joints: [0.56, 0.2],
            forward: [0.06, -0.09],
            foot: 0.12,
        },
        neck: [0.26, 48.0, 0.1, 0.075],
        neck_bones: 2,
        head: Head {
            skull: [0.085, 0.085, 0.11],
            muzzle: [0.21, 0.062, 0.04],
            droop: 18.0,
            ear: [0.045, 0.09, 0.024],
            ear_set: [35.0, 0.75],
        },
        tail: [0.38, 45.0, 0.038, 0.024],
        tail_bones: 3,
        swing: 28.0,
    };
    body.build().0
}

fn cat() -> Skeleton {
    let body = Quadruped {
        trunk: 0.5,
        height: [0.4, 0.41],
        chest: [0.09, 0.105],
        belly: [0.1, 0.105],
        rump: [0.095, 0.1],
        stance: [0.075, 0.08],
        fore: Leg {
            radii: [0.052, 0.036, 0.029, 0.029],
            joints: [0.55, 0.16],
            forward: [-0.03, 0.0],
            foot: 0.05,
        },
        hind: Leg {
            radii: [0.068, 0.044, 0.029, 0.029],
            joints: [0.55, 0.2],
            forward: [0.06, -0.06],
            foot: 0.09,
        },
        neck: [0.13, 35.0, 0.075, 0.06],
        neck_bones: 1,
        head: Head {
            skull: [0.092, 0.082, 0.088],
            muzzle: [0.1, 0.05, 0.04],
            droop: 8.0,
            ear: [0.04, 0.062, 0.02],
            ear_set: [22.0, 0.68],
        },
        tail: [0.52, 40.0, 0.027, 0.021],
        tail_bones: 5,
        swing: 30.0,
    };
    body.build().0
}

fn lioness() -> Skeleton {
    let body = Quadruped {
        trunk: 0.95,
        height: [0.72, 0.72],
        chest: [0.165, 0.2],
        belly: [0.155, 0.18],
        rump: [0.15, 0.175],
        stance: [0.135, 0.14],
        fore: Leg {
            radii: [0.105, 0.078, 0.06, 0.058],
            joints: [0.55, 0.15],
            forward: [-0.06, 0.0],
            foot: 0.1,
        },
        hind: Leg {
            radii: [0.13, 0.085, 0.055, 0.055],
            joints: [0.55, 0.2],
            forward: [0.09, -0.1],
            foot: 0.15,
        },
        neck: [0.26, 28.0, 0.14, 0.11],
        neck_bones: 2,
        head: Head {
            skull: [0.13, 0.125, 0.15],
            muzzle: [0.24, 0.09, 0.07],
            droop: 12.0,
            ear: [0.05, 0.05, 0.032],
            ear_set: [40.0, 0.75],
        },
        tail: [0.8, -25.0, 0.04, 0.032],
        tail_bones: 4,
        swing: 28.0,
    };
    let (mut s, _) = body.build();
    // The tuft.
    if let Some(tip) = s.bones.len().checked_sub(1) {
        let end = ahead([0.0, 0.79, -0.779], 0.8, 205.0);
        s.ellipsoid(tip, end, [0.045, 0.045, 0.07], [25.0, 0.0, 0.0]);
    }
    s
}

fn horse() -> Skeleton {
    let body = Quadruped {
        trunk: 0.95,
        height: [1.18, 1.2],
        chest: [0.2, 0.27],
        belly: [0.22, 0.25],
        rump: [0.22, 0.25],
        stance: [0.15, 0.155],
        fore: Leg {
            radii: [0.12, 0.07, 0.046, 0.055],
            joints: [0.55, 0.12],
            forward: [-0.03, 0.0],
            foot: 0.05,
        },
        hind: Leg {
            radii: [0.16, 0.085, 0.05, 0.055],
            joints: [0.54, 0.14],
            forward: [0.07, -0.1],
            foot: 0.06,
        },
        neck: [0.68, 50.0, 0.19, 0.11],
        neck_bones: 3,
        head: Head {
            skull: [0.1, 0.12, 0.16],
            muzzle: [0.4, 0.1, 0.068],
            droop: 42.0,
            ear: [0.045, 0.1, 0.038],
            ear_set: [15.0, 0.55],
        },
        tail: [0.75, -62.0, 0.06, 0.045],
        tail_bones: 3,
        swing: 26.0,
    };
    body.build().0
}

fn camel() -> Skeleton {
    let body = Quadruped {
        trunk: 1.05,
        height: [1.35, 1.3],
        chest: [0.21, 0.27],
        belly: [0.24, 0.26],
        rump: [0.18, 0.2],
        stance: [0.16, 0.15],
        fore: Leg {
            radii: [0.11, 0.07, 0.05, 0.065],
            joints: [0.53, 0.1],
            forward: [-0.03, 0.0],
            foot: 0.09,
        },
        hind: Leg {
            radii: [0.14, 0.075, 0.052, 0.065],
            joints: [0.55, 0.12],
            forward: [0.05, -0.06],
            foot: 0.1,
        },
        neck: [0.95, 40.0, 0.14, 0.085],
        neck_bones: 4,
        head: Head {
            skull: [0.09, 0.1, 0.15],
            muzzle: [0.33, 0.085, 0.062],
            droop: 18.0,
            ear: [0.04, 0.06, 0.036],
            ear_set: [35.0, 0.6],
        },
        tail: [0.4, -65.0, 0.045, 0.04],
        tail_bones: 2,
        swing: 24.0,
    };
    let (mut s, at) = body.build();
    s.ellipsoid(at.chest, [0.0, 1.62, 0.3], [0.13, 0.24, 0.16], [0.0; 3]);
    s.ellipsoid(at.hips, [0.0, 1.6, -0.27], [0.13, 0.24, 0.16], [0.0; 3]);
    s
}

fn elephant() -> Skeleton {
    let leg = Leg {
        radii: [0.23, 0.18, 0.15, 0.16],
        joints: [0.52, 0.13],
        forward: [-0.02, 0.0],
        foot: 0.05,
    };
    let body = Quadruped {
        trunk: 1.3,
        height: [1.65, 1.55],
        chest: [0.46, 0.52],
        belly: [0.55, 0.58],
        rump: [0.45, 0.5],
        stance: [0.33, 0.33],
        fore: leg,
        hind: leg,
        neck: [0.36, 30.0, 0.34, 0.22],
        neck_bones: 1,
        head: Head {
            skull: [0.3, 0.36, 0.33],
            muzzle: [0.0, 0.0, 0.0],
            droop: 10.0,
            ear: [0.0, 0.0, 0.0],
            ear_set: [0.0, 0.0],
        },
        tail: [0.75, -66.0, 0.085, 0.065],
        tail_bones: 2,
        swing: 22.0,
    };
    let (mut s, at) = body.build();
    let [_, y, z] = at.skull;
    // A short neck and wide ears leave the head little room to turn.
    s.stiffen(at.head, 0.4);
    if let Some(neck) = s.bones[at.head].parent {
        s.stiffen(neck, 0.3);
    }
    // Trunk: down from the face, curling forwards at the end.
    let trunk = [
        ([0.0, y - 0.08, z + 0.24], 0.17),
        ([0.0, y - 0.34, z + 0.45], 0.125),
        ([0.0, y - 0.64, z + 0.52], 0.1),
        ([0.0, y - 0.92, z + 0.54], 0.088),
        ([0.0, y - 1.13, z + 0.64], 0.08),
    ];
    let curl = range([-22.0, 12.0], [-12.0, 12.0], FIXED);
    s.chain(
        at.head,
        Side::Left,
        &trunk,
        &[range([-12.0, 8.0], [-8.0, 8.0], FIXED), curl],
    );
    for side in Side::BOTH {
        let tusk = [
            ([0.2, y - 0.18, z + 0.14], 0.075),
            ([0.37, y - 0.5, z + 0.58], 0.06),
        ];
        s.chain(at.head, side, &tusk, &[Range::default()]);
    }
    s.ellipsoid_pair(
        at.head,
        [0.48, y + 0.06, z - 0.06],
        [0.34, 0.42, 0.11],
        [0.0, 32.0, -8.0],
    );
    s
}

fn giraffe() -> Skeleton {
    let body = Quadruped {
        trunk: 0.85,
        height: [1.75, 1.6],
        chest: [0.21, 0.3],
        belly: [0.21, 0.25],
        rump: [0.19, 0.22],
        stance: [0.15, 0.15],
        fore: Leg {
            radii: [0.12, 0.075, 0.052, 0.06],
            joints: [0.53, 0.1],
            forward: [-0.02, 0.0],
            foot: 0.06,
        },
        hind: Leg {
            radii: [0.14, 0.08, 0.055, 0.06],
            joints: [0.55, 0.12],
            forward: [0.05, -0.08],
            foot: 0.07,
        },
        neck: [1.65, 64.0, 0.19, 0.085],
        neck_bones: 5,
        head: Head {
            skull: [0.09, 0.1, 0.15],
            muzzle: [0.34, 0.08, 0.055],
            droop: 30.0,
            ear: [0.045, 0.1, 0.04],
            ear_set: [70.0, 0.6],
        },
        tail: [0.65, -70.0, 0.046, 0.042],
        tail_bones: 2,
        swing: 20.0,
    };
    let (mut s, at) = body.build();
    let [_, y, z] = at.skull;
    for side in Side::BOTH {
        let horn = [([0.055, y + 0.05, z], 0.04), ([0.11, y + 0.2, z - 0.05], 0.042)];
        s.chain(at.head, side, &horn, &[Range::default()]);
    }
    s
}

fn rabbit() -> Skeleton {
    let body = Quadruped {
        trunk: 0.24,
        height: [0.22, 0.22],
        chest: [0.09, 0.1],
        belly: [0.115, 0.12],
        rump: [0.13, 0.135],
        stance: [0.065, 0.105],
        fore: Leg {
            radii: [0.042, 0.034, 0.027, 0.026],
            joints: [0.5, 0.18],
            forward: [0.0, 0.02],
            foot: 0.05,
        },
        hind: Leg {
            radii: [0.085, 0.055, 0.033, 0.03],
            joints: [0.5, 0.2],
            forward: [0.05, -0.06],
            foot: 0.19,
        },
        neck: [0.1, 42.0, 0.07, 0.06],
        neck_bones: 1,
        head: Head {
            skull: [0.075, 0.078, 0.095],
            muzzle: [0.09, 0.055, 0.042],
            droop: 15.0,
            ear: [0.034, 0.15, 0.021],
            ear_set: [16.0, 0.5],
        },
        tail: [0.0, 0.0, 0.0, 0.0],
        tail_bones: 0,
        swing: 22.0,
    };
    let (mut s, at) = body.build();
    // It sits on its haunches: the long hind feet have little room under the belly.
    for &bone in at.limbs[2..].iter().flatten() {
        s.stiffen(bone, 0.5);
    }
    s.ellipsoid(at.hips, [0.0, 0.27, -0.25], [0.045, 0.045, 0.045], [0.0; 3]);
    s
}

fn crocodile() -> Skeleton {
    let mut s = Skeleton::default();
    let hips = s.bone(None, [0.0, 0.2, 0.0], Range::default());
    s.ellipsoid(hips, [0.0, 0.2, -0.25], [0.17, 0.12, 0.36], [0.0; 3]);
    let chest = s.bone(
        Some(hips),
        [0.0, 0.2, 0.0],
        range([-5.0, 8.0], [-16.0, 16.0], [-5.0, 5.0]),
    );
    s.ellipsoid(chest, [0.0, 0.2, 0.25], [0.17, 0.12, 0.36], [0.0; 3]);
    for (bone, z, foot) in [(chest, 0.34, 0.09), (hips, -0.36, 0.12)] {
        for side in Side::BOTH {
            let points = [
                ([0.12, 0.17, z], 0.065),
                ([0.29, 0.15, z - 0.03], 0.048),
                ([0.33, 0.03, z], 0.036),
                ([0.39, 0.03, z + foot], 0.03),
            ];
            let ranges = [
                range([-8.0, 8.0], [-28.0, 28.0], [-10.0, 18.0]),
                range([-15.0, 15.0], [-20.0, 20.0], FIXED),
                Range::default(),
            ];
            s.chain(bone, side, &points, &ranges);
        }
    }
    let neck = [([0.0, 0.2, 0.45], 0.11), ([0.0, 0.21, 0.68], 0.09)];
    let neck = s.chain(
        chest,
        Side::Left,
        &neck,
        &[range([-12.0, 8.0], [-18.0, 18.0], [-8.0, 8.0])],
    )[0];
    let head = s.bone(
        Some(neck),
        [0.0, 0.21, 0.68],
        range([-14.0, 6.0], [-16.0, 16.0], [-10.0, 10.0]),
    );
    s.ellipsoid(head, [0.0, 0.215, 0.76], [0.115, 0.08, 0.15], [0.0; 3]);
    s.ellipsoid(head, [0.0, 0.195, 1.0], [0.07, 0.045, 0.26], [0.0; 3]);
    s.ellipsoid(head, [0.0, 0.21, 1.2], [0.058, 0.048, 0.07], [0.0; 3]);
    s.ellipsoid_pair(head, [0.055, 0.285, 0.77], [0.034, 0.034, 0.04], [0.0; 3]);
    let tail: Vec<(Vec3, f64)> = (0..=6)
        .map(|i| {
            let t = f64::from(i) / 6.0;
            ([0.0, 0.2 - 0.08 * t, -0.48 - 1.15 * t], 0.11 - 0.075 * t)
        })
        .collect();
    s.chain(
        hips,
        Side::Left,
        &tail,
        &[range([-6.0, 4.0], [-20.0, 20.0], FIXED)],
    );
    s
}

fn flamingo() -> Skeleton {
    let mut s = Skeleton::default();
    let trunk = s.bone(None, [0.0, 0.75, 0.0], Range::default());
    s.ellipsoid(trunk, [0.0, 0.78, 0.0], [0.125, 0.13, 0.24], [-14.0, 0.0, 0.0]);
    s.ellipsoid(trunk, [0.0, 0.71, -0.24], [0.07, 0.045, 0.14], [-22.0, 0.0, 0.0]);
    s.ellipsoid_pair(trunk, [0.115, 0.79, -0.06], [0.035, 0.1, 0.21], [-16.0, 6.0, 0.0]);
    for side in Side::BOTH {
        let points = [
            ([0.075, 0.7, 0.0], 0.05),
            ([0.08, 0.37, 0.03], 0.026),
            ([0.08, 0.03, 0.0], 0.023),
            ([0.08, 0.025, 0.12], 0.025),
        ];
        let ranges = [
            range([-45.0, 25.0], FIXED, [-2.0, 10.0]),
            range([0.0, 60.0], FIXED, FIXED),
            range([-10.0, 25.0], FIXED, FIXED),
        ];
        let leg = s.chain(trunk, side, &points, &ranges);
        s.walks(&leg[..2], if side == Side::Left { 0.0 } else { 0.5 });
    }
    // The neck leaves the breast forwards, swings back and rises.
    let neck = [
        ([0.0, 0.84, 0.17], 0.06),
        ([0.0, 0.95, 0.3], 0.044),
        ([0.0, 1.1, 0.34], 0.036),
        ([0.0, 1.25, 0.29], 0.033),
        ([0.0, 1.39, 0.25], 0.032),
        ([0.0, 1.5, 0.31], 0.033),
    ];
    let bend = range([-16.0, 20.0], [-14.0, 14.0], [-8.0, 8.0]);
    let neck = s.chain(trunk, Side::Left, &neck, &[bend]);
    let head = s.bone(
        neck.last().copied(),
        [0.0, 1.5, 0.31],
        range([-20.0, 20.0], [-25.0, 25.0], FIXED),
    );
    s.ellipsoid(head, [0.0, 1.51, 0.34], [0.045, 0.05, 0.065], [20.0, 0.0, 0.0]);
    s.cone(head, [0.0, 1.5, 0.38], 0.036, [0.0, 1.46, 0.47], 0.034);
    s.cone(head, [0.0, 1.46, 0.47], 0.034, [0.0, 1.38, 0.5], 0.02);
    s
}

fn octopus() -> Skeleton {
    let mut s = Skeleton::default();
    let head = s.bone(None, [0.0, 0.3, 0.0], Range::default());
    s.ellipsoid(head, [0.0, 0.25, 0.0], [0.19, 0.12, 0.19], [0.0; 3]);
    let mantle = s.bone(
        Some(head),
        [0.0, 0.32, 0.0],
        range([-20.0, 20.0], [-20.0, 20.0], [-12.0, 12.0]),
    );
    s.ellipsoid(mantle, [0.0, 0.52, -0.06], [0.22, 0.29, 0.24], [-12.0, 0.0, 0.0]);
    s.ellipsoid_pair(head, [0.12, 0.34, 0.14], [0.055, 0.055, 0.055], [0.0; 3]);
    for k in 0..4 {
        for side in Side::BOTH {
            let (sin, cos) = (22.5 + 45.0 * f64::from(k)).to_radians().sin_cos();
            let points: Vec<(Vec3, f64)> = [
                (0.13, 0.2, 0.075),
                (0.3, 0.14, 0.062),
                (0.48, 0.08, 0.052),
                (0.66, 0.05, 0.043),
                (0.83, 0.05, 0.035),
                (0.98, 0.08, 0.026),
            ]
            .map(|(r, y, radius)| ([r * sin, y, r * cos], radius))
            .to_vec();
            let curl = range([-16.0, 16.0], [-16.0, 16.0], [-16.0, 16.0]);
            s.chain(
                head,
                side,
                &points,
                &[range([-8.0, 8.0], [-7.0, 7.0], [-8.0, 8.0]), curl],
            );
        }
    }
    s
}

fn spider() -> Skeleton {
    let mut s = Skeleton::default();
    let front = s.bone(None, [0.0, 0.3, 0.0], Range::default());
    s.ellipsoid(front, [0.0, 0.3, 0.1], [0.15, 0.1, 0.19], [0.0; 3]);
    let rear = s.bone(
        Some(front),
        [0.0, 0.3, -0.08],
        range([-14.0, 10.0], [-12.0, 12.0], FIXED),
    );
    s.ellipsoid(rear, [0.0, 0.35, -0.34], [0.24, 0.21, 0.29], [10.0, 0.0, 0.0]);
    for (k, degrees) in [35.0f64, 68.0, 100.0, 135.0].into_iter().enumerate() {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let z = 0.2 - 0.07 * k as f64;
        for side in Side::BOTH {
            let points = [
                (0.1, 0.29, 0.044),
                (0.36, 0.52, 0.038),
                (0.66, 0.4, 0.032),
                (0.9, 0.02, 0.027),
            ]
            .map(|(r, y, radius)| ([r * sin, y, z + r * cos], radius));
            let ranges = [
                range([-8.0, 8.0], [-11.0, 11.0], [-8.0, 8.0]),
                range([-10.0, 10.0], FIXED, [-18.0, 18.0]),
                range([-10.0, 10.0], FIXED, [-18.0, 18.0]),
            ];
            s.chain(front, side, &points, &ranges);
        }
    }
    for side in Side::BOTH {
        let fang = [([0.055, 0.27, 0.24], 0.042), ([0.085, 0.17, 0.31], 0.032)];
        s.chain(front, side, &fang, &[range([-15.0, 15.0], FIXED, FIXED)]);
    }
    s
}

fn kangaroo() -> Skeleton {
    let mut s = Skeleton::default();
    let hips = s.bone(None, [0.0, 0.6, 0.0], Range::default());
    s.ellipsoid(hips, [0.0, 0.6, -0.04], [0.2, 0.26, 0.21], [30.0, 0.0, 0.0]);
    let chest = s.bone(
        Some(hips),
        [0.0, 0.75, 0.06],
        range([-14.0, 14.0], [-14.0, 14.0], [-6.0, 6.0]),
    );
    s.ellipsoid(chest, [0.0, 0.95, 0.18], [0.135, 0.24, 0.13], [28.0, 0.0, 0.0]);
    for side in Side::BOTH {
        let leg = [
            ([0.15, 0.56, 0.0], 0.14),
            ([0.2, 0.36, 0.24], 0.085),
            ([0.2, 0.08, -0.1], 0.044),
            ([0.2, 0.035, 0.3], 0.036),
        ];
        let ranges = [
            range([-20.0, 25.0], FIXED, [-2.0, 10.0]),
            range([-8.0, 24.0], FIXED, FIXED),
            range([-25.0, 15.0], FIXED, FIXED),
        ];
        s.chain(hips, side, &leg, &ranges);
        let arm = [
            ([0.1, 1.04, 0.25], 0.055),
            ([0.16, 0.88, 0.33], 0.038),
            ([0.16, 0.82, 0.48], 0.03),
            ([0.16, 0.8, 0.55], 0.028),
        ];
        let ranges = [
            range([-30.0, 20.0], FIXED, [-4.0, 25.0]),
            range([-30.0, 30.0], FIXED, FIXED),
            range([-20.0, 20.0], FIXED, FIXED),
        ];
        s.chain(chest, side, &arm, &ranges);
    }
    let neck = [([0.0, 1.12, 0.26], 0.085), ([0.0, 1.32, 0.34], 0.06)];
    let neck = s.chain(
        chest,
        Side::Left,
        &neck,
        &[range([-15.0, 20.0], [-20.0, 20.0], [-8.0, 8.0])],
    );
    let head = Head {
        skull: [0.072, 0.078, 0.1],
        muzzle: [0.2, 0.055, 0.038],
        droop: 22.0,
        ear: [0.04, 0.115, 0.024],
        ear_set: [20.0, 0.6],
    };
    head.attach(&mut s, neck[0], [0.0, 1.34, 0.33]);
    s.tail(hips, [0.0, 0.48, -0.16], 1.05, -22.0, [0.12, 0.04], 5);
    s
}
