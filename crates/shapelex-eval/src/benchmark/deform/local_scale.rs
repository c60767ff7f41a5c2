//! Local changes of scale, as in the SHREC 2010 robustness set.

use super::geometry::{distance, length_unit, vertex_areas};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::TriangleSoup;

/// Bulges at every strength.
const BULGES: usize = 3;
/// Width of a bulge (standard deviation of its Gaussian), in √area.
const WIDTH: f64 = 0.12;
/// Growth at the centre of a bulge, per strength.
const GROWTH: f64 = 0.16;

/// v ← v + g e^{−‖v − c‖² / 2w²} (v − m) around three centres c drawn by area, m the mean of the surface near c: bulges
/// whose size grows with the strength.
pub fn bulge(null: &TriangleSoup, strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let areas = vertex_areas(null);
    let total: f64 = areas.iter().sum();
    let width = WIDTH * length_unit(null);
    let growth = GROWTH * f64::from(strength);
    let mut vertices = null.vertices.clone();
    for _ in 0..BULGES {
        let mut threshold = rng.random::<f64>() * total;
        let centre = areas
            .iter()
            .position(|a| {
                threshold -= a;
                threshold <= 0.0
            })
            .map_or([0.0; 3], |v| vertices[v]);
        // The centre is on the surface; the point to grow from lies inside it on average, so the bulge points outwards.
        let weight = |p: &[f64; 3]| (-0.5 * (distance(p, &centre) / width).powi(2)).exp();
        let mut sum = 0.0;
        let mut mean = [0.0; 3];
        for (p, a) in vertices.iter().zip(&areas) {
            let w = a * weight(p);
            sum += w;
            (0..3).for_each(|k| mean[k] += w * p[k]);
        }
        if sum > 0.0 {
            mean.iter_mut().for_each(|x| *x /= sum);
        }
        for p in &mut vertices {
            let factor = growth * weight(p);
            *p = std::array::from_fn(|k| p[k] + factor * (p[k] - mean[k]));
        }
    }
    TriangleSoup {
        vertices,
        faces: null.faces.clone(),
        ..TriangleSoup::default()
    }
}
