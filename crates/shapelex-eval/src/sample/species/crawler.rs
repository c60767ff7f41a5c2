//! Low species with many or sprawling legs: a crocodile, an octopus, a spider.

use crate::sample::skeleton::{Range, Side, Skeleton, range};
use crate::sample::vector::Vec3;

const FIXED: [f64; 2] = [0.0, 0.0];

pub(super) fn crocodile() -> Skeleton {
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

pub(super) fn octopus() -> Skeleton {
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

pub(super) fn spider() -> Skeleton {
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
