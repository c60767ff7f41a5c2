//! Meshes just below the limits of size, of the kinds that are slow to prepare.

// Not among them: 500 000 faces on one edge. They are simplified to two thousand equal pages in good time, but the
// spectrum of these takes several seconds.

/// What is sent, as what, and the status it is answered with.
type Large = (&'static str, &'static str, Vec<u8>, u16);

pub const CASES: &[fn() -> Large] = &[
    || {
        let n = 1_900_000;
        let mut random = Random(7);
        let vertices = (0..n).map(|_| random.point());
        let body = ply(vertices.collect(), random.faces(n, 3_900_000));
        ("a random complex of 3.9 million faces", "model/ply", body, 200)
    },
    || {
        let n = 30_000;
        let mut random = Random(7);
        let vertices = (0..n).map(|_| random.point());
        let body = ply(vertices.collect(), random.faces(n, 3_900_000));
        ("3.9 million faces on 30 000 vertices", "model/ply", body, 200)
    },
    || {
        (
            "an STL lattice of 2.5 million facets",
            "model/stl",
            lattice(),
            200,
        )
    },
    || ("a cone of 500 000 faces", "model/ply", cone(500_000), 200),
    || ("a cone of 1.9 million faces", "model/ply", cone(1_900_000), 200),
    || {
        (
            "a ribbon of 1.9 million faces",
            "model/ply",
            ribbon(1_900_000),
            200,
        )
    },
    || {
        (
            "a scrambled sphere of 3.9 million faces",
            "model/ply",
            sphere(1400),
            200,
        )
    },
    || {
        let line = b"v 0 0 0\\\n".repeat(1_000_000);
        (
            "an OBJ of one line continued a million times",
            "model/obj",
            line,
            422,
        )
    },
];

/// Xorshift (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, n: u32) -> u32 {
        (((self.next() >> 32) * u64::from(n)) >> 32) as u32
    }

    fn point(&mut self) -> [f32; 3] {
        std::array::from_fn(|_| self.below(1 << 24) as f32 / (1 << 23) as f32 - 1.0)
    }

    fn faces(&mut self, vertices: u32, faces: u32) -> Vec<[u32; 3]> {
        (0..faces)
            .map(|_| std::array::from_fn(|_| self.below(vertices)))
            .collect()
    }
}

fn ply(vertices: Vec<[f32; 3]>, faces: Vec<[u32; 3]>) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    )
    .into_bytes();
    bytes.reserve_exact(12 * vertices.len() + 13 * faces.len());
    for x in vertices.iter().flatten() {
        bytes.extend(x.to_le_bytes());
    }
    for f in &faces {
        bytes.push(3);
        for v in f {
            bytes.extend(v.to_le_bytes());
        }
    }
    bytes
}

/// All unit squares of a lattice, four faces at every edge inside.
fn lattice() -> Vec<u8> {
    let side = 75u32;
    let mut bytes = vec![0u8; 84];
    let mut count = 0u32;
    let mut facet = |corners: [[u32; 3]; 3]| {
        bytes.extend([0u8; 12]);
        for x in corners.iter().flatten() {
            bytes.extend((*x as f32).to_le_bytes());
        }
        bytes.extend([0u8; 2]);
        count += 1;
    };
    for n in 0..side.pow(3) {
        let p = [n / side / side, n / side % side, n % side];
        for (u, v) in [(0, 1), (0, 2), (1, 2)] {
            if p[u] + 1 < side && p[v] + 1 < side {
                let step = |axes: &[usize]| {
                    let mut q = p;
                    axes.iter().for_each(|k| q[*k] += 1);
                    q
                };
                let (b, c, d) = (step(&[u]), step(&[u, v]), step(&[v]));
                facet([p, b, c]);
                facet([p, c, d]);
            }
        }
    }
    bytes[80..84].copy_from_slice(&count.to_le_bytes());
    bytes
}

/// Faces around one vertex.
fn cone(n: u32) -> Vec<u8> {
    let vertices = (0..=n)
        .map(|i| {
            let turn = i as f32 / n as f32 * std::f32::consts::TAU;
            let r = i.min(1) as f32;
            [r * turn.cos(), r * turn.sin(), 0.3 * r * (5.0 * turn).sin()]
        })
        .collect();
    ply(vertices, (1..=n).map(|i| [0, i, i % n + 1]).collect())
}

/// A strip of one face's width.
fn ribbon(n: u32) -> Vec<u8> {
    let vertices = (0..n)
        .map(|i| {
            let turn = f64::from(i / 2) * 20.0 / f64::from(n);
            let height = 0.1 * turn + 0.02 * f64::from(i % 2);
            [turn.cos() as f32, turn.sin() as f32, height as f32]
        })
        .collect();
    ply(vertices, (2..n).map(|i| [i - 2, i - 1, i]).collect())
}

/// A sphere whose vertices and faces are in a random order, half of the faces turned round.
fn sphere(side: u32) -> Vec<u8> {
    let mut random = Random(3);
    let mut points = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for i in 1..=side {
        let polar = std::f32::consts::PI * i as f32 / (side + 1) as f32;
        for j in 0..side {
            let turn = std::f32::consts::TAU * j as f32 / side as f32;
            let r = polar.sin() * (1.0 + 0.2 * (3.0 * turn).sin());
            points.push([r * turn.cos(), r * turn.sin(), polar.cos()]);
        }
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, random.below(i as u32 + 1) as usize);
    }
    let mut vertices = vec![[0.0; 3]; points.len()];
    for (p, at) in points.iter().zip(&order) {
        vertices[*at as usize] = *p;
    }
    let at = |i: u32, j: u32| order[(2 + i * side + j % side) as usize];
    let mut faces = Vec::new();
    for j in 0..side {
        faces.push([order[0], at(0, j), at(0, j + 1)]);
        for i in 0..side - 1 {
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j + 1), at(i, j), at(i + 1, j + 1)]);
        }
        faces.push([order[1], at(side - 1, j), at(side - 1, j + 1)]);
    }
    for i in (1..faces.len()).rev() {
        faces.swap(i, random.below(i as u32 + 1) as usize);
    }
    ply(vertices, faces)
}
