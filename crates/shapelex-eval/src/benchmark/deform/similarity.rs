//! Turned, moved and scaled.

use super::geometry::{length_unit, map, rotation};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::TriangleSoup;

/// The scale factor lies between 2 to minus and to plus this.
const OCTAVES: f64 = 2.0;
/// Largest translation along each axis, in √area.
const FAR: f64 = 10.0;

/// v ← s R v + t: R uniform over all rotations, log₂ s uniform over ±2, t uniform over a cube.
pub fn similarity(mesh: &TriangleSoup, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let turn = rotation(rng);
    let scale = rng.random_range(-OCTAVES..OCTAVES).exp2();
    let far = FAR * length_unit(mesh);
    let shift: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0) * far);
    let place = |p: &[f64; 3]| {
        let turned = map(&turn, p);
        std::array::from_fn(|k| scale * turned[k] + shift[k])
    };
    TriangleSoup {
        vertices: mesh.vertices.iter().map(place).collect(),
        faces: mesh.faces.clone(),
        ..TriangleSoup::default()
    }
}
