//! What is merged, dropped, kept and counted, and that order, position and scale do not matter.

use crate::shapes::*;
use shapelex_core::mesh::{Components, PrepareOptions, TriangleSoup, prepare};
use std::time::Instant;

#[test]
fn every_flaw_is_repaired_and_counted() {
    let sphere = icosphere(3);
    let mut soup = as_stl(&sphere);
    let (v, f) = (soup.vertices.len(), soup.faces.len());
    // A face twice (reversed), one with a repeated vertex, a sliver along an edge, a point nothing uses.
    let first = soup.faces[0];
    soup.faces.push([first[2], first[1], first[0]]);
    soup.faces.push([first[0], first[0], first[1]]);
    let p = soup.vertices[first[0] as usize];
    let q = soup.vertices[first[1] as usize];
    soup.vertices.push(std::array::from_fn(|k| 0.5 * (p[k] + q[k])));
    soup.faces.push([first[0], first[1], v as u32]);
    soup.vertices.push([9.0, 9.0, 9.0]);
    // A second, small part.
    let far = soup.vertices.len() as u32;
    soup.vertices
        .extend([[5.0, 0.0, 0.0], [5.1, 0.0, 0.0], [5.0, 0.1, 0.0], [5.0, 0.0, 0.1]]);
    soup.faces
        .extend([[far, far + 1, far + 2], [far, far + 2, far + 3]]);

    let (mesh, report) = prepare_full(soup.clone());
    assert_prepared(&mesh, &report);
    assert_eq!((report.input_vertices, report.input_faces), (v + 6, f + 5));
    assert_eq!(report.welded_vertices, v - sphere.vertices.len());
    assert_eq!(report.degenerate_faces, 2);
    assert_eq!(report.duplicate_faces, 1);
    assert_eq!(report.unreferenced_vertices, 2);
    assert_eq!((report.components, report.components_dropped), (2, 1));
    assert!(report.area_dropped > 0.0 && report.area_dropped < 0.01);
    assert_eq!((report.non_manifold_edges, report.boundary_edges), (0, 0));
    assert_eq!(report.openness, 0.0);
    assert_eq!((report.vertices, report.faces), (642, 1280));
    assert!((report.area - 4.0 * std::f64::consts::PI).abs() < 0.1);
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    // The first corners of the soup are the first vertices of the mesh.
    assert_eq!(mesh.faces()[0], [0, 1, 2]);

    let (_, all) = prepare(
        soup,
        &PrepareOptions {
            components: Components::All,
            ..full_size()
        },
    )
    .unwrap();
    // Below 1 % of the area, it goes all the same.
    assert_eq!(all.components_dropped, 1);
}

#[test]
fn all_keeps_every_part_of_some_size() {
    let mut soup = icosphere(3);
    let other = mapped(
        &icosphere(2),
        [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.5]],
        [4.0, 0.0, 0.0],
    );
    let n = soup.vertices.len() as u32;
    soup.vertices.extend(&other.vertices);
    soup.faces.extend(other.faces.iter().map(|f| f.map(|v| v + n)));
    let (_, largest) = prepare_full(soup.clone());
    assert_eq!((largest.components_dropped, largest.vertices), (1, 642));
    assert_eq!(largest.warnings.len(), 1, "{:?}", largest.warnings);
    let options = PrepareOptions {
        components: Components::All,
        ..full_size()
    };
    let (mesh, all) = prepare(soup, &options).unwrap();
    assert_prepared(&mesh, &all);
    assert_eq!((all.components_dropped, all.vertices), (0, 642 + 162));
}

/// A surface with everything that offers a choice: touching holes, a non-manifold fin, twins of equal area.
fn awkward() -> TriangleSoup {
    let mut soup = bumpy(3);
    let around = |v: u32, f: &[u32; 3]| f.contains(&v);
    let hub = 100u32;
    let ring: Vec<usize> = (0..soup.faces.len())
        .filter(|f| around(hub, &soup.faces[*f]))
        .collect();
    let gone = [ring[0], ring[2], 700, 701, 1000];
    soup.faces = (soup.faces.iter().enumerate())
        .filter(|(f, _)| !gone.contains(f))
        .map(|(_, f)| *f)
        .collect();
    let [a, b, _] = soup.faces[300];
    soup.vertices.push([2.0, 2.0, 2.0]);
    soup.faces.push([a, b, soup.vertices.len() as u32 - 1]);
    // A twin, mirrored and moved away.
    let twin = mapped(
        &soup,
        [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [8.0, 0.0, 0.0],
    );
    let n = soup.vertices.len() as u32;
    soup.vertices.extend(&twin.vertices);
    soup.faces.extend(twin.faces.iter().map(|f| f.map(|v| v + n)));
    as_stl(&soup)
}

#[test]
fn order_does_not_matter() {
    let soup = awkward();
    let (mesh, report) = prepare_full(soup.clone());
    assert!(report.holes_filled >= 4, "{report:?}");
    assert_eq!(report.non_manifold_edges, 1);
    let reference = edge_lengths(&mesh);
    for seed in 0..5 {
        let (other, other_report) = prepare_full(shuffled(&soup, seed));
        assert!(largest_difference(&edge_lengths(&other), &reference) < 1e-9);
        assert!((other_report.openness - report.openness).abs() < 1e-9);
        assert_eq!(
            (
                other_report.vertices,
                other_report.faces,
                other_report.holes_filled
            ),
            (report.vertices, report.faces, report.holes_filled)
        );
        // The kept twin is the same one, so its places are too.
        let places = |m: &shapelex_core::mesh::TriMesh| {
            let mut p: Vec<[i64; 3]> = (m.vertices().iter())
                .map(|p| p.map(|x| (x * 1e7).round() as i64))
                .collect();
            p.sort_unstable();
            p
        };
        let near = (places(&other).iter().zip(&places(&mesh)))
            .filter(|(a, b)| (0..3).all(|k| (a[k] - b[k]).abs() <= 1))
            .count();
        assert!(near * 100 >= 99 * mesh.vertices().len());
    }
}

#[test]
fn motion_scale_and_orientation_do_not_matter() {
    let soup = awkward();
    let (mesh, report) = prepare_full(soup.clone());
    for scale in [1e-150, 1e-3, 1.0, 25.4, 1e150] {
        let linear = rotation().map(|row| row.map(|x| x * scale));
        let mut moved = mapped(&soup, linear, [3.0 * scale, -70.0 * scale, 11.0 * scale]);
        for f in moved.faces.iter_mut().step_by(3) {
            f.swap(0, 1);
        }
        let (other, other_report) = prepare_full(moved);
        assert_eq!(other.faces().len(), mesh.faces().len());
        assert!(largest_difference(&edge_lengths(&other), &edge_lengths(&mesh)) < 1e-9);
        assert!((other_report.openness - report.openness).abs() < 1e-9);
        assert!((other_report.area / (report.area * scale * scale) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_triangle_soup_of_a_million_faces_is_welded_fast() {
    let sphere = globe(500, 1000);
    let soup = as_stl(&sphere);
    let clock = Instant::now();
    let (mesh, report) = prepare_full(soup);
    eprintln!(
        "{} soup faces prepared (no simplification) in {:.0} ms",
        report.input_faces,
        clock.elapsed().as_secs_f64() * 1e3
    );
    assert_eq!(mesh.vertices().len(), sphere.vertices.len());
    assert_eq!(report.boundary_edges, 0);
}

#[test]
fn cleaning_twice_changes_nothing() {
    let (mesh, _) = prepare_full(awkward());
    let (vertices, faces) = mesh.clone().into_parts();
    let (again, report) = prepare_full(TriangleSoup {
        vertices,
        faces,
        ..TriangleSoup::default()
    });
    assert_eq!(again.faces(), mesh.faces());
    assert_eq!(
        report.welded_vertices + report.degenerate_faces + report.duplicate_faces,
        0
    );
    for (p, q) in again.vertices().iter().zip(mesh.vertices()) {
        assert!((0..3).all(|k| (p[k] - q[k]).abs() < 1e-12));
    }
}
