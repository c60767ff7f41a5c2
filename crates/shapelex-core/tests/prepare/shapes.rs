//! Meshes to test on: procedural ones, and a tiny reader for those in `../shared`.

use shapelex_core::mesh::{PrepareOptions, PrepareReport, TriMesh, TriangleSoup, prepare};
use std::collections::HashMap;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// The folder of shared test inputs, where present; says by name what is skipped otherwise.
pub fn shared(folder: &str, test: &str) -> Option<PathBuf> {
    let path = shapelex_testing::repository("../shared").join(folder);
    if path.is_dir() {
        Some(path)
    } else {
        eprintln!("skipped: {test}: no ../shared/{folder}");
        None
    }
}

/// Reads an OFF or OBJ file of plain `v`/`f` lines, polygons as fans.
pub fn read(path: &Path) -> TriangleSoup {
    let text = std::fs::read_to_string(path).unwrap();
    let mut soup = TriangleSoup::default();
    let fan = |faces: &mut Vec<[u32; 3]>, polygon: &[u32]| {
        for k in 1..polygon.len() - 1 {
            faces.push([polygon[0], polygon[k], polygon[k + 1]]);
        }
    };
    if path.extension().unwrap() == "obj" {
        for line in text.lines() {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("v") => {
                    let p: Vec<f64> = words.take(3).map(|w| w.parse().unwrap()).collect();
                    soup.vertices.push([p[0], p[1], p[2]]);
                }
                Some("f") => {
                    let polygon: Vec<u32> = words
                        .map(|w| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1)
                        .collect();
                    fan(&mut soup.faces, &polygon);
                }
                _ => {}
            }
        }
        return soup;
    }
    let mut words = text
        .lines()
        .map(|l| l.split('#').next().unwrap())
        .flat_map(str::split_whitespace);
    assert_eq!(words.next(), Some("OFF"));
    let mut number = || words.next().unwrap().parse::<f64>().unwrap();
    let (v, f) = (number() as usize, number() as usize);
    number();
    for _ in 0..v {
        soup.vertices.push([number(), number(), number()]);
    }
    for _ in 0..f {
        let polygon: Vec<u32> = (0..number() as usize).map(|_| number() as u32).collect();
        fan(&mut soup.faces, &polygon);
    }
    soup
}

/// A unit sphere of 20 · 4^levels faces, by splitting an icosahedron.
pub fn icosphere(levels: usize) -> TriangleSoup {
    let t = (1.0 + 5f64.sqrt()) / 2.0;
    let unit = |p: [f64; 3]| {
        let r = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
        p.map(|x| x / r)
    };
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
    #[rustfmt::skip]
    let mut faces: Vec<[u32; 3]> = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
        [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10],
        [8, 6, 7], [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middle = HashMap::new();
        let mut next = Vec::with_capacity(4 * faces.len());
        for [a, b, c] in faces {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(i, j)| {
                *middle.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    let (p, q) = (vertices[i as usize], vertices[j as usize]);
                    vertices.push(unit(std::array::from_fn(|k| p[k] + q[k])));
                    vertices.len() as u32 - 1
                })
            });
            next.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        faces = next;
    }
    TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    }
}

/// A sphere by longitude and latitude: `rings` · `sectors` + 2 vertices.
pub fn globe(rings: u32, sectors: u32) -> TriangleSoup {
    let mut vertices = vec![[0.0, 0.0, 1.0]];
    for i in 1..=rings {
        let theta = PI * f64::from(i) / f64::from(rings + 1);
        for j in 0..sectors {
            let phi = 2.0 * PI * f64::from(j) / f64::from(sectors);
            vertices.push([theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]);
        }
    }
    vertices.push([0.0, 0.0, -1.0]);
    let at = |i: u32, j: u32| 1 + i * sectors + j % sectors;
    let last = vertices.len() as u32 - 1;
    let mut faces = Vec::new();
    for j in 0..sectors {
        faces.push([0, at(0, j), at(0, j + 1)]);
        for i in 0..rings - 1 {
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        faces.push([last, at(rings - 1, j + 1), at(rings - 1, j)]);
    }
    TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    }
}

/// A bumpy closed surface without symmetry, from [`icosphere`].
pub fn bumpy(levels: usize) -> TriangleSoup {
    let mut soup = icosphere(levels);
    for p in &mut soup.vertices {
        let [x, y, z] = *p;
        let r = 1.0 + 0.25 * (3.0 * x + 0.5).sin() * (2.0 * y).cos() + 0.15 * (4.0 * z + x).sin();
        *p = [1.6 * r * x, 1.1 * r * y, 0.8 * r * z];
    }
    soup
}

/// Every face with its own three vertices, as an STL file has it.
pub fn as_stl(soup: &TriangleSoup) -> TriangleSoup {
    let vertices: Vec<[f64; 3]> = (soup.faces.iter().flatten())
        .map(|v| soup.vertices[*v as usize])
        .collect();
    let faces = (0..soup.faces.len() as u32)
        .map(|f| [3 * f, 3 * f + 1, 3 * f + 2])
        .collect();
    TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    }
}

/// Default options without simplification.
pub fn full_size() -> PrepareOptions {
    PrepareOptions {
        working_size: 0,
        ..PrepareOptions::default()
    }
}

pub fn prepare_full(soup: TriangleSoup) -> (TriMesh, PrepareReport) {
    prepare(soup, &full_size()).unwrap()
}

/// A seeded permutation of 0..n.
pub fn permutation(n: usize, seed: u64) -> Vec<usize> {
    use rand::{Rng, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    order
}

/// The same soup with vertices and faces in another order.
pub fn shuffled(soup: &TriangleSoup, seed: u64) -> TriangleSoup {
    let order = permutation(soup.vertices.len(), seed);
    let mut to = vec![0u32; order.len()];
    for (new, old) in order.iter().enumerate() {
        to[*old] = new as u32;
    }
    TriangleSoup {
        vertices: order.iter().map(|v| soup.vertices[*v]).collect(),
        faces: permutation(soup.faces.len(), seed + 1)
            .into_iter()
            .map(|f| soup.faces[f].map(|v| to[v as usize]))
            .collect(),
        ..TriangleSoup::default()
    }
}

/// x ↦ linear · x + offset.
pub fn mapped(soup: &TriangleSoup, linear: [[f64; 3]; 3], offset: [f64; 3]) -> TriangleSoup {
    TriangleSoup {
        vertices: (soup.vertices.iter())
            .map(|p| {
                std::array::from_fn(|i| {
                    linear[i][0] * p[0] + linear[i][1] * p[1] + linear[i][2] * p[2] + offset[i]
                })
            })
            .collect(),
        faces: soup.faces.clone(),
        ..TriangleSoup::default()
    }
}

/// A rotation about a skew axis.
pub fn rotation() -> [[f64; 3]; 3] {
    let (a, b) = (0.7f64, 1.9f64);
    let (ca, sa, cb, sb) = (a.cos(), a.sin(), b.cos(), b.sin());
    [[ca, -sa, 0.0], [sa * cb, ca * cb, -sb], [sa * sb, ca * sb, cb]]
}

/// The edge lengths of all faces, sorted: what does not change under motions and orders.
pub fn edge_lengths(mesh: &TriMesh) -> Vec<f64> {
    let mut all: Vec<f64> = (mesh.faces().iter())
        .flat_map(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]])
        .map(|e| {
            let [p, q] = e.map(|v| mesh.vertices()[v as usize]);
            (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all
}

/// Largest difference of two equally long lists.
pub fn largest_difference(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len());
    x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// Asserts that a prepared mesh keeps every promise of [`TriMesh`] and has unit area about the origin.
pub fn assert_prepared(mesh: &TriMesh, report: &PrepareReport) {
    let anew = TriMesh::new(
        mesh.vertices().to_vec(),
        mesh.faces().to_vec(),
        mesh.signature_vertices(),
    )
    .unwrap();
    // Needles a million times as long as they are wide have areas that rounding moves, and with them the centroid.
    let extent = mesh
        .vertices()
        .iter()
        .flatten()
        .fold(1.0, |m: f64, x| m.max(x.abs()));
    let rounding = 64.0 * f64::EPSILON * extent * extent;
    for area in [mesh.area(), anew.area()] {
        assert!((area - 1.0).abs() < 1e-9 + rounding, "area {area}");
    }
    assert_eq!(report.vertices, mesh.signature_vertices());
    assert_eq!(report.faces, mesh.faces().len());
    assert_eq!(
        mesh.vertices().len(),
        mesh.signature_vertices() + report.holes_filled
    );
    assert!(report.area.is_finite() && report.openness.is_finite());
    assert!((0.0..=1.0).contains(&report.area_dropped));
    assert!(
        mesh.centroid().iter().all(|x| x.abs() < 1e-6 + extent * rounding),
        "{:?} of extent {extent}",
        mesh.centroid()
    );
}
