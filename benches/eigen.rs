//! The eigen-solve: 200 pairs on closed bumpy surfaces of 1.5k, 5k and 20k vertices, and assembly.
//!
//! `cargo bench --bench eigen`. Meshes are geodesic spheres, deformed so that no symmetry is left, in shuffled order.

use criterion::{Criterion, criterion_group, criterion_main};
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::TriMesh;
use shapelex_core::spectral::{EigenOptions, assemble, smallest_eigenpairs};
use std::collections::HashMap;
use std::hint::black_box;

/// A closed surface of 10 f² + 2 vertices.
fn surface(frequency: usize) -> TriMesh {
    let t = (1.0 + 5f64.sqrt()) / 2.0;
    let corners: [[f64; 3]; 12] = [
        [-1.0, t, 0.0],
        [1.0, t, 0.0],
        [-1.0, -t, 0.0],
        [1.0, -t, 0.0],
        [0.0, -1.0, t],
        [0.0, 1.0, t],
        [0.0, -1.0, -t],
        [0.0, 1.0, -t],
        [t, 0.0, -1.0],
        [t, 0.0, 1.0],
        [-t, 0.0, -1.0],
        [-t, 0.0, 1.0],
    ];
    let sides: [[usize; 3]; 20] = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let mut number: HashMap<[i64; 3], u32> = HashMap::new();
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut faces: Vec<[u32; 3]> = Vec::new();
    for side in sides {
        let [a, b, c] = side.map(|k| corners[k]);
        let mut at = |i: usize, j: usize| {
            let (u, v) = (i as f64 / frequency as f64, j as f64 / frequency as f64);
            let p: [f64; 3] = std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
            let l = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
            let p = p.map(|x| x / l);
            *number
                .entry(p.map(|x| (x * 1e7).round() as i64))
                .or_insert_with(|| {
                    vertices.push(p);
                    vertices.len() as u32 - 1
                })
        };
        for i in 0..frequency {
            for j in 0..frequency - i {
                faces.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < frequency {
                    faces.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    let n = vertices.len();
    let place = |i: usize| (i * 7919 + 13) % n;
    let mut deformed = vec![[0.0; 3]; n];
    let jitter = |i: usize, k: usize| 0.25 / frequency as f64 * ((i * 37 + k * 101) as f64 * 1.7).sin();
    for (i, [x, y, z]) in vertices.into_iter().enumerate() {
        let r =
            1.0 + 0.3 * (3.0 * x + 1.0).sin() + 0.2 * (4.0 * y - 0.5).cos() * z + 0.1 * (7.0 * z * x).sin();
        deformed[place(i)] = [
            1.4 * r * x + jitter(i, 0),
            r * y + jitter(i, 1),
            0.8 * r * z + jitter(i, 2),
        ];
    }
    let faces = faces
        .into_iter()
        .map(|f| f.map(|k| place(k as usize) as u32))
        .collect();
    TriMesh::new(deformed, faces, n).expect("a closed surface")
}

fn eigenpairs(c: &mut Criterion) {
    let mut group = c.benchmark_group("eigenpairs_200");
    group.sample_size(10);
    for frequency in [12, 22, 45] {
        let operators = assemble(&surface(frequency)).expect("operators");
        group.bench_function(operators.mass.len().to_string(), |b| {
            b.iter(|| {
                smallest_eigenpairs(
                    black_box(&operators),
                    200,
                    &EigenOptions::default(),
                    &Cancel::new(),
                )
                .expect("eigenpairs")
            })
        });
    }
    group.finish();
}

fn assembly(c: &mut Criterion) {
    let mesh = surface(45);
    c.bench_function("assemble_20252", |b| {
        b.iter(|| assemble(black_box(&mesh)).expect("operators"))
    });
}

criterion_group!(benches, eigenpairs, assembly);
criterion_main!(benches);
