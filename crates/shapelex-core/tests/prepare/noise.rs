//! Copies of a vertex that differ in the last written digit are one vertex; what only lies close is not.

use crate::shapes::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shapelex_core::mesh::{MeshError, PrepareOptions, TriangleSoup, prepare};

/// As a file with `digits` digits after the point has it, each copy of a vertex off by one step or none along each axis.
fn written(soup: &TriangleSoup, digits: i32, seed: u64) -> TriangleSoup {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let step = 10f64.powi(-digits);
    let mut soup = as_stl(soup);
    for x in soup.vertices.iter_mut().flatten() {
        *x = ((*x / step).round() + f64::from(rng.random_range(-1i8..=1))) * step;
    }
    soup.resolution = step;
    soup
}

#[test]
fn a_sphere_of_loose_triangles_closes() {
    for (levels, digits) in [(2, 6), (3, 6), (4, 5), (4, 4)] {
        let sphere = icosphere(levels);
        let soup = written(&sphere, digits, 3);
        let (mesh, report) = prepare_full(soup.clone());
        assert_prepared(&mesh, &report);
        let (_, exact) = prepare_full(sphere.clone());
        assert_eq!(
            (report.components_dropped, report.boundary_edges),
            (0, 0),
            "{report:?}"
        );
        assert_eq!(
            (report.vertices, report.faces),
            (sphere.vertices.len(), sphere.faces.len())
        );
        assert!((report.area / exact.area - 1.0).abs() < 1e-3);
        assert!(report.welded_within.is_some());
        assert!(
            report.warnings.iter().any(|w| w.contains("last digits")),
            "{report:?}"
        );

        // Without the step it falls to pieces, and says so.
        let loose = TriangleSoup {
            resolution: 0.0,
            ..soup
        };
        let refused = prepare(loose, &PrepareOptions::default());
        let Err(MeshError::Disconnected {
            parts,
            dropped,
            percent,
        }) = refused
        else {
            panic!("{refused:?}");
        };
        assert!(parts > sphere.faces.len() / 2 && dropped == parts - 1 && percent > 90.0);
    }
}

#[test]
fn a_part_of_the_copies_may_differ() {
    let sphere = bumpy(3);
    let noisy = written(&sphere, 6, 9);
    let mut soup = as_stl(&sphere);
    for (i, p) in noisy.vertices.iter().enumerate() {
        if i % 11 == 0 {
            soup.vertices[i] = *p;
        }
    }
    soup.resolution = 1e-6;
    let (_, report) = prepare_full(soup);
    assert_eq!(
        (report.boundary_edges, report.vertices),
        (0, sphere.vertices.len())
    );
}

#[test]
fn close_sheets_and_small_details_stay_apart() {
    let step = 1e-4;
    // Two sheets, as near as the file can tell.
    let mut sheets = TriangleSoup::default();
    let n = 20u32;
    for sheet in 0..2 {
        for i in 0..n * n {
            sheets
                .vertices
                .push([f64::from(i % n), f64::from(i / n), f64::from(sheet) * step]);
        }
        for i in 0..n - 1 {
            for j in 0..n - 1 {
                let a = sheet * n * n + i * n + j;
                sheets
                    .faces
                    .extend([[a, a + 1, a + n], [a + 1, a + n + 1, a + n]]);
            }
        }
    }
    sheets.resolution = step;
    let (_, report) = prepare_full(sheets.clone());
    assert_eq!((report.components, report.welded_within), (2, None));
    assert_eq!((report.duplicate_faces, report.vertices), (0, (n * n) as usize));

    // A surface whose edges are as short as the step: written so coarsely that nothing can be told.
    let mut coarse = bumpy(3);
    coarse.faces.truncate(900);
    coarse.resolution = 0.5;
    let (_, with) = prepare_full(coarse.clone());
    coarse.resolution = 0.0;
    let (_, without) = prepare_full(coarse);
    assert_eq!(with, without);
}

#[test]
fn what_is_left_out_is_said() {
    // Five equal spheres: 80 % of the surface would be left out.
    let mut soup = TriangleSoup::default();
    let add = |soup: &mut TriangleSoup, k: i32| {
        let one = icosphere(3);
        let first = soup.vertices.len() as u32;
        soup.vertices.extend(
            one.vertices
                .iter()
                .map(|p| [p[0] + 3.0 * f64::from(k), p[1], p[2]]),
        );
        soup.faces.extend(one.faces.iter().map(|f| f.map(|v| v + first)));
    };
    for k in 0..5 {
        add(&mut soup, k);
    }
    let (_, report) = prepare_full(soup.clone());
    let said = "4 of 5 separate parts, 80 % of the surface, were left out; set components to all";
    assert!(report.warnings.iter().any(|w| w.starts_with(said)), "{report:?}");
    // Twelve: 92 %.
    for k in 5..12 {
        add(&mut soup, k);
    }
    let refused = prepare(soup, &full_size()).unwrap_err();
    assert!(
        refused
            .to_string()
            .starts_with("the mesh is not connected: 11 of 12 separate parts, 92 % of the surface"),
        "{refused}"
    );
}
