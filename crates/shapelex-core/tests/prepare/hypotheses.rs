//! The whitened and the doubled mesh against golden spectra, by a dense eigen-solve of our own.

use crate::shapes::*;
use faer::{Mat, Side};
use shapelex_core::mesh::boundary::{boundary_vertices, openness};
use shapelex_core::mesh::double::double;
use shapelex_core::mesh::whiten::whiten;
use shapelex_core::mesh::{MeshError, PrepareOptions, TriMesh, TriangleSoup, prepare};

/// Stiffness and lumped mass (summing to 1) of a mesh, dense.
fn operators(mesh: &TriMesh) -> (Mat<f64>, Vec<f64>) {
    let n = mesh.vertices().len();
    let mut stiffness = Mat::<f64>::zeros(n, n);
    let mut mass = vec![0.0; n];
    for f in mesh.faces() {
        let p = f.map(|v| mesh.vertices()[v as usize]);
        for k in 0..3 {
            let (i, j) = (f[(k + 1) % 3] as usize, f[(k + 2) % 3] as usize);
            let u: [f64; 3] = std::array::from_fn(|x| p[(k + 1) % 3][x] - p[k][x]);
            let v: [f64; 3] = std::array::from_fn(|x| p[(k + 2) % 3][x] - p[k][x]);
            let cross = [
                u[1] * v[2] - u[2] * v[1],
                u[2] * v[0] - u[0] * v[2],
                u[0] * v[1] - u[1] * v[0],
            ];
            let twice_area = cross.iter().map(|x| x * x).sum::<f64>().sqrt();
            let half_cot = 0.5 * (u[0] * v[0] + u[1] * v[1] + u[2] * v[2]) / twice_area;
            stiffness[(i, j)] -= half_cot;
            stiffness[(j, i)] -= half_cot;
            stiffness[(i, i)] += half_cot;
            stiffness[(j, j)] += half_cot;
            mass[f[k] as usize] += twice_area / 6.0;
        }
    }
    let total: f64 = mass.iter().sum();
    (stiffness, mass.iter().map(|m| m / total).collect())
}

/// Ascending eigenvalues of W φ = λ A φ over the vertices that are `free`.
fn eigenvalues(mesh: &TriMesh, free: impl Fn(usize) -> bool) -> Vec<f64> {
    let (stiffness, mass) = operators(mesh);
    let rows: Vec<usize> = (0..mass.len()).filter(|v| free(*v)).collect();
    let scaled = Mat::from_fn(rows.len(), rows.len(), |i, j| {
        let (i, j) = (rows[i], rows[j]);
        stiffness[(i, j)] / (mass[i] * mass[j]).sqrt()
    });
    scaled.self_adjoint_eigenvalues(Side::Lower).unwrap()
}

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    let mut worst = 0f64;
    for (x, y) in found.iter().zip(expected) {
        worst = worst.max((x - y).abs() / y.abs().max(1.0));
    }
    eprintln!(
        "{what}: {} values, worst relative difference {worst:.1e}",
        expected.len()
    );
    assert!(worst < tolerance, "{what}: {worst:e}");
}

/// The folder of golden meshes, and the golden numbers of the hypotheses.
fn golden() -> (std::path::PathBuf, serde_json::Value) {
    let folder = shapelex_testing::data("golden");
    let text = std::fs::read_to_string(folder.join("hypotheses.json")).unwrap();
    (folder, serde_json::from_str(&text).unwrap())
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

/// As read, no hole filled, nothing simplified.
fn untouched(soup: TriangleSoup) -> TriMesh {
    let options = PrepareOptions {
        fill_holes_below: 0.0,
        ..full_size()
    };
    prepare(soup, &options).unwrap().0
}

#[test]
fn whitened_spectra_and_openness_are_the_golden_ones() {
    let (folder, golden) = golden();
    for name in ["bumpy_closed", "lobed_closed", "saddle_open_hole"] {
        let expected = &golden["meshes"][name];
        let mesh = untouched(read(&folder.join(format!("{name}.off"))));
        let open = expected["openness"].as_f64().unwrap();
        assert!((openness(&mesh) - open).abs() < 1e-6 * open.max(1.0), "{name}");
        let found = eigenvalues(&whiten(&mesh).unwrap(), |_| true);
        assert_close(&found, &numbers(&expected["whitened_eigenvalues"]), 1e-6, name);
    }
}

#[test]
fn doubled_spectrum_is_the_golden_one_and_the_union_of_two_smaller_ones() {
    let (folder, golden) = golden();
    let expected = &golden["meshes"]["saddle_open_hole"];
    let open = untouched(read(&folder.join("saddle_open_hole.off")));
    let closed = double(&open).unwrap();
    assert_eq!(closed.vertices().len() as u64, expected["doubled_vertices"]);
    assert_eq!(closed.faces().len() as u64, expected["doubled_faces"]);
    assert_eq!(closed.signature_vertices(), open.vertices().len());
    assert_eq!(openness(&closed), 0.0);
    let doubled = eigenvalues(&closed, |_| true);
    assert_close(
        &doubled,
        &numbers(&expected["doubled_eigenvalues"]),
        1e-6,
        "doubled",
    );

    // Normalised to unit area, the doubled mesh has half the mass per copy and so twice the eigenvalues.
    let on_boundary = boundary_vertices(&open);
    let mut union = eigenvalues(&open, |_| true);
    union.extend(eigenvalues(&open, |v| !on_boundary[v]));
    union.sort_by(f64::total_cmp);
    let union: Vec<f64> = union.iter().map(|x| 2.0 * x).collect();
    assert_eq!(union.len(), doubled.len());
    assert_close(&doubled, &union, 1e-8, "Neumann and Dirichlet");
}

#[test]
fn whitening_does_not_see_affine_maps() {
    let soup = bumpy(3);
    let reference = edge_lengths(&whiten(&untouched(soup.clone())).unwrap());
    let maps = [
        [[3.0, 0.4, -0.2], [0.1, 0.7, 0.3], [0.9, -0.5, 1.4]],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 3.0, 1.0]],
        [[-0.05, 0.0, 0.0], [0.0, 8.0, 0.0], [0.0, 0.0, 1.0]],
    ];
    for map in maps {
        let mesh = untouched(mapped(&soup, map, [5.0, 6.0, -7.0]));
        let white = whiten(&mesh).unwrap();
        assert!((white.area() - 1.0).abs() < 1e-9);
        assert_eq!(white.faces(), mesh.faces());
        let difference = largest_difference(&edge_lengths(&white), &reference);
        assert!(difference < 1e-6, "{difference:e}");
    }
    // Without whitening the same maps do show.
    let stretched = edge_lengths(&untouched(mapped(&soup, maps[0], [0.0; 3])));
    let plain = edge_lengths(&untouched(soup));
    assert!(largest_difference(&stretched, &plain) > 1e-2);
}

#[test]
fn flat_shapes_are_whitened_in_their_plane() {
    // An ellipse in a skew plane becomes a disc, and rounding noise across the plane is not blown up.
    let mut soup = TriangleSoup {
        vertices: vec![[0.0; 3]],
        faces: Vec::new(),
        ..TriangleSoup::default()
    };
    let n = 60;
    for i in 0..n {
        let t = f64::from(i) * std::f64::consts::TAU / f64::from(n);
        soup.vertices.push([5.0 * t.cos(), t.sin(), 0.0]);
        soup.faces.push([0, i as u32 + 1, (i as u32 + 1) % n as u32 + 1]);
    }
    let white = whiten(&untouched(mapped(&soup, rotation(), [1.0, 2.0, 3.0]))).unwrap();
    let centre = white.vertices()[0];
    let radii: Vec<f64> = (white.vertices()[1..].iter())
        .map(|p| (0..3).map(|k| (p[k] - centre[k]).powi(2)).sum::<f64>().sqrt())
        .collect();
    let (low, high) = (
        radii.iter().copied().fold(f64::MAX, f64::min),
        radii.iter().copied().fold(0.0, f64::max),
    );
    assert!(high / low < 1.0 + 1e-5, "{low} {high}");
}

#[test]
fn a_closed_surface_is_not_doubled() {
    let (mesh, _) = prepare_full(icosphere(2));
    assert!(matches!(double(&mesh), Err(MeshError::Invalid { .. })));
}
