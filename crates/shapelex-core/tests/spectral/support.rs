//! Meshes the spectral tests share.

use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::TriMesh;
use shapelex_core::spectral::{EigenOptions, Eigenpairs, Operators, assemble, smallest_eigenpairs};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub fn golden(name: &str) -> PathBuf {
    shapelex_testing::data("golden").join(name)
}

/// A triangle mesh from a plain OFF file, read in order.
pub fn read_off(path: &Path) -> TriMesh {
    let (vertices, faces) = read_off_arrays(path);
    TriMesh::new(vertices, faces, usize::MAX).expect("valid mesh")
}

pub fn read_off_arrays(path: &Path) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let text = std::fs::read_to_string(path).expect("readable");
    let mut tokens = text.split_whitespace();
    assert_eq!(tokens.next(), Some("OFF"));
    let mut number = || tokens.next().expect("token").parse::<f64>().expect("number");
    let (v, f, _) = (number() as usize, number() as usize, number());
    let vertices = (0..v).map(|_| [number(), number(), number()]).collect();
    let faces = (0..f)
        .map(|_| {
            assert_eq!(number(), 3.0);
            [number() as u32, number() as u32, number() as u32]
        })
        .collect();
    (vertices, faces)
}

/// A geodesic unit sphere: 10·4^level + 2 vertices.
pub fn icosphere(level: usize) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let t = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices: Vec<[f64; 3]> = [
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
    ]
    .map(unit)
    .to_vec();
    let mut faces: Vec<[u32; 3]> = vec![
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
    for _ in 0..level {
        let mut middle = HashMap::new();
        let mut finer = Vec::with_capacity(4 * faces.len());
        for f in &faces {
            let m = [0, 1, 2].map(|k| {
                let (a, b) = (f[k].min(f[(k + 1) % 3]), f[k].max(f[(k + 1) % 3]));
                *middle.entry((a, b)).or_insert_with(|| {
                    let (p, q) = (vertices[a as usize], vertices[b as usize]);
                    vertices.push(unit([p[0] + q[0], p[1] + q[1], p[2] + q[2]]));
                    vertices.len() as u32 - 1
                })
            });
            finer.extend([[f[0], m[0], m[2]], [f[1], m[1], m[0]], [f[2], m[2], m[1]], m]);
        }
        faces = finer;
    }
    (vertices, faces)
}

fn unit(p: [f64; 3]) -> [f64; 3] {
    let l = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    p.map(|x| x / l)
}

/// A bumpy closed surface without symmetry.
pub fn bumpy_sphere(level: usize) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (vertices, faces) = icosphere(level);
    let bump = |[x, y, z]: [f64; 3]| {
        let r =
            1.0 + 0.3 * (3.0 * x + 1.0).sin() + 0.2 * (4.0 * y - 0.5).cos() * z + 0.1 * (7.0 * z * x).sin();
        [1.4 * r * x, r * y, 0.8 * r * z]
    };
    (vertices.into_iter().map(bump).collect(), faces)
}

pub fn mesh((vertices, faces): (Vec<[f64; 3]>, Vec<[u32; 3]>)) -> TriMesh {
    TriMesh::new(vertices, faces, usize::MAX).expect("valid mesh")
}

pub fn solve(mesh: &TriMesh, n: usize) -> (Operators, Eigenpairs) {
    let operators = assemble(mesh).expect("operators");
    let pairs =
        smallest_eigenpairs(&operators, n, &EigenOptions::default(), &Cancel::new()).expect("eigenpairs");
    (operators, pairs)
}

/// Recomputes, independently of the solver, the largest relative residual and the largest entry of ΦᵀAΦ − I.
pub fn verify(operators: &Operators, pairs: &Eigenpairs) -> (f64, f64) {
    let (v, n) = (pairs.vectors.nrows(), pairs.vectors.ncols());
    let top = pairs.values[n - 1].max(1.0);
    let mut worst_residual = 0.0f64;
    let mut worst_product = 0.0f64;
    let weighted = faer::Mat::from_fn(v, n, |i, k| pairs.vectors[(i, k)] * operators.mass[i]);
    let gram = pairs.vectors.transpose() * &weighted;
    for k in 0..n {
        let mut r: Vec<f64> = (0..v).map(|i| -pairs.values[k] * weighted[(i, k)]).collect();
        for (column, entries) in operators.stiffness.outer_iterator().enumerate() {
            for (row, w) in entries.iter() {
                r[row] += w * pairs.vectors[(column, k)];
            }
        }
        let norm = r
            .iter()
            .zip(&operators.mass)
            .map(|(r, a)| r * r / a)
            .sum::<f64>()
            .sqrt();
        // Zero modes are held against the scale of the spectrum.
        let scale = if pairs.values[k] > 0.0 {
            pairs.values[k]
        } else {
            top
        };
        worst_residual = worst_residual.max(norm / scale);
        for j in 0..n {
            worst_product = worst_product.max((gram[(j, k)] - f64::from(u8::from(j == k))).abs());
        }
    }
    (worst_residual, worst_product)
}

pub fn assert_sound(operators: &Operators, pairs: &Eigenpairs) {
    assert!(pairs.values.windows(2).all(|w| w[0] <= w[1]), "ascending");
    let (residual, product) = verify(operators, pairs);
    assert!(residual <= 1e-6, "residual {residual:e}");
    assert!(product <= 1e-7, "orthogonality {product:e}");
}

/// The largest |a − b| / max(b, floor).
pub fn relative_difference(a: &[f64], b: &[f64], floor: f64) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs() / b.max(floor))
        .fold(0.0, f64::max)
}

/// Drops vertices that no face uses.
pub fn referenced(vertices: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let mut number = vec![u32::MAX; vertices.len()];
    let mut kept = Vec::new();
    let faces = faces
        .into_iter()
        .filter(|f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0])
        .map(|f| {
            f.map(|k| {
                let slot = &mut number[k as usize];
                if *slot == u32::MAX {
                    *slot = kept.len() as u32;
                    kept.push(vertices[k as usize]);
                }
                *slot
            })
        })
        .collect();
    (kept, faces)
}

/// Connected components, counted by merging the corners of every face.
pub fn components(vertices: usize, faces: &[[u32; 3]]) -> usize {
    let mut parent: Vec<usize> = (0..vertices).collect();
    fn root(parent: &mut [usize], mut k: usize) -> usize {
        while parent[k] != k {
            parent[k] = parent[parent[k]];
            k = parent[k];
        }
        k
    }
    for f in faces {
        for k in 1..3 {
            let (a, b) = (root(&mut parent, f[0] as usize), root(&mut parent, f[k] as usize));
            parent[a] = b;
        }
    }
    (0..vertices).filter(|&k| parent[k] == k).count()
}
