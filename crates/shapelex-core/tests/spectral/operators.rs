//! Assembly: golden masses, symmetry, scale, degenerate and non-manifold input.

use crate::support::*;
use shapelex_core::mesh::TriMesh;
use shapelex_core::spectral::{Operators, assemble};

fn assert_well_formed(o: &Operators) {
    let w = &o.stiffness;
    assert!(w.data().iter().all(|x| x.is_finite()));
    assert!(o.mass.iter().all(|m| *m > 0.0 && m.is_finite()));
    assert!((o.mass.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    let largest = w.data().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for (column, entries) in w.outer_iterator().enumerate() {
        let sum: f64 = entries.iter().map(|(_, x)| x).sum();
        assert!(sum.abs() <= 1e-12 * largest, "row {column} sums to {sum:e}");
        for (row, x) in entries.iter() {
            assert_eq!(w.get(column, row), Some(x), "symmetric bit for bit");
        }
    }
}

#[test]
fn golden_masses() {
    let text = std::fs::read_to_string(golden("eigenvalues.json")).expect("golden file");
    let data: serde_json::Value = serde_json::from_str(&text).expect("json");
    for (name, facts) in data["meshes"].as_object().expect("meshes") {
        let operators = assemble(&read_off(&golden(&format!("{name}.off")))).expect("operators");
        assert_well_formed(&operators);
        for (k, expected) in facts["mass_first5"]
            .as_array()
            .expect("masses")
            .iter()
            .enumerate()
        {
            let expected = expected.as_f64().expect("number");
            assert!(
                (operators.mass[k] / expected - 1.0).abs() < 1e-12,
                "{name} vertex {k}"
            );
        }
    }
}

#[test]
fn any_scale_gives_the_same_operators() {
    let (vertices, faces) = bumpy_sphere(2);
    let reference = assemble(&mesh((vertices.clone(), faces.clone()))).expect("operators");
    for scale in [1e-30, 1e-9, 1e9, 1e30] {
        let scaled = vertices.iter().map(|p| p.map(|x| x * scale)).collect();
        let o = assemble(&mesh((scaled, faces.clone()))).expect("operators");
        assert_well_formed(&o);
        assert!(
            relative_difference(&o.mass, &reference.mass, 0.0) < 1e-12,
            "scale {scale:e}"
        );
        let pairs = o.stiffness.data().iter().zip(reference.stiffness.data());
        assert!(
            pairs.fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) < 1e-11,
            "scale {scale:e}"
        );
    }
}

#[test]
fn degenerate_triangles_give_finite_operators() {
    let (vertices, faces) = bumpy_sphere(2);
    // A vertex moved onto a neighbour, one moved onto the middle of an edge: zero areas and a cap.
    for (moved, onto) in [
        (faces[5][0], vec![faces[5][1]]),
        (faces[9][0], vec![faces[9][1], faces[9][2]]),
    ] {
        let mut v = vertices.clone();
        v[moved as usize] = std::array::from_fn(|k| {
            onto.iter().map(|&o| vertices[o as usize][k]).sum::<f64>() / onto.len() as f64
        });
        let m = mesh((v, faces.clone()));
        let (o, pairs) = solve(&m, 40);
        assert_well_formed(&o);
        assert_sound(&o, &pairs);
    }
}

#[test]
fn wildly_different_edges_stay_finite() {
    for tiny in [1e-30, 1e-12, 1e-3] {
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [1e30, 0.0, 0.0],
            [0.0, 1e30, 0.0],
            [0.0, 0.0, tiny],
            [tiny, 0.0, 1e30],
        ];
        let faces = vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 4], [3, 4, 0]];
        match assemble(&mesh((vertices, faces))) {
            Ok(o) => assert_well_formed(&o),
            Err(e) => assert!(!e.to_string().is_empty()),
        }
    }
}

#[test]
fn non_manifold_edges_are_summed() {
    // Three triangles on one edge, two of them turned the same way.
    let vertices = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.4, 1.0, 0.0],
        [0.4, -0.7, 0.7],
        [0.4, -0.5, -0.9],
    ];
    let faces = vec![[0, 1, 2], [0, 1, 3], [1, 0, 4]];
    let (o, pairs) = solve(&mesh((vertices, faces)), 4);
    assert_well_formed(&o);
    assert_sound(&o, &pairs);
    assert!(pairs.values[1] > 1.0);
}

#[test]
fn a_face_listed_twice_is_allowed() {
    let (vertices, mut faces) = icosphere(1);
    faces.push(faces[0]);
    assert_well_formed(&assemble(&TriMesh::new(vertices, faces, 0).expect("mesh")).expect("operators"));
}
