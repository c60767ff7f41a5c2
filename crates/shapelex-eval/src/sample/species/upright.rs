//! Species on two legs: three primates, a kangaroo, a flamingo.

use crate::sample::skeleton::{Range, Side, Skeleton, range};
use crate::sample::template::{Biped, Head};

const FIXED: [f64; 2] = [0.0, 0.0];

pub(super) fn man() -> Skeleton {
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

pub(super) fn woman() -> Skeleton {
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

pub(super) fn gorilla() -> Skeleton {
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

pub(super) fn kangaroo() -> Skeleton {
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
    s.tail(hips, [0.0, 0.48, -0.16], [1.05, -22.0, 0.12, 0.04], 5);
    s
}

pub(super) fn flamingo() -> Skeleton {
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
