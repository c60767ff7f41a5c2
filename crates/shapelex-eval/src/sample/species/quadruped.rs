//! Species of the four-legged plan.

use crate::sample::skeleton::{Range, Side, Skeleton, range};
use crate::sample::template::{Head, Leg, Quadruped, ahead};

const FIXED: [f64; 2] = [0.0, 0.0];

pub(super) fn dog() -> Skeleton {
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

pub(super) fn cat() -> Skeleton {
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

pub(super) fn lioness() -> Skeleton {
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

pub(super) fn horse() -> Skeleton {
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

pub(super) fn camel() -> Skeleton {
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

pub(super) fn giraffe() -> Skeleton {
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

pub(super) fn elephant() -> Skeleton {
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

pub(super) fn rabbit() -> Skeleton {
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
