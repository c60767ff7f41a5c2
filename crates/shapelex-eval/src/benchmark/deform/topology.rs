//! Welding of what only touches.

use super::geometry::{distance, edge_distances, length_unit, neighbours};
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::TriangleSoup;

/// Pairs are welded that are at least this far apart along the surface, in √area …
const FAR: f64 = 0.4;
/// … and as near in space as any such pair, up to this many welds per strength.
const WELDS: usize = 2;
/// Vertices tried as one end of a pair.
const TRIED: usize = 400;

/// Moves pairs of vertices that are near in space and far along the surface together and makes them one.
pub fn weld(null: &TriangleSoup, strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let edges = neighbours(null);
    let far = FAR * length_unit(null);
    let mut ends: Vec<u32> = (0..null.vertices.len() as u32)
        .filter(|&v| !edges[v as usize].is_empty())
        .collect();
    ends.shuffle(rng);
    ends.truncate(TRIED);
    let mut pairs: Vec<(f64, u32, u32)> = ends
        .iter()
        .filter_map(|&a| {
            let along = edge_distances(&edges, a, far);
            (0..null.vertices.len() as u32)
                .filter(|&b| !along[b as usize].is_finite() && !edges[b as usize].is_empty())
                .map(|b| {
                    (
                        distance(&null.vertices[a as usize], &null.vertices[b as usize]),
                        a,
                        b,
                    )
                })
                .min_by(|x, y| x.0.total_cmp(&y.0))
        })
        .collect();
    pairs.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut target: Vec<u32> = (0..null.vertices.len() as u32).collect();
    let mut vertices = null.vertices.clone();
    let mut used = vec![false; vertices.len()];
    let mut left = WELDS * strength as usize;
    for (_, a, b) in pairs {
        if left == 0 {
            break;
        }
        if used[a as usize] || used[b as usize] {
            continue;
        }
        let middle = std::array::from_fn(|k| 0.5 * (vertices[a as usize][k] + vertices[b as usize][k]));
        vertices[a as usize] = middle;
        target[b as usize] = a;
        used[a as usize] = true;
        used[b as usize] = true;
        left -= 1;
    }
    let faces = null
        .faces
        .iter()
        .map(|f| f.map(|v| target[v as usize]))
        .filter(|f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0])
        .collect();
    TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    }
}
