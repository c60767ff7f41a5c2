//! What several deformations need to know of a mesh.

use rand::Rng;
use shapelex_core::mesh::TriangleSoup;
use shapelex_core::mesh::trimesh::face_area;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

/// √ of the total area: the unit of length.
pub fn length_unit(mesh: &TriangleSoup) -> f64 {
    mesh.faces
        .iter()
        .map(|f| face_area(&mesh.vertices, f))
        .sum::<f64>()
        .sqrt()
}

/// A third of the incident areas, one entry per vertex.
pub fn vertex_areas(mesh: &TriangleSoup) -> Vec<f64> {
    let mut areas = vec![0.0; mesh.vertices.len()];
    for f in &mesh.faces {
        let third = face_area(&mesh.vertices, f) / 3.0;
        f.iter().for_each(|&v| areas[v as usize] += third);
    }
    areas
}

/// Neighbours of every vertex with the lengths of the edges.
pub fn neighbours(mesh: &TriangleSoup) -> Vec<Vec<(u32, f64)>> {
    let mut lists = vec![Vec::new(); mesh.vertices.len()];
    for f in &mesh.faces {
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            let length = distance(&mesh.vertices[a as usize], &mesh.vertices[b as usize]);
            lists[a as usize].push((b, length));
            lists[b as usize].push((a, length));
        }
    }
    for list in &mut lists {
        list.sort_unstable_by_key(|e| e.0);
        list.dedup_by_key(|e| e.0);
    }
    lists
}

/// Distance along the edges from `source` to every vertex within `radius`; infinite beyond.
pub fn edge_distances(neighbours: &[Vec<(u32, f64)>], source: u32, radius: f64) -> Vec<f64> {
    #[derive(PartialEq)]
    struct Reached(f64, u32);
    impl Eq for Reached {}
    impl Ord for Reached {
        fn cmp(&self, other: &Self) -> Ordering {
            other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
        }
    }
    impl PartialOrd for Reached {
        fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
            Some(self.cmp(other))
        }
    }
    let mut distances = vec![f64::INFINITY; neighbours.len()];
    distances[source as usize] = 0.0;
    let mut heap = BinaryHeap::from([Reached(0.0, source)]);
    while let Some(Reached(d, v)) = heap.pop() {
        if d > distances[v as usize] {
            continue;
        }
        for &(w, length) in &neighbours[v as usize] {
            let next = d + length;
            if next <= radius && next < distances[w as usize] {
                distances[w as usize] = next;
                heap.push(Reached(next, w));
            }
        }
    }
    distances
}

/// Euclidean distance.
pub fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// A standard normal number (Box, Muller 1958).
pub fn gaussian(rng: &mut impl Rng) -> f64 {
    let u: f64 = 1.0 - rng.random::<f64>();
    (-2.0 * u.ln()).sqrt() * (TAU * rng.random::<f64>()).cos()
}

/// A random rotation, uniform over SO(3): a normalised Gaussian quaternion as a matrix.
pub fn rotation(rng: &mut impl Rng) -> [[f64; 3]; 3] {
    let q: [f64; 4] = std::array::from_fn(|_| gaussian(rng));
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    let [w, x, y, z] = q.map(|v| v / norm);
    [
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
    ]
}

/// Matrix times vector.
pub fn map(matrix: &[[f64; 3]; 3], p: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|k| matrix[i][k] * p[k]).sum())
}

/// The faces for which `keep` holds; vertices stay, used or not.
pub fn keep_faces(mesh: &TriangleSoup, keep: impl Fn(&[u32; 3]) -> bool) -> TriangleSoup {
    let faces = mesh.faces.iter().copied().filter(|f| keep(f)).collect();
    TriangleSoup {
        vertices: mesh.vertices.clone(),
        faces,
        ..TriangleSoup::default()
    }
}
