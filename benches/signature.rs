//! Local signatures: 1000 keypoints, two radii, on a closed surface of 2000 vertices, on one core.
//!
//! `cargo bench --bench signature`.

use criterion::{Criterion, criterion_group, criterion_main};
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::TriMesh;
use shapelex_core::signature::{LocalParameters, local_signatures};
use std::f64::consts::TAU;
use std::hint::black_box;

/// A bumpy torus of 2000 vertices and unit area.
fn surface() -> TriMesh {
    let (n, m) = (80u32, 25u32);
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for i in 0..n {
        for j in 0..m {
            let (u, v) = (
                TAU * f64::from(i) / f64::from(n),
                TAU * f64::from(j) / f64::from(m),
            );
            let tube = 0.3 + 0.05 * (3.0 * u).sin() + 0.03 * (2.0 * v + 1.0).cos();
            let r = 1.0 + tube * v.cos();
            vertices.push([
                1.3 * r * u.cos(),
                r * u.sin(),
                tube * v.sin() + 0.1 * (2.0 * u).cos(),
            ]);
            let at = |i: u32, j: u32| i % n * m + j % m;
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    let count = vertices.len();
    TriMesh::new(vertices, faces, count)
        .and_then(TriMesh::normalised)
        .expect("a closed surface")
}

fn local(c: &mut Criterion) {
    let mesh = surface();
    for keypoints in [1, 1000] {
        let parameters = LocalParameters {
            keypoints,
            ..LocalParameters::default()
        };
        c.bench_function(&format!("local_2000_vertices_{keypoints}_keypoints"), |b| {
            b.iter(|| local_signatures(black_box(&mesh), &parameters, &Cancel::new()).expect("signatures"))
        });
    }
}

criterion_group!(benches, local);
criterion_main!(benches);
