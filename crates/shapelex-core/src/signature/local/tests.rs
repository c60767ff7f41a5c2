use super::*;
use std::f64::consts::TAU;

/// A bumpy torus of `n` × `m` vertices.
fn torus(n: u32, m: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for i in 0..n {
        for j in 0..m {
            let (u, v) = (
                TAU * f64::from(i) / f64::from(n),
                TAU * f64::from(j) / f64::from(m),
            );
            let tube = 0.4 + 0.05 * (3.0 * u).sin() + 0.03 * (2.0 * v + 1.0).cos();
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
    (vertices, faces)
}

/// Of unit area.
fn mesh((vertices, faces): (Vec<[f64; 3]>, Vec<[u32; 3]>)) -> TriMesh {
    let n = vertices.len();
    TriMesh::new(vertices, faces, n).unwrap().normalised().unwrap()
}

fn parameters() -> LocalParameters {
    LocalParameters {
        radii: vec![0.08, 0.15],
        keypoints: 200,
        ..LocalParameters::default()
    }
}

fn signatures(mesh: &TriMesh) -> Mat<f64> {
    local_signatures(mesh, &parameters(), &Cancel::new())
        .unwrap()
        .matrix
}

/// Distance of each column to that of another matrix.
fn distances(a: &Mat<f64>, b: &Mat<f64>) -> Vec<f64> {
    assert_eq!((a.nrows(), a.ncols()), (b.nrows(), b.ncols()));
    (0..a.ncols()).map(|j| (a.col(j) - b.col(j)).norm_l2()).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Mean distance of the signatures that two meshes of one surface have at the same places.
fn disagreement(a: &TriMesh, b: &TriMesh, parameters: &LocalParameters) -> f64 {
    let of = |mesh| oriented_points(mesh, parameters);
    let (a, b) = (of(a), of(b));
    let places: Vec<Point> = a.keypoints(200).iter().map(|&k| *a.point(k)).collect();
    let at = |points| histograms(points, &places, parameters, &Cancel::new()).unwrap();
    mean(&distances(&at(&a), &at(&b)))
}

/// Each face cut into four, the surface as it is; vertices and faces in another order.
fn subdivided(mesh: &TriMesh) -> TriMesh {
    let n = mesh.vertices().len() as u32;
    let mut vertices = mesh.vertices().to_vec();
    let mut middle = std::collections::HashMap::new();
    let mut faces = Vec::new();
    for &[a, b, c] in mesh.faces() {
        let mut between = |a: u32, b: u32| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let (p, q) = (vertices[a as usize], vertices[b as usize]);
                vertices.push(std::array::from_fn(|k| 0.5 * (p[k] + q[k])));
                vertices.len() as u32 - 1
            })
        };
        let (ab, bc, ca) = (between(a, b), between(b, c), between(c, a));
        faces.extend([[ab, bc, ca], [a, ab, ca], [b, bc, ab], [c, ca, bc]]);
    }
    faces.sort_by_key(|f| (u64::from(f[0]) * 2_654_435_761) % 10_007);
    let count = vertices.len();
    assert!(count > 3 * n as usize);
    TriMesh::new(vertices, faces, count).unwrap()
}

#[test]
fn signatures_are_of_unit_norm_and_the_same_each_time() {
    let mesh = mesh(torus(60, 30));
    let first = local_signatures(&mesh, &parameters(), &Cancel::new()).unwrap();
    assert_eq!((first.dimension(), first.len()), (504, 200));
    assert_eq!(first.vertices.len(), 200);
    for j in 0..first.len() {
        assert!((first.matrix.col(j).norm_l2() - 1.0).abs() < 1e-12);
    }
    assert_eq!(first.matrix, signatures(&mesh));
    let cancel = Cancel::new();
    cancel.cancel();
    assert!(local_signatures(&mesh, &parameters(), &cancel).is_err());
}

#[test]
fn a_rigid_motion_changes_nothing_but_rounding() {
    let still = mesh(torus(60, 30));
    let (sin, cos) = 0.7f64.sin_cos();
    let moved = still
        .vertices()
        .iter()
        .map(|[x, y, z]| {
            let (x, y) = (cos * x - sin * y, sin * x + cos * y);
            let (y, z) = (0.6 * y - 0.8 * z, 0.8 * y + 0.6 * z);
            [x + 0.3, y - 0.2, z + 0.1]
        })
        .collect();
    let moved = TriMesh::new(moved, still.faces().to_vec(), still.signature_vertices()).unwrap();
    let distances = distances(&signatures(&still), &signatures(&moved));
    // A point on the limit between two bins of distance may fall into either.
    let changed = distances.iter().filter(|d| **d > 1e-3).count();
    assert!(
        changed <= 6,
        "{changed} of {} differ by more than 1e-3",
        distances.len()
    );
    assert!(mean(&distances) < 2e-3, "{}", mean(&distances));
}

#[test]
fn faces_may_run_either_way_round() {
    let (vertices, faces) = torus(60, 30);
    let expected = signatures(&mesh((vertices.clone(), faces.clone())));
    for stride in [1, 3] {
        let mut reversed = faces.clone();
        reversed.iter_mut().step_by(stride).for_each(|f| f.swap(1, 2));
        assert_eq!(signatures(&mesh((vertices.clone(), reversed))), expected);
    }
}

#[test]
fn another_triangulation_of_the_surface_gives_nearly_the_same() {
    let coarse = mesh(torus(60, 30));
    let fine = subdivided(&coarse);
    let other = mesh(torus(75, 44));
    // What two places on the surface differ by.
    let signatures = signatures(&coarse);
    let apart: Vec<f64> = (0..100)
        .map(|j| (signatures.col(j) - signatures.col(j + 100)).norm_l2())
        .collect();
    let apart = mean(&apart);
    for (mesh, bound) in [(&fine, 0.20), (&other, 0.25)] {
        let usual = disagreement(&coarse, mesh, &parameters());
        let dense = LocalParameters {
            points: 1800,
            ..parameters()
        };
        let dense = disagreement(&coarse, mesh, &dense);
        println!("{usual:.3} with 90 points, {dense:.3} with 1800, {apart:.3} between places");
        assert!(usual < bound && usual < 0.5 * apart, "{usual} {apart}");
        assert!(dense < 0.7 * usual, "{dense} {usual}");
    }
}

#[test]
fn what_is_cut_off_changes_nothing_farther_than_the_radius() {
    let whole = mesh(torus(60, 30));
    let left = |f: &&[u32; 3]| f.iter().all(|&v| whole.vertices()[v as usize][0] < 0.1);
    let faces: Vec<[u32; 3]> = whole.faces().iter().filter(left).copied().collect();
    let mut place = vec![u32::MAX; whole.vertices().len()];
    let mut vertices = Vec::new();
    let faces: Vec<[u32; 3]> = faces
        .iter()
        .map(|f| {
            f.map(|v| {
                if place[v as usize] == u32::MAX {
                    place[v as usize] = vertices.len() as u32;
                    vertices.push(whole.vertices()[v as usize]);
                }
                place[v as usize]
            })
        })
        .collect();
    let n = vertices.len();
    let part = TriMesh::new(vertices, faces, n).unwrap();
    let (of_whole, of_part) = (
        oriented_points(&whole, &parameters()),
        oriented_points(&part, &parameters()),
    );
    let distant = |at: &Point| at.place[0] < -0.1;
    let places: Vec<Point> = of_part
        .keypoints(0)
        .iter()
        .map(|&k| *of_part.point(k))
        .filter(distant)
        .collect();
    assert!(places.len() > 500);
    let at = |points| histograms(points, &places, &parameters(), &Cancel::new()).unwrap();
    let difference = mean(&distances(&at(&of_whole), &at(&of_part)));
    assert!(difference < 0.2, "{difference}");
}

#[test]
fn averaged_normals_bear_noise() {
    let clean = mesh(torus(60, 30));
    let edge = 0.024;
    let mut state = 1u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1u32 << 31) * 2.0 - 1.0
    };
    let noisy = clean
        .vertices()
        .iter()
        .map(|p| p.map(|x| x + 0.4 * edge * random()))
        .collect();
    let noisy = TriMesh::new(noisy, clean.faces().to_vec(), clean.signature_vertices()).unwrap();
    let with = |smoothing| {
        let parameters = LocalParameters {
            smoothing,
            ..parameters()
        };
        disagreement(&clean, &noisy, &parameters)
    };
    let (rough, averaged) = (with(0.0), with(0.5));
    assert!(averaged < 0.97 * rough, "{averaged} {rough}");
}

#[test]
fn no_keypoint_lies_on_a_face_that_closes_a_hole() {
    let (vertices, faces) = torus(60, 30);
    // The vertices of the last ring are taken for added ones.
    let n = vertices.len();
    let mesh = TriMesh::new(vertices, faces, n - 30)
        .unwrap()
        .normalised()
        .unwrap();
    let signatures = local_signatures(&mesh, &parameters(), &Cancel::new()).unwrap();
    assert_eq!(signatures.len(), 200);
    assert!(signatures.vertices.iter().all(|v| (*v as usize) < n - 30));
}
