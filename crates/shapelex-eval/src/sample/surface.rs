//! Implicit body → closed triangle surface, by marching tetrahedra on a cubic grid.
//!
//! Every cube is cut into the six tetrahedra of Kuhn's subdivision, which fit together across cubes, so the surface
//! is a closed manifold whatever the signs at the corners are (marching cubes and surface nets do not promise that).
//! Space is halved recursively and only blocks the surface can pass through are looked at.

use super::body::Body;
use super::vector::{Vec3, add_scaled, lerp, sub};
use shapelex_core::mesh::TriangleSoup;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Cubes along the edge of a leaf block.
const BLOCK: usize = 4;
const CORNERS: usize = BLOCK + 1;

/// The surface of `body` on a grid of the given spacing. Vertices lie on the grid's edges.
pub fn polygonise(body: &Body, spacing: f64, offset: Vec3) -> TriangleSoup {
    let [low, high] = body.bounds();
    let extent = sub(high, low).into_iter().fold(0.0, f64::max) + 4.0 * spacing;
    let mut cubes = BLOCK;
    while (cubes as f64) * spacing < extent {
        cubes *= 2;
    }
    // The offset moves the grid by up to a cube; two cubes of margin keep the body inside.
    let origin = add_scaled(
        sub(low, [2.0 * spacing; 3]),
        offset.map(|t| t.clamp(0.0, 1.0)),
        spacing,
    );
    let mut grid = Grid {
        body,
        origin,
        spacing,
        vertices: Vec::new(),
        faces: Vec::new(),
        on_edge: HashMap::default(),
    };
    grid.visit([0; 3], cubes, &body.all_parts());
    TriangleSoup {
        vertices: grid.vertices,
        faces: grid.faces,
        ..TriangleSoup::default()
    }
}

struct Grid<'a> {
    body: &'a Body,
    origin: Vec3,
    spacing: f64,
    vertices: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
    /// Vertex on the edge from a grid corner towards one of seven neighbours.
    on_edge: HashMap<u64, u32, BuildHasherDefault<KeyHasher>>,
}

/// Spreads an edge's number over the table by one multiplication (Knuth's multiplicative hashing): the keys are our
/// own, so the default's defence against chosen keys would only cost time.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_u64(u64::from(b) ^ self.0);
        }
    }

    fn write_u64(&mut self, key: u64) {
        self.0 = key.wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(26);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

/// A corner of a tetrahedron: its offset in the cube as bits x, y, z, its place in the grid, its field.
#[derive(Clone, Copy)]
struct Corner {
    bits: u8,
    value: f64,
}

impl Grid<'_> {
    fn position(&self, corner: [u16; 3]) -> Vec3 {
        std::array::from_fn(|i| self.origin[i] + f64::from(corner[i]) * self.spacing)
    }

    fn visit(&mut self, base: [u16; 3], cubes: usize, parts: &[u16]) {
        let half = 0.5 * cubes as f64 * self.spacing;
        let centre = add_scaled(self.position(base), [1.0; 3], half);
        let Some(parts) = self.body.prune(centre, half * 3f64.sqrt(), parts) else {
            return;
        };
        if cubes == BLOCK {
            self.march(base, &parts);
            return;
        }
        for bits in 0..8u8 {
            let step = (cubes / 2) as u16;
            let child = offset(base, bits, step);
            self.visit(child, cubes / 2, &parts);
        }
    }

    fn march(&mut self, base: [u16; 3], parts: &[u16]) {
        let mut values = [0.0; CORNERS * CORNERS * CORNERS];
        let index = |i: usize, j: usize, k: usize| (i * CORNERS + j) * CORNERS + k;
        for i in 0..CORNERS {
            for j in 0..CORNERS {
                for k in 0..CORNERS {
                    let corner = [base[0] + i as u16, base[1] + j as u16, base[2] + k as u16];
                    values[index(i, j, k)] = self.body.value(self.position(corner), parts);
                }
            }
        }
        for i in 0..BLOCK {
            for j in 0..BLOCK {
                for k in 0..BLOCK {
                    let cube: [Corner; 8] = std::array::from_fn(|bits| Corner {
                        bits: bits as u8,
                        value: values[index(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2))],
                    });
                    let inside = cube.iter().filter(|c| c.value < 0.0).count();
                    if inside == 0 || inside == 8 {
                        continue;
                    }
                    let corner = [base[0] + i as u16, base[1] + j as u16, base[2] + k as u16];
                    for (a, b, positive) in KUHN {
                        let path = [cube[0], cube[a], cube[a | b], cube[7]];
                        let tetrahedron = if positive {
                            path
                        } else {
                            [path[0], path[1], path[3], path[2]]
                        };
                        self.cut(corner, tetrahedron);
                    }
                }
            }
        }
    }

    /// The one or two triangles in which the surface cuts a positively oriented tetrahedron, seen from outside.
    fn cut(&mut self, cube: [u16; 3], t: [Corner; 4]) {
        let inside: Vec<usize> = (0..4).filter(|&i| t[i].value < 0.0).collect();
        let outside: Vec<usize> = (0..4).filter(|&i| t[i].value >= 0.0).collect();
        let mut order: Vec<usize> = inside.iter().chain(&outside).copied().collect();
        // Keep the tetrahedron positively oriented after the inner corners were moved to the front.
        let odd = (0..4)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .filter(|&(i, j)| order[j] > order[i])
            .count()
            % 2
            == 1;
        if odd {
            if inside.len() == 2 {
                order.swap(2, 3);
            } else {
                order.swap(1, 2);
            }
        }
        let [i, j, k, l] = [t[order[0]], t[order[1]], t[order[2]], t[order[3]]];
        match inside.len() {
            1 => {
                let f = [(i, j), (i, k), (i, l)].map(|(a, b)| self.vertex(cube, a, b));
                self.faces.push(f);
            }
            2 => {
                let [p, q, r, s] = [(i, k), (i, l), (j, l), (j, k)].map(|(a, b)| self.vertex(cube, a, b));
                self.faces.push([p, q, r]);
                self.faces.push([p, r, s]);
            }
            3 => {
                // After an odd swap of places 1 and 2 the last corner is still the outer one.
                let f = [(l, i), (l, j), (l, k)].map(|(a, b)| self.vertex(cube, a, b));
                self.faces.push(f);
            }
            _ => {}
        }
    }

    /// The vertex where the surface crosses an edge of the cube; made on first use.
    fn vertex(&mut self, cube: [u16; 3], a: Corner, b: Corner) -> u32 {
        // Along a path of Kuhn's subdivision bits are only added, so one end's bits contain the other's.
        let (from, to) = if a.bits < b.bits { (a, b) } else { (b, a) };
        let start = offset(cube, from.bits, 1);
        let key = start
            .iter()
            .fold(u64::from(to.bits ^ from.bits), |key, &c| key << 16 | u64::from(c));
        if let Some(&v) = self.on_edge.get(&key) {
            return v;
        }
        // Away from the ends of the edge no sliver arises; later steps bring the vertex onto the surface.
        let t = (from.value / (from.value - to.value)).clamp(0.1, 0.9);
        let p = lerp(self.position(start), self.position(offset(cube, to.bits, 1)), t);
        let v = self.vertices.len() as u32;
        self.vertices.push(p);
        self.on_edge.insert(key, v);
        v
    }
}

fn offset(base: [u16; 3], bits: u8, step: u16) -> [u16; 3] {
    std::array::from_fn(|i| base[i] + step * u16::from(bits >> i & 1))
}

/// Kuhn's six tetrahedra 000, a, a|b, 111: first and second axis of the path as bits, and whether it is positively
/// oriented (an even permutation of the axes).
const KUHN: [(usize, usize, bool); 6] = [
    (1, 2, true),
    (2, 4, true),
    (4, 1, true),
    (2, 1, false),
    (4, 2, false),
    (1, 4, false),
];
