//! Eigenpairs: golden values, analytic spectra, invariances, hard inputs.

use crate::support::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::whiten::whiten;
use shapelex_core::mesh::{PrepareOptions, TriangleSoup, prepare};
use shapelex_core::spectral::{EigenOptions, SpectralError, assemble, smallest_eigenpairs};
use std::f64::consts::PI;

fn golden_facts() -> serde_json::Value {
    let text = std::fs::read_to_string(golden("eigenvalues.json")).expect("golden file");
    serde_json::from_str(&text).expect("json")
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value
        .as_array()
        .expect("array")
        .iter()
        .map(|x| x.as_f64().expect("number"))
        .collect()
}

#[test]
fn golden_eigenvalues() {
    for (name, facts) in golden_facts()["meshes"].as_object().expect("meshes") {
        let expected = numbers(&facts["eigenvalues"]);
        let (o, pairs) = solve(&read_off(&golden(&format!("{name}.off"))), 100);
        assert_sound(&o, &pairs);
        let worst = relative_difference(&pairs.values, &expected, expected[1]);
        assert!(worst < 1e-8, "{name}: {worst:e}");
        assert_eq!(pairs.values[0], 0.0);
    }
}

#[test]
fn sphere_spectrum_converges() {
    // l(l+1), 2l+1 times each, times 4π because the area is 1.
    let errors: Vec<f64> = [2, 3, 4, 5]
        .into_iter()
        .map(|level| {
            let (o, pairs) = solve(&mesh(icosphere(level)), 49);
            assert_sound(&o, &pairs);
            let exact: Vec<f64> = (0..7)
                .flat_map(|l| vec![4.0 * std::f64::consts::PI * f64::from(l * (l + 1)); 2 * l as usize + 1])
                .collect();
            relative_difference(&pairs.values[1..], &exact[1..], 0.0)
        })
        .collect();
    assert!(errors[3] < 0.005, "{errors:?}");
    for pair in errors.windows(2) {
        assert!(pair[1] < 0.35 * pair[0], "second order: {errors:?}");
    }
}

#[test]
fn multiplets_come_complete() {
    // 200 of a sphere's eigenvalues cut the multiplet l = 14 (196..225); sizes on both sides of the solver's choice.
    for level in [3, 4] {
        let (o, pairs) = solve(&mesh(icosphere(level)), 200);
        assert_sound(&o, &pairs);
        let (_, more) = solve(&mesh(icosphere(level)), 230);
        assert!(relative_difference(&pairs.values[1..], &more.values[1..200], 0.0) < 1e-9);
    }
}

#[test]
fn motion_scale_and_order_do_not_matter() {
    let (vertices, faces) = bumpy_sphere(4);
    let (_, reference) = solve(&mesh((vertices.clone(), faces.clone())), 120);
    let (s, c) = 0.7f64.sin_cos();
    let moved: Vec<[f64; 3]> = vertices
        .iter()
        .map(|p| {
            [
                3.0 * (c * p[0] - s * p[1]) + 5.0,
                3.0 * (s * p[0] + c * p[1]) - 2.0,
                3.0 * p[2] + 1.0,
            ]
        })
        .collect();
    let (_, pairs) = solve(&mesh((moved, faces.clone())), 120);
    assert!(
        relative_difference(&pairs.values[1..], &reference.values[1..], 0.0) < 1e-9,
        "rigid motion and scale"
    );

    // Vertices renumbered by a multiplicative shuffle, faces reversed in order and orientation.
    let n = vertices.len();
    let place = |i: usize| (i * 1009 + 17) % n;
    let mut shuffled = vec![[0.0; 3]; n];
    for (i, p) in vertices.iter().enumerate() {
        shuffled[place(i)] = *p;
    }
    let refaced: Vec<[u32; 3]> = faces
        .iter()
        .rev()
        .map(|f| [f[2], f[1], f[0]].map(|k| place(k as usize) as u32))
        .collect();
    let (_, pairs) = solve(&mesh((shuffled, refaced)), 120);
    assert!(
        relative_difference(&pairs.values[1..], &reference.values[1..], 0.0) < 1e-9,
        "order"
    );
    let mut worst = 0.0f64;
    for k in 0..100 {
        for i in 0..n {
            worst = worst.max((pairs.vectors[(place(i), k)] - reference.vectors[(i, k)]).abs());
        }
    }
    assert!(worst < 1e-3, "vectors, signs included: {worst:e}");
}

#[test]
fn same_input_gives_the_same_bytes() {
    for level in [3, 4] {
        let m = mesh(bumpy_sphere(level));
        let ((_, a), (_, b)) = (solve(&m, 60), solve(&m, 60));
        assert_eq!(a.values, b.values);
        assert_eq!(a.vectors, b.vectors);
    }
}

fn repeated(part: &(Vec<[f64; 3]>, Vec<[u32; 3]>), times: usize) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for t in 0..times {
        let first = vertices.len() as u32;
        vertices.extend(part.0.iter().map(|p| [p[0] + 10.0 * t as f64, p[1], p[2]]));
        faces.extend(part.1.iter().map(|f| f.map(|k| k + first)));
    }
    (vertices, faces)
}

#[test]
fn every_component_has_its_zero() {
    // The last is more equal pieces than any block finds copies of, in a mesh too large for the dense solver.
    for (level, times, n) in [(2, 5, 60), (3, 3, 80), (2, 30, 100), (2, 40, 200)] {
        let part = bumpy_sphere(level);
        let (o, pairs) = solve(&mesh(repeated(&part, times)), n);
        assert_sound(&o, &pairs);
        assert_eq!(pairs.values.iter().filter(|v| **v == 0.0).count(), times);
        // Equal components: every other eigenvalue of the part, `times` times over.
        let (_, one) = solve(&mesh(part), n / times + 2);
        let expected: Vec<f64> = (0..n).map(|k| one.values[k / times] * times as f64).collect();
        assert!(
            relative_difference(&pairs.values[times..], &expected[times..], 0.0) < 1e-8,
            "{times} components"
        );
    }
}

#[test]
fn thousands_of_loose_triangles() {
    let triangle = (
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, 0.9, 0.0]],
        vec![[0, 1, 2]],
    );
    let (_, pairs) = solve(&mesh(repeated(&triangle, 3000)), 200);
    assert_eq!(pairs.values, vec![0.0; 200]);
}

#[test]
fn tiny_meshes_give_what_they_have() {
    let tetrahedron = (
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    );
    let (o, pairs) = solve(&mesh(tetrahedron), 200);
    assert_eq!(pairs.values.len(), 3, "V − 1");
    assert_sound(&o, &pairs);
    for n in [1, 2, 11, 12, 200] {
        let (o, pairs) = solve(&mesh(icosphere(0)), n);
        assert_eq!(pairs.values.len(), n.min(11));
        assert_sound(&o, &pairs);
    }
}

#[test]
fn any_number_of_pairs() {
    let m = mesh(bumpy_sphere(4));
    let (_, reference) = solve(&m, 700);
    for n in [1, 2, 3, 10, 41, 300, 480] {
        let (o, pairs) = solve(&m, n);
        assert_sound(&o, &pairs);
        assert!(
            relative_difference(&pairs.values[1..], &reference.values[1..n], 0.0) < 1e-8,
            "n = {n}"
        );
    }
}

#[test]
fn a_set_flag_stops_the_solve() {
    let operators = assemble(&mesh(bumpy_sphere(5))).expect("operators");
    let cancel = Cancel::new();
    cancel.cancel();
    let outcome = smallest_eigenpairs(&operators, 200, &EigenOptions::default(), &cancel);
    assert!(matches!(outcome, Err(SpectralError::Cancelled(_))));

    // Set from outside while it runs: it stops long before it would have finished.
    let cancel = Cancel::new();
    let from_outside = cancel.clone();
    let handle = std::thread::spawn(move || {
        std::thread::sleep(std::time::Duration::from_millis(5));
        from_outside.cancel();
    });
    let operators = assemble(&mesh(bumpy_sphere(6))).expect("operators");
    let outcome = smallest_eigenpairs(&operators, 200, &EigenOptions::default(), &cancel);
    handle.join().expect("thread");
    assert!(matches!(outcome, Err(SpectralError::Cancelled(_))));
}

#[test]
fn an_impossible_tolerance_is_an_error() {
    let operators = assemble(&mesh(bumpy_sphere(3))).expect("operators");
    let options = EigenOptions {
        tolerance: -1.0,
        ..Default::default()
    };
    let outcome = smallest_eigenpairs(&operators, 50, &options, &Cancel::new());
    assert!(matches!(outcome, Err(SpectralError::NotConverged { .. })));
}

#[test]
fn real_meshes() {
    let data = shapelex_testing::repository("../shared/data");
    for name in [
        "tosca_lowres/cat/cat0.off",
        "tosca_lowres/gorilla/gorilla1.off",
        "quaternius_animals/cow/bind.off",
        "quaternius_animals/alpaca/bind.off",
    ] {
        let path = data.join(name);
        if !path.exists() {
            eprintln!("skipped: real_meshes {name}: no ../shared/data");
            continue;
        }
        let (vertices, faces) = read_off_arrays(&path);
        let (vertices, faces) = referenced(vertices, faces);
        let expected = components(vertices.len(), &faces);
        let (o, pairs) = solve(&mesh((vertices, faces)), 200);
        assert_sound(&o, &pairs);
        assert_eq!(
            pairs.values.iter().filter(|v| **v == 0.0).count(),
            expected,
            "{name}"
        );
    }
}

#[test]
fn an_unlucky_shift_is_left_for_another() {
    // A vertex of an entry S_vv that all but equals the first shift, 4π · 0.58 · 60, is next to no pivot for a
    // factorisation that begins with it. The mesh is beyond the dense solver's reach. Which vertices come first only
    // the ordering knows; among these are some.
    let operators = assemble(&mesh(bumpy_sphere(5))).unwrap();
    let shift = 4.0 * std::f64::consts::PI * 0.58 * 60.0;
    for vertex in (0..10_000).step_by(1999) {
        let mut operators = operators.clone();
        let diagonal = *operators.stiffness.get(vertex, vertex).unwrap();
        operators.mass[vertex] = diagonal / (shift * (1.0 + 1e-12));
        let pairs = smallest_eigenpairs(&operators, 61, &EigenOptions::default(), &Cancel::new());
        let pairs = pairs.unwrap_or_else(|error| panic!("{vertex}: {error}"));
        assert_sound(&operators, &pairs);
    }
}

/// A sphere of 24 meridians and 12 rings of faces, most of whose vertices were pulled close to a neighbour.
fn needles(seed: u64) -> TriangleSoup {
    const MERIDIANS: usize = 24;
    const RINGS: usize = 12;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut vertices = vec![[0.0, 0.0, 1.0]];
    for ring in 1..RINGS {
        for meridian in 0..MERIDIANS {
            let (theta, phi) = (
                PI * ring as f64 / RINGS as f64,
                2.0 * PI * meridian as f64 / MERIDIANS as f64,
            );
            let r = 1.0 + 0.2 * (3.0 * theta).sin() * phi.cos();
            vertices.push([
                r * theta.sin() * phi.cos(),
                r * theta.sin() * phi.sin(),
                r * theta.cos(),
            ]);
        }
    }
    vertices.push([0.0, 0.0, -1.0]);
    let at = |ring: usize, meridian: usize| (1 + (ring - 1) * MERIDIANS + meridian % MERIDIANS) as u32;
    let last = (vertices.len() - 1) as u32;
    let mut faces = Vec::new();
    for j in 0..MERIDIANS {
        faces.push([0, at(1, j), at(1, j + 1)]);
        faces.push([last, at(RINGS - 1, j + 1), at(RINGS - 1, j)]);
    }
    for i in 1..RINGS - 1 {
        for j in 0..MERIDIANS {
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    for _ in 0..100 + 20 * (seed % 3) {
        let [a, b, _] = faces[rng.random_range(0..faces.len())].map(|v| v as usize);
        let t = 10f64.powf(-rng.random_range(1.0..7.0));
        vertices[a] = std::array::from_fn(|c| vertices[b][c] + t * (vertices[a][c] - vertices[b][c]));
    }
    TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    }
}

#[test]
fn what_the_dense_solver_gets_wrong_the_sparse_one_finds() {
    for seed in [1055, 1067, 1099, 1139, 1295, 1319, 1379] {
        let (mesh, report) = prepare(needles(seed), &PrepareOptions::default()).unwrap();
        assert!(report.vertices < 300, "so many go to the sparse solver first");
        for mesh in [whiten(&mesh).unwrap(), mesh] {
            let operators = assemble(&mesh).unwrap();
            let pairs = smallest_eigenpairs(&operators, 200, &EigenOptions::default(), &Cancel::new());
            let pairs = pairs.unwrap_or_else(|error| panic!("{seed}: {error}"));
            assert_eq!(pairs.values.len(), 200);
            // Entries of ‖S‖ of 10⁷ and more leave rounding errors above the tolerance in the residual.
            assert!(verify(&operators, &pairs).1 <= 1e-7, "{seed}");
        }
    }
}

#[test]
fn a_star_is_factorised() {
    // Pages of one edge, too many for the dense solver: but for the two hubs no vertex has a neighbour.
    let n = 3500;
    let mut vertices = vec![[0.0; 3], [0.0, 0.0, 1.0]];
    let mut faces = Vec::new();
    for i in 0..n {
        let (r, turn) = (1.0 + 2.0 * f64::from(i) / f64::from(n), 2.4 * f64::from(i));
        vertices.push([r * turn.cos(), r * turn.sin(), 0.5]);
        faces.push([0, 1, i as u32 + 2]);
    }
    let operators = assemble(&mesh((vertices, faces))).unwrap();
    // Its eigenvalues lie so close together that the recurrence may not tell them apart.
    match smallest_eigenpairs(&operators, 40, &EigenOptions::default(), &Cancel::new()) {
        Ok(pairs) => assert_sound(&operators, &pairs),
        Err(SpectralError::NotConverged { detail }) => assert!(!detail.contains("supernodal"), "{detail}"),
        Err(error) => panic!("{error}"),
    }
}
