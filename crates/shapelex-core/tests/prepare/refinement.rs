//! A refined mesh is the same surface with more vertices.

use shapelex_core::mesh::TriMesh;
use shapelex_core::mesh::edges::edge_census;
use shapelex_core::mesh::refine::refine;
use std::collections::BTreeSet;

fn tetrahedron() -> TriMesh {
    let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    TriMesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], 4).unwrap()
}

#[test]
fn the_surface_stays_and_so_does_its_topology() {
    let coarse = tetrahedron();
    let fine = refine(coarse.clone(), 200).unwrap();
    assert_eq!((fine.vertices().len(), fine.signature_vertices()), (200, 200));
    assert_eq!(fine.vertices()[..4], coarse.vertices()[..4]);
    assert!((fine.area() - coarse.area()).abs() < 1e-12);
    // Closed, oriented, and of Euler characteristic 2.
    assert_eq!(edge_census(200, fine.faces()), edge_census(4, coarse.faces()));
    assert_eq!(fine.faces().len(), 2 * 200 - 4);
    assert_eq!(refine(coarse.clone(), 200).unwrap(), fine, "the same twice");
    assert_eq!(refine(coarse.clone(), 4).unwrap(), coarse);
}

#[test]
fn edges_come_to_one_length() {
    let fine = refine(tetrahedron(), 500).unwrap();
    let edges: BTreeSet<(u32, u32)> = fine
        .faces()
        .iter()
        .flat_map(|f| (0..3).map(|k| (f[k].min(f[(k + 1) % 3]), f[k].max(f[(k + 1) % 3]))))
        .collect();
    let lengths: Vec<f64> = edges
        .iter()
        .map(|&(a, b)| {
            let (p, q) = (fine.vertices()[a as usize], fine.vertices()[b as usize]);
            (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt()
        })
        .collect();
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    let shortest = lengths.iter().copied().fold(1.0, f64::min);
    assert!(longest < 4.0 * shortest, "{shortest} to {longest}");
}

#[test]
fn what_closes_a_hole_carries_no_signatures() {
    // A pyramid whose top is the centre of a fan.
    let vertices = vec![
        [0.0; 3],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.5, 0.5, 1.0],
    ];
    let faces = vec![[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let fine = refine(TriMesh::new(vertices, faces, 4).unwrap(), 60).unwrap();
    let carried = fine.signature_vertices();
    assert!(carried > 4 && carried < 60, "{carried}");
    assert!(fine.vertices()[..carried].iter().all(|p| p[2] == 0.0));
}

#[test]
fn all_faces_of_a_non_manifold_edge_are_split() {
    let vertices = vec![
        [0.0; 3],
        [4.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
        [2.0, -1.0, 0.0],
        [2.0, 0.0, 1.0],
    ];
    let faces = vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]];
    let fine = refine(TriMesh::new(vertices, faces, 5).unwrap(), 6).unwrap();
    assert_eq!(fine.vertices()[5], [2.0, 0.0, 0.0]);
    assert_eq!(fine.faces().len(), 6);
    assert_eq!(edge_census(6, fine.faces()).non_manifold, 2);
    assert!((fine.area() - 6.0).abs() < 1e-12);
}
