//! Three-dimensional vectors, rotations and rigid motions: the little the zoo needs.

/// A point or a direction: x to the creature's left, y up, z forwards.
pub type Vec3 = [f64; 3];

/// a + b.
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a − b.
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// s a.
pub fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a + s b.
pub fn add_scaled(a: Vec3, b: Vec3, s: f64) -> Vec3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// Scalar product.
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Euclidean length.
pub fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// a + t (b − a).
pub fn lerp(a: Vec3, b: Vec3, t: f64) -> Vec3 {
    add_scaled(a, sub(b, a), t)
}

/// A rotation as the rows of a 3 × 3 orthogonal matrix of determinant 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation(pub [Vec3; 3]);

impl Rotation {
    /// No rotation.
    pub const IDENTITY: Self = Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);

    /// Roll about z, then yaw about y, then pitch about x, each in radians and right-handed. A positive pitch takes
    /// a hanging leg backwards and a head downwards.
    pub fn from_angles([pitch, yaw, roll]: [f64; 3]) -> Self {
        let (sx, cx) = pitch.sin_cos();
        let (sy, cy) = yaw.sin_cos();
        let (sz, cz) = roll.sin_cos();
        let x = Self([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]]);
        let y = Self([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]]);
        let z = Self([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]]);
        x.then_inner(&y).then_inner(&z)
    }

    /// The rotation of a quaternion (w, x, y, z), which is normalised first.
    pub fn from_quaternion(q: [f64; 4]) -> Self {
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        let [w, x, y, z] = q.map(|c| c / length);
        Self([
            [
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - w * z),
                2.0 * (x * z + w * y),
            ],
            [
                2.0 * (x * y + w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - w * x),
            ],
            [
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
            ],
        ])
    }

    /// R v.
    pub fn apply(&self, v: Vec3) -> Vec3 {
        [dot(self.0[0], v), dot(self.0[1], v), dot(self.0[2], v)]
    }

    /// Rᵀ v, the inverse rotation.
    pub fn apply_transposed(&self, v: Vec3) -> Vec3 {
        let r = &self.0;
        std::array::from_fn(|i| r[0][i] * v[0] + r[1][i] * v[1] + r[2][i] * v[2])
    }

    /// The product R · inner: `inner` acts first.
    pub fn then_inner(&self, inner: &Self) -> Self {
        Self(std::array::from_fn(|i| inner.apply_transposed(self.0[i])))
    }
}

/// A rigid motion p ↦ R p + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// R.
    pub rotation: Rotation,
    /// t.
    pub translation: Vec3,
}

impl Motion {
    /// A rotation about a pivot that stays where it is.
    pub fn about(pivot: Vec3, rotation: Rotation) -> Self {
        Self {
            rotation,
            translation: sub(pivot, rotation.apply(pivot)),
        }
    }

    /// R p + t.
    pub fn apply(&self, p: Vec3) -> Vec3 {
        add(self.rotation.apply(p), self.translation)
    }

    /// The product M · inner: `inner` acts first.
    pub fn then_inner(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation.then_inner(&inner.rotation),
            translation: self.apply(inner.translation),
        }
    }
}
