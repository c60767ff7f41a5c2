//! Deformations that cut faces out.

use super::geometry::{edge_distances, keep_faces, length_unit, neighbours, vertex_areas};
use rand::Rng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::TriangleSoup;

/// Discs cut out at every strength.
const BIG_HOLES: usize = 4;
/// Radius of a disc per strength, in √area.
const BIG_RADIUS: f64 = 0.022;
/// Share of the vertices cut out per strength.
const MICRO_SHARE: f64 = 0.006;

/// Discs cut out of a shape that is also turned, moved and scaled.
const SIMILARITY_HOLES: usize = 6;
/// Radius of such a disc per strength, in √area.
const SIMILARITY_RADIUS: f64 = 0.045;

/// Cuts out discs around centres drawn by area; the radius grows with the strength.
pub fn big(null: &TriangleSoup, strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    discs(null, BIG_HOLES, BIG_RADIUS * f64::from(strength), rng)
}

/// As [`big`], with more and larger discs.
pub fn similarity_holes(null: &TriangleSoup, strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    discs(
        null,
        SIMILARITY_HOLES,
        SIMILARITY_RADIUS * f64::from(strength),
        rng,
    )
}

/// Cuts out `count` discs with a radius in √area, measured along the edges.
fn discs(null: &TriangleSoup, count: usize, radius: f64, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let edges = neighbours(null);
    let areas = vertex_areas(null);
    let total: f64 = areas.iter().sum();
    let radius = radius * length_unit(null);
    let mut removed = vec![false; null.vertices.len()];
    for _ in 0..count {
        let mut threshold = rng.random::<f64>() * total;
        let centre = areas
            .iter()
            .position(|a| {
                threshold -= a;
                threshold <= 0.0
            })
            .unwrap_or(0);
        for (v, d) in edge_distances(&edges, centre as u32, radius)
            .into_iter()
            .enumerate()
        {
            removed[v] |= d.is_finite();
        }
    }
    keep_faces(null, |f| !f.iter().any(|&v| removed[v as usize]))
}

/// Cuts out single vertices with all their faces.
pub fn micro(null: &TriangleSoup, strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let n = null.vertices.len();
    let count = ((MICRO_SHARE * f64::from(strength) * n as f64).ceil() as usize).min(n);
    let mut removed = vec![false; n];
    index::sample(rng, n, count)
        .into_iter()
        .for_each(|v| removed[v] = true);
    keep_faces(null, |f| !f.iter().any(|&v| removed[v as usize]))
}
