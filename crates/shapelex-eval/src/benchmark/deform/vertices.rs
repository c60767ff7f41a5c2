//! Deformations that move vertices and leave the faces alone.

use super::geometry::{gaussian, length_unit, map, neighbours, rotation};
use rand::Rng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::TriangleSoup;

/// Largest logarithmic stretch per strength.
const AFFINE_STRETCH: f64 = 0.135;
/// Scale factors of strengths 1 to 5 (the paper's).
const SCALES: [f64; 5] = [0.5, 0.875, 1.25, 1.625, 2.0];
/// Standard deviation of the noise per strength, in mean edge lengths.
const NOISE: f64 = 0.04;
/// Share of the vertices that shot noise throws, per strength.
const SHOT_SHARE: f64 = 0.004;
/// How far it throws them, in √area.
const SHOT_DISTANCE: f64 = 0.09;

/// v ← R diag(e^a, e^b, e^−a−b) Rᵀ v, a and b as large as the strength allows and of random order and sign: volume
/// stays, angles and areas do not.
pub fn affine(null: &TriangleSoup, strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let frame = rotation(rng);
    let largest = AFFINE_STRETCH * f64::from(strength);
    let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
    let first = sign * largest;
    let second = -first * rng.random_range(0.2..0.8);
    let stretch = [first.exp(), second.exp(), (-first - second).exp()];
    let matrix: [[f64; 3]; 3] = std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..3).map(|k| frame[i][k] * stretch[k] * frame[j][k]).sum())
    });
    TriangleSoup {
        vertices: null.vertices.iter().map(|p| map(&matrix, p)).collect(),
        faces: null.faces.clone(),
        ..TriangleSoup::default()
    }
}

/// v ← s v.
pub fn scale(null: &TriangleSoup, strength: u32) -> TriangleSoup {
    let s = SCALES[strength as usize - 1];
    TriangleSoup {
        vertices: null.vertices.iter().map(|p| p.map(|x| s * x)).collect(),
        faces: null.faces.clone(),
        ..TriangleSoup::default()
    }
}

/// v ← v + ε, ε Gaussian with a standard deviation proportional to the strength.
pub fn noise(null: &TriangleSoup, strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let edges = neighbours(null);
    let (sum, count) = edges
        .iter()
        .flatten()
        .fold((0.0, 0usize), |(s, n), e| (s + e.1, n + 1));
    let deviation = NOISE * f64::from(strength) * sum / count.max(1) as f64;
    let vertices = null
        .vertices
        .iter()
        .map(|p| p.map(|x| x + deviation * gaussian(rng)))
        .collect();
    TriangleSoup {
        vertices,
        faces: null.faces.clone(),
        ..TriangleSoup::default()
    }
}

/// A share of the vertices, growing with the strength, is moved a fixed distance in random directions.
pub fn shot_noise(null: &TriangleSoup, strength: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let mut vertices = null.vertices.clone();
    let count = (SHOT_SHARE * f64::from(strength) * vertices.len() as f64).ceil() as usize;
    let throw = SHOT_DISTANCE * length_unit(null);
    for i in index::sample(rng, vertices.len(), count.min(vertices.len())) {
        let direction: [f64; 3] = std::array::from_fn(|_| gaussian(rng));
        let norm = direction
            .iter()
            .map(|x| x * x)
            .sum::<f64>()
            .sqrt()
            .max(f64::MIN_POSITIVE);
        for k in 0..3 {
            vertices[i][k] += throw * direction[k] / norm;
        }
    }
    TriangleSoup {
        vertices,
        faces: null.faces.clone(),
        ..TriangleSoup::default()
    }
}
