//! The little of 4 × 4 matrices that placing nodes needs. Column-major, as glTF stores them.

/// A 4 × 4 matrix: element (row, column) is at `4·column + row`.
pub(super) type Matrix = [f64; 16];

pub(super) const IDENTITY: Matrix = [
    1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
];

/// `a · b`: first `b`, then `a`.
pub(super) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|k| {
        let (column, row) = (k / 4, k % 4);
        (0..4).map(|i| a[4 * i + row] * b[4 * column + i]).sum()
    })
}

/// `m` applied to a point; the last row is taken to be (0, 0, 0, 1).
pub(super) fn transform(m: &Matrix, p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| m[row] * p[0] + m[4 + row] * p[1] + m[8 + row] * p[2] + m[12 + row])
}

/// Adds `weight · m` to `sum`.
pub(super) fn accumulate(sum: &mut Matrix, m: &Matrix, weight: f64) {
    for (s, x) in sum.iter_mut().zip(m) {
        *s += weight * x;
    }
}

/// The quaternion (x, y, z, w) at unit length; the identity where it has no direction.
pub(super) fn normalised(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() {
        q.map(|x| x / length)
    } else {
        [0.0, 0.0, 0.0, 1.0]
    }
}

/// Translation · rotation · scale, the rotation as a quaternion (x, y, z, w) of any length.
pub(super) fn compose(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> Matrix {
    let [x, y, z, w] = normalised(rotation);
    let [sx, sy, sz] = scale;
    let [tx, ty, tz] = translation;
    [
        sx * (1.0 - 2.0 * (y * y + z * z)),
        sx * 2.0 * (x * y + z * w),
        sx * 2.0 * (x * z - y * w),
        0.0,
        sy * 2.0 * (x * y - z * w),
        sy * (1.0 - 2.0 * (x * x + z * z)),
        sy * 2.0 * (y * z + x * w),
        0.0,
        sz * 2.0 * (x * z + y * w),
        sz * 2.0 * (y * z - x * w),
        sz * (1.0 - 2.0 * (x * x + y * y)),
        0.0,
        tx,
        ty,
        tz,
        1.0,
    ]
}

/// Spherical interpolation from `a` to `b`, the short way round (Shoemake 1985; glTF 2.0, appendix C.4).
pub(super) fn slerp(a: [f64; 4], b: [f64; 4], t: f64) -> [f64; 4] {
    let (a, mut b) = (normalised(a), normalised(b));
    let mut cosine: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
    if cosine < 0.0 {
        b = b.map(|x| -x);
        cosine = -cosine;
    }
    let (from, to) = if cosine > 1.0 - 1e-9 {
        // Nearly equal: the sine below would be a division by nearly zero.
        (1.0 - t, t)
    } else {
        let angle = cosine.acos();
        let sine = angle.sin();
        (((1.0 - t) * angle).sin() / sine, (t * angle).sin() / sine)
    };
    normalised(std::array::from_fn(|k| from * a[k] + to * b[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compose_scales_then_turns_then_moves() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        // A quarter turn about z takes x to y.
        let m = compose([10.0, 0.0, 0.0], [0.0, 0.0, half, half], [2.0, 3.0, 1.0]);
        let p = transform(&m, [1.0, 1.0, 5.0]);
        for (found, expected) in p.iter().zip([7.0, 2.0, 5.0]) {
            assert!((found - expected).abs() < 1e-12, "{p:?}");
        }
        assert_eq!(product(&m, &IDENTITY), m);
        let twice = product(&m, &m);
        for (found, expected) in transform(&twice, [1.0, 1.0, 5.0]).iter().zip(transform(&m, p)) {
            assert!((found - expected).abs() < 1e-12, "{twice:?}");
        }
    }

    #[test]
    fn slerp_goes_halfway_and_the_short_way() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let quarter = [0.0, 0.0, half, half];
        let eighth = slerp([0.0, 0.0, 0.0, 1.0], quarter.map(|x| -x), 0.5);
        let expected = (std::f64::consts::PI / 8.0).sin();
        assert!((eighth[2] - expected).abs() < 1e-12, "{eighth:?}");
        assert_eq!(slerp(quarter, quarter, 0.3), normalised(quarter));
    }
}
