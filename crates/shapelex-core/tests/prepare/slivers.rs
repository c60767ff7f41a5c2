//! Faces without area are taken out and the surface stays what it is.

use crate::shapes::*;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::edges::edge_census;
use shapelex_core::mesh::refine::refine;
use shapelex_core::mesh::{PrepareReport, TriMesh, TriangleSoup};
use shapelex_core::spectral::{EigenOptions, assemble, smallest_eigenpairs};

/// The first eigenvalues after 0, of the mesh refined as a query is.
fn spectrum(mesh: &TriMesh, count: usize) -> Vec<f64> {
    let fine = refine(mesh.clone(), 1000).unwrap();
    let operators = assemble(&fine).unwrap();
    let pairs = smallest_eigenpairs(&operators, count + 1, &EigenOptions::default(), &Cancel::new());
    pairs.unwrap().values[1..].to_vec()
}

fn assert_same_spectrum(found: &[f64], expected: &[f64], tolerance: f64, what: &str) {
    for (x, y) in found.iter().zip(expected) {
        assert!(
            (x / y - 1.0).abs() < tolerance,
            "{what}: {found:?}, not {expected:?}"
        );
    }
}

fn case(name: &str) -> TriangleSoup {
    read(&shapelex_testing::data("clean").join(name))
}

fn euler(mesh: &TriMesh) -> i64 {
    let census = edge_census(mesh.vertices().len(), mesh.faces());
    let edges = (3 * mesh.faces().len() + census.boundary.len()) / 2;
    mesh.vertices().len() as i64 - edges as i64 + mesh.faces().len() as i64
}

fn assert_closed(mesh: &TriMesh, report: &PrepareReport, characteristic: i64) {
    assert_prepared(mesh, report);
    assert_eq!((report.boundary_edges, report.holes_filled), (0, 0), "{report:?}");
    let census = edge_census(mesh.vertices().len(), mesh.faces());
    assert_eq!((census.non_manifold, census.inconsistent), (0, 0), "{report:?}");
    assert_eq!(euler(mesh), characteristic, "{report:?}");
}

/// Puts a vertex on an edge of a face, at `share` of its length and off by `offset`: the face is split, and a cap closes
/// what opens towards the neighbour. The edge is the one after `corner`.
fn put_on_edge(soup: &mut TriangleSoup, face: usize, corner: usize, share: f64, offset: [f64; 3]) {
    let f = soup.faces[face];
    let [x, y, z] = [f[corner], f[(corner + 1) % 3], f[(corner + 2) % 3]];
    let t = soup.vertices.len() as u32;
    let (p, q) = (soup.vertices[x as usize], soup.vertices[y as usize]);
    soup.vertices
        .push(std::array::from_fn(|k| p[k] + share * (q[k] - p[k]) + offset[k]));
    soup.faces[face] = [x, t, z];
    soup.faces.extend([[t, y, z], [x, y, t]]);
}

#[test]
fn a_box_whose_edge_is_closed_by_a_cap() {
    let mut surface = case("box_cap.obj");
    surface.faces.pop();
    surface.faces.retain(|f| *f != [4, 5, 6]);
    surface.faces.extend([[4, 8, 6], [8, 5, 6]]);
    let (clean, report) = prepare_full(surface);
    assert_eq!((report.repaired_faces, report.degenerate_faces), (0, 0));
    assert!(report.warnings.iter().all(|w| w.contains("Only 9")), "{report:?}");
    let expected = spectrum(&clean, 10);
    // Solved for independently on a fine mesh of the same box.
    assert_same_spectrum(&expected, &[15.61, 32.72, 32.72], 0.005, "the box itself");
    for name in ["box_cap.obj", "box_near_cap.obj"] {
        for soup in [case(name), as_stl(&case(name))] {
            let (mesh, report) = prepare_full(soup);
            assert_closed(&mesh, &report, 2);
            assert_eq!((report.repaired_faces, report.degenerate_faces), (1, 0));
            assert_eq!((report.vertices, report.faces), (9, 14));
            assert!((report.area - 10.0).abs() < 1e-5, "{}", report.area);
            assert!(report.warnings[0].starts_with("1 face is so thin"), "{report:?}");
            assert_same_spectrum(&spectrum(&mesh, 10), &expected, 1e-3, name);
        }
    }
}

#[test]
fn caps_of_any_height_leave_the_spectrum_of_the_box() {
    let (cap, _) = prepare_full(case("box_cap.obj"));
    let expected = spectrum(&cap, 5);
    for exponent in 3..=16 {
        for digit in [1.0, 3.0] {
            let height = digit * 10f64.powi(-exponent);
            for off in [[0.0, -height, height], [0.0, height, height], [0.0, 0.0, -height]] {
                let mut soup = case("box_near_cap.obj");
                soup.vertices[8] = [1.0 + off[0], off[1], 1.0 + off[2]];
                let (mesh, report) = prepare_full(soup);
                assert_closed(&mesh, &report, 2);
                let tolerance = 1e-3 + height;
                assert_same_spectrum(&spectrum(&mesh, 5), &expected, tolerance, &format!("{off:?}"));
            }
        }
    }
}

/// A flat box of 4 × 3 × 0.2.
fn plate() -> TriangleSoup {
    let mut soup = case("box_cap.obj");
    soup.faces.pop();
    soup.faces.retain(|f| *f != [4, 5, 6]);
    soup.faces.extend([[4, 8, 6], [8, 5, 6]]);
    for p in &mut soup.vertices {
        *p = [2.0 * p[0], 3.0 * p[1], 0.2 * p[2]];
    }
    soup
}

#[test]
fn a_plate_with_a_hundred_vertices_on_its_edges() {
    let (clean, _) = prepare_full(plate());
    let expected = spectrum(&clean, 6);
    for seed in 0..4 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut soup = plate();
        // On the edges of faces and on those of caps alike.
        for _ in 0..100 {
            let face = rng.random_range(0..soup.faces.len());
            put_on_edge(
                &mut soup,
                face,
                rng.random_range(0..3),
                rng.random_range(0.2..0.8),
                [0.0; 3],
            );
        }
        let (mesh, report) = prepare_full(soup);
        assert_closed(&mesh, &report, 2);
        assert!(report.repaired_faces >= 50, "{report:?}");
        assert!((report.area - (24.0 + 2.8)).abs() < 1e-6, "{}", report.area);
        // The triangles at vertices put anywhere are thin, and eigenvalues on them a little too large.
        assert_same_spectrum(&spectrum(&mesh, 3), &expected, 0.05, &format!("seed {seed}"));
    }
}

#[test]
fn a_chain_of_vertices_on_one_edge_from_both_sides() {
    let mut soup = plate();
    let face = soup.faces.iter().position(|f| *f == [0, 1, 5]).unwrap();
    // The edge 0–1 of the bottom: fifty on one side, each on what is left of the edge.
    for k in 0..50 {
        put_on_edge(&mut soup, face, 0, 1.0 - 1.0 / f64::from(51 - k), [0.0; 3]);
    }
    let other = soup
        .faces
        .iter()
        .position(|f| f.contains(&0) && f.contains(&1) && f.contains(&2))
        .unwrap();
    let along = (0..3)
        .find(|k| {
            [soup.faces[other][*k], soup.faces[other][(*k + 1) % 3]]
                .iter()
                .all(|v| *v < 2)
        })
        .unwrap();
    for k in 0..30 {
        put_on_edge(&mut soup, other, along, 0.93 - 0.001 * f64::from(k), [0.0; 3]);
    }
    let (mesh, report) = prepare_full(soup);
    assert_closed(&mesh, &report, 2);
    assert_eq!(report.repaired_faces, 80);
    assert!((report.area - 26.8).abs() < 1e-9);
}

#[test]
fn caps_at_a_border_and_at_a_non_manifold_edge() {
    // A square of two faces with a cap on one side of its border: the border passes through its corner afterwards.
    let mut square = TriangleSoup {
        vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        faces: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    };
    put_on_edge(&mut square, 0, 0, 0.3, [0.0; 3]);
    let (mesh, report) = prepare_full(square);
    assert_eq!((report.repaired_faces, report.boundary_edges), (1, 5));
    assert_eq!((mesh.vertices().len(), mesh.faces().len()), (5, 3));
    assert!((report.area - 1.0).abs() < 1e-12);

    // Three pages on one edge; the first has a vertex there, closed towards the others by a cap.
    let mut book = TriangleSoup {
        vertices: vec![
            [0.0; 3],
            [0.0, 0.0, 2.0],
            [1.0, 0.0, 1.0],
            [-0.5, 0.8, 1.0],
            [-0.5, -0.8, 1.0],
        ],
        faces: vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]],
        ..Default::default()
    };
    put_on_edge(&mut book, 0, 0, 0.5, [1e-9, 0.0, 0.0]);
    let (mesh, report) = prepare_full(book);
    assert_eq!((report.repaired_faces, report.degenerate_faces), (1, 0));
    assert_eq!((mesh.faces().len(), report.non_manifold_edges), (6, 2));
    assert_eq!(report.boundary_edges, 6);
}

#[test]
fn a_needle_is_closed() {
    // A vertex of a sphere twice, a millionth of an edge apart, with two needles between.
    let mut soup = icosphere(2);
    let v = 40u32;
    let around: Vec<usize> = (0..soup.faces.len())
        .filter(|f| soup.faces[*f].contains(&v))
        .collect();
    let first = soup.faces[around[0]];
    let k = first.iter().position(|w| *w == v).unwrap();
    let (mut at, begin) = (first[(k + 1) % 3], first[(k + 1) % 3]);
    let copy = soup.vertices.len() as u32;
    let p = soup.vertices[v as usize];
    soup.vertices.push([p[0] + 1e-7, p[1], p[2] - 1e-7]);
    // Half of the fan goes to the copy.
    for _ in 0..3 {
        let f = (around.iter().copied())
            .find(|f| {
                let g = soup.faces[*f];
                (0..3).any(|k| g[k] == v && g[(k + 1) % 3] == at)
            })
            .unwrap();
        let k = soup.faces[f].iter().position(|w| *w == v).unwrap();
        at = soup.faces[f][(k + 2) % 3];
        soup.faces[f][k] = copy;
    }
    soup.faces.extend([[v, begin, copy], [v, copy, at]]);
    let (mesh, report) = prepare_full(soup);
    assert_closed(&mesh, &report, 2);
    assert_eq!(
        (report.repaired_faces, report.vertices, report.faces),
        (2, 162, 320)
    );
}

#[test]
fn the_order_of_vertices_and_faces_does_not_matter() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut soup = bumpy(2);
    for _ in 0..60 {
        let face = rng.random_range(0..soup.faces.len());
        put_on_edge(
            &mut soup,
            face,
            rng.random_range(0..3),
            rng.random_range(0.1..0.9),
            [1e-9; 3],
        );
    }
    let (mesh, report) = prepare_full(soup.clone());
    let reference = edge_lengths(&mesh);
    for seed in 0..6 {
        let (other, other_report) = prepare_full(shuffled(&soup, seed));
        assert!(largest_difference(&edge_lengths(&other), &reference) < 1e-9);
        assert_eq!(other_report.repaired_faces, report.repaired_faces);
    }
}

#[test]
fn many_caps_take_linear_time() {
    let mut soup = globe(240, 240);
    let faces = soup.faces.len();
    for face in 0..faces {
        put_on_edge(&mut soup, face, face % 3, 0.4, [0.0; 3]);
    }
    let (mesh, report) = prepare_full(soup);
    assert_closed(&mesh, &report, 2);
    assert!(report.repaired_faces >= faces, "{report:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn closed_surfaces_stay_closed(
        torus in any::<bool>(),
        seed in any::<u64>(),
        // On faces and on caps alike, many times over.
        count in 1usize..100,
        exponent in -16i32..-5,
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut soup = if torus { ring(12, 7) } else { bumpy(1) };
        let (before, before_report) = prepare_full(soup.clone());
        let characteristic = euler(&before);
        for _ in 0..count {
            let face = rng.random_range(0..soup.faces.len());
            let height = 10f64.powi(exponent);
            let offset = std::array::from_fn(|_| height * rng.random_range(-1.0..1.0));
            put_on_edge(&mut soup, face, rng.random_range(0..3), rng.random_range(0.05..0.95), offset);
        }
        let (mesh, report) = prepare_full(soup);
        assert_closed(&mesh, &report, characteristic);
        prop_assert!((report.area / before_report.area - 1.0).abs() < 1e-3, "{report:?}");
    }
}

/// A torus.
fn ring(around: u32, across: u32) -> TriangleSoup {
    let tau = std::f64::consts::TAU;
    let mut soup = TriangleSoup::default();
    for i in 0..around {
        for j in 0..across {
            let (u, v) = (
                f64::from(i) / f64::from(around) * tau,
                f64::from(j) / f64::from(across) * tau,
            );
            let r = 2.0 + 0.7 * v.cos();
            soup.vertices
                .push([r * u.cos(), r * u.sin(), 0.7 * v.sin() + 0.1 * u.cos()]);
        }
    }
    let at = |i: u32, j: u32| i % around * across + j % across;
    for i in 0..around {
        for j in 0..across {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            soup.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    soup
}
