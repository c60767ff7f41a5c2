//! The doubled open surface: golden eigenvalues, and the glued mesh itself as the oracle.

use crate::support::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::spectral::{
    EigenOptions, assemble, dirichlet_eigenpairs, doubled_eigenpairs, smallest_eigenpairs,
};
use std::collections::HashMap;

type Arrays = (Vec<[f64; 3]>, Vec<[u32; 3]>);

fn boundary_of((vertices, faces): &Arrays) -> Vec<bool> {
    let mut uses: HashMap<(u32, u32), usize> = HashMap::new();
    for f in faces {
        for k in 0..3 {
            let (a, b) = (f[k], f[(k + 1) % 3]);
            *uses.entry((a.min(b), a.max(b))).or_default() += 1;
        }
    }
    let mut boundary = vec![false; vertices.len()];
    for ((a, b), _) in uses.into_iter().filter(|(_, count)| *count == 1) {
        boundary[a as usize] = true;
        boundary[b as usize] = true;
    }
    boundary
}

/// The mesh glued to a copy of itself along the boundary.
fn glued((vertices, faces): &Arrays, boundary: &[bool]) -> Arrays {
    let (mut v, mut f) = (vertices.clone(), faces.clone());
    let copy: Vec<u32> = (0..vertices.len())
        .map(|i| {
            if boundary[i] {
                i as u32
            } else {
                v.push(vertices[i]);
                v.len() as u32 - 1
            }
        })
        .collect();
    f.extend(faces.iter().map(|t| [t[2], t[1], t[0]].map(|k| copy[k as usize])));
    (v, f)
}

#[test]
fn golden_doubled_spectrum() {
    let text = std::fs::read_to_string(golden("eigenvalues.json")).expect("golden file");
    let data: serde_json::Value = serde_json::from_str(&text).expect("json");
    let expected: Vec<f64> = data["meshes"]["saddle_open_hole"]["doubled_eigenvalues"]
        .as_array()
        .expect("array")
        .iter()
        .map(|x| x.as_f64().expect("number"))
        .collect();
    let arrays = read_off_arrays(&golden("saddle_open_hole.off"));
    let boundary = boundary_of(&arrays);
    let operators = assemble(&mesh(arrays)).expect("operators");
    let even = smallest_eigenpairs(&operators, 60, &EigenOptions::default(), &Cancel::new()).expect("pairs");
    let pairs = doubled_eigenpairs(
        &operators,
        &even,
        &boundary,
        60,
        &EigenOptions::default(),
        &Cancel::new(),
    )
    .expect("pairs");
    assert!(relative_difference(&pairs.values, &expected, expected[1]) < 1e-8);
    assert_eq!(pairs.values[0], 0.0);
}

#[test]
fn equals_the_glued_mesh() {
    // A bumpy sphere with its southern third cut off, and the golden saddle; small and large enough for both solvers.
    let cut = |level| {
        let (vertices, faces) = bumpy_sphere(level);
        let kept: Vec<[u32; 3]> = faces
            .into_iter()
            .filter(|f| f.iter().all(|&k| vertices[k as usize][2] > -0.3))
            .collect();
        referenced(vertices, kept)
    };
    for (arrays, n) in [
        (read_off_arrays(&golden("saddle_open_hole.off")), 100),
        (cut(3), 50),
        (cut(4), 160),
    ] {
        let boundary = boundary_of(&arrays);
        let open = assemble(&mesh(arrays.clone())).expect("operators");
        let options = EigenOptions::default();
        let even = smallest_eigenpairs(&open, n, &options, &Cancel::new()).expect("pairs");
        let doubled =
            doubled_eigenpairs(&open, &even, &boundary, n, &options, &Cancel::new()).expect("pairs");
        let (_, reference) = solve(&mesh(glued(&arrays, &boundary)), n);
        assert!(relative_difference(&doubled.values[1..], &reference.values[1..], 0.0) < 1e-9);
        // The squares of the vectors, up to the last multiplet, agree on the original copy.
        for k in 0..n - 5 {
            let isolated = (k == 0 || reference.values[k] - reference.values[k - 1] > 0.5)
                && reference.values[k + 1] - reference.values[k] > 0.5;
            if isolated {
                for i in 0..boundary.len() {
                    let (a, b) = (doubled.vectors[(i, k)], reference.vectors[(i, k)]);
                    assert!((a * a - b * b).abs() < 1e-3, "pair {k} at vertex {i}: {a} {b}");
                }
            }
        }
    }
}

#[test]
fn dirichlet_vectors_vanish_on_the_boundary() {
    let arrays = read_off_arrays(&golden("saddle_open_hole.off"));
    let boundary = boundary_of(&arrays);
    let operators = assemble(&mesh(arrays)).expect("operators");
    let options = EigenOptions::default();
    let pairs = dirichlet_eigenpairs(&operators, &boundary, 40, &options, &Cancel::new()).expect("pairs");
    let neumann = smallest_eigenpairs(&operators, 40, &options, &Cancel::new()).expect("pairs");
    assert!(pairs.values[0] > 1.0);
    for k in 0..40 {
        assert!(pairs.values[k] >= neumann.values[k], "domain monotonicity");
        let norm: f64 = (0..boundary.len())
            .map(|i| operators.mass[i] * pairs.vectors[(i, k)].powi(2))
            .sum();
        assert!((norm - 1.0).abs() < 1e-9);
        assert!((0..boundary.len()).all(|i| !boundary[i] || pairs.vectors[(i, k)] == 0.0));
    }
}

#[test]
fn a_mesh_that_is_all_boundary() {
    let arrays = (
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let operators = assemble(&mesh(arrays)).expect("operators");
    let even = smallest_eigenpairs(&operators, 10, &EigenOptions::default(), &Cancel::new()).expect("pairs");
    let pairs = doubled_eigenpairs(
        &operators,
        &even,
        &[true; 4],
        10,
        &EigenOptions::default(),
        &Cancel::new(),
    );
    assert_eq!(pairs.expect("pairs").values.len(), 3);
}
