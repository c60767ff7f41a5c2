//! Nasty little meshes and random soups: a precise error or a valid mesh, never a panic.

use crate::shapes::*;
use proptest::prelude::*;
use shapelex_core::mesh::boundary::boundary_vertices;
use shapelex_core::mesh::double::double;
use shapelex_core::mesh::whiten::whiten;
use shapelex_core::mesh::{
    Components, MeshError, PrepareOptions, PrepareReport, TriMesh, TriangleSoup, prepare,
};

fn soup(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> TriangleSoup {
    TriangleSoup {
        vertices: vertices.to_vec(),
        faces: faces.to_vec(),
        ..TriangleSoup::default()
    }
}

fn attempt(soup: TriangleSoup) -> Result<(TriMesh, PrepareReport), MeshError> {
    let result = prepare(soup, &PrepareOptions::default());
    if let Ok((mesh, report)) = &result {
        assert_prepared(mesh, report);
    }
    result
}

const TRIANGLE: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

#[test]
fn what_is_no_surface_is_refused_by_name() {
    let points = soup(&TRIANGLE, &[]);
    assert_eq!(attempt(points), Err(MeshError::NoFaces { vertices: 3 }));
    let one = soup(&TRIANGLE, &[[0, 1, 2]]);
    assert_eq!(
        attempt(one),
        Err(MeshError::TooSmall {
            vertices: 3,
            faces: 1
        })
    );
    let coincident = soup(&[[7.0, -3.0, 1e9]; 30], &[[0, 1, 2], [3, 4, 5], [6, 17, 28]]);
    assert_eq!(attempt(coincident), Err(MeshError::Degenerate));
    let collinear: Vec<[f64; 3]> = (0..30)
        .map(|i| [0.1, 0.7, -0.3].map(|x| x * f64::from(i) + 1.0))
        .collect();
    let faces: Vec<[u32; 3]> = (0..28).map(|i| [i, i + 1, i + 2]).collect();
    assert_eq!(attempt(soup(&collinear, &faces)), Err(MeshError::Degenerate));
    let bad = soup(&[[0.0; 3], [f64::NAN, 0.0, 0.0], [1.0; 3]], &[[0, 1, 2]]);
    assert_eq!(attempt(bad), Err(MeshError::NotFinite { vertex: 1 }));
    let out = soup(&TRIANGLE, &[[0, 1, 2], [0, 1, 3]]);
    assert_eq!(
        attempt(out),
        Err(MeshError::IndexOutOfRange {
            face: 1,
            index: 3,
            vertices: 3
        })
    );
}

#[test]
fn three_thousand_disconnected_triangles() {
    let mut many = TriangleSoup::default();
    for i in 0..3000u32 {
        let x = f64::from(i);
        many.vertices
            .extend([[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 0.5, 0.0]]);
        many.faces.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let refused = Err(MeshError::Disconnected {
        parts: 3000,
        dropped: 2999,
        percent: 100.0 * (1.0 - 1.0 / 3000.0),
    });
    let rounded = |result: Result<(TriMesh, PrepareReport), MeshError>| match result {
        Err(MeshError::Disconnected {
            parts,
            dropped,
            percent,
        }) => Err(MeshError::Disconnected {
            parts,
            dropped,
            percent: (1e6 * percent).round() / 1e6,
        }),
        other => other,
    };
    let refused = rounded(refused);
    assert_eq!(rounded(attempt(many.clone())), refused);
    let options = PrepareOptions {
        components: Components::All,
        ..PrepareOptions::default()
    };
    assert_eq!(rounded(prepare(many, &options)), refused);
}

#[test]
fn lengths_from_1e_minus_30_to_1e30() {
    // A spiral strip whose triangles grow by a factor at each step.
    let mut strip = TriangleSoup::default();
    for i in 0..600 {
        let r = 10f64.powf(-30.0 + f64::from(i) * 0.1);
        let t = f64::from(i) * 0.3;
        strip.vertices.push([r * t.cos(), r * t.sin(), r]);
    }
    strip.faces = (0..598).map(|i| [i, i + 1, i + 2]).collect();
    let (mesh, report) = attempt(strip).unwrap();
    assert!(mesh.vertices().len() < 200, "{report:?}");
    // Small and large alone are no trouble.
    for scale in [1e-300, 1e-30, 1e30, 1e300] {
        let mut sphere = icosphere(2);
        sphere.vertices.iter_mut().flatten().for_each(|x| *x *= scale);
        let (mesh, _) = attempt(sphere).unwrap();
        assert_eq!(mesh.vertices().len(), 162);
    }
    let opposite = soup(
        &[
            [f64::MAX; 3],
            [-f64::MAX; 3],
            [f64::MAX, -f64::MAX, 0.0],
            [0.0, f64::MAX, 1.0],
        ],
        &[[0, 1, 2], [1, 2, 3], [0, 2, 3]],
    );
    attempt(opposite).unwrap();
}

#[test]
fn the_zoo_of_small_surfaces() {
    let p = |x: f64, y: f64, z: f64| [x, y, z];
    let mut moebius = TriangleSoup::default();
    for i in 0..30 {
        let t = f64::from(i) / 30.0 * std::f64::consts::TAU;
        for s in [-0.3, 0.3] {
            let r = 1.0 + s * (t / 2.0).cos();
            moebius
                .vertices
                .push([r * t.cos(), r * t.sin(), s * (t / 2.0).sin()]);
        }
    }
    for i in 0..30u32 {
        let (a, b) = (2 * i, 2 * i + 1);
        let (c, d) = if i < 29 { (a + 2, b + 2) } else { (1, 0) };
        moebius.faces.extend([[a, c, b], [b, c, d]]);
    }
    let (mesh, report) = attempt(moebius).unwrap();
    assert_eq!((report.boundary_edges, report.holes_filled), (60, 0));
    assert_eq!(double(&mesh).unwrap().vertices().len(), 60);

    let bow_tie = soup(
        &[
            p(0., 0., 0.),
            p(1., 0., 0.),
            p(0., 1., 0.),
            p(-1., 0., 0.),
            p(0., -1., 0.),
        ],
        &[[0, 1, 2], [0, 3, 4]],
    );
    let (mesh, report) = attempt(bow_tie).unwrap();
    assert_eq!(
        (report.components, report.holes_filled, mesh.faces().len()),
        (1, 0, 2)
    );

    // Two cones that touch in their tips.
    let mut hourglass = TriangleSoup {
        vertices: vec![[0.0; 3]],
        faces: Vec::new(),
        ..TriangleSoup::default()
    };
    for z in [1.0, -1.0] {
        let first = hourglass.vertices.len() as u32;
        for i in 0..12 {
            let t = f64::from(i) / 12.0 * std::f64::consts::TAU;
            hourglass.vertices.push([t.cos(), t.sin(), z]);
            hourglass
                .faces
                .push([0, first + i as u32, first + (i as u32 + 1) % 12]);
        }
    }
    let (mesh, report) = attempt(hourglass).unwrap();
    assert_eq!((report.components, report.boundary_edges), (1, 24));
    assert_eq!(boundary_vertices(&mesh).iter().filter(|b| **b).count(), 24);

    let fan = soup(
        &[
            p(0., 0., 0.),
            p(1., 0., 0.),
            p(0., 1., 0.),
            p(0., 0., 1.),
            p(1., 1., 1.),
        ],
        &[[0, 1, 2], [1, 0, 3], [0, 1, 4]],
    );
    let (_, report) = attempt(fan).unwrap();
    assert_eq!(report.non_manifold_edges, 1);

    let both_sides = soup(
        &[p(0., 0., 0.), p(1., 0., 0.), p(1., 1., 0.), p(0., 1., 0.)],
        &[[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]],
    );
    let (_, report) = attempt(both_sides).unwrap();
    assert_eq!((report.duplicate_faces, report.faces), (2, 2));

    let mut slivers = icosphere(1);
    let n = slivers.vertices.len() as u32;
    for i in 0..20 {
        slivers.vertices.push([1e-14 * f64::from(i), 0.0, 1.0]);
    }
    slivers
        .faces
        .extend((0..18).map(|i| [n + i, n + i + 1, n + i + 2]));
    let (_, report) = attempt(slivers).unwrap();
    assert_eq!((report.degenerate_faces, report.faces), (18, 80));
}

#[test]
fn a_sliver_on_an_edge_leaves_no_slit() {
    // The edge 0–1 of a tetrahedron carries a third point: the sliver on it has no area and goes, the point stays.
    let p = [
        [0.0; 3],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.5, 0.0, 0.0],
    ];
    let cracked = soup(
        &p,
        &[[0, 4, 2], [4, 1, 2], [0, 1, 4], [0, 3, 1], [1, 3, 2], [2, 3, 0]],
    );
    let (mesh, report) = attempt(cracked).unwrap();
    assert_eq!(
        (
            report.repaired_faces,
            report.degenerate_faces,
            report.holes_filled,
            report.boundary_edges
        ),
        (1, 0, 0, 0)
    );
    assert_eq!((mesh.vertices().len(), mesh.faces().len()), (5, 6));
}

/// Coordinates on a coarse lattice, so that coincidences, collinear triples and shared edges are common, or anywhere.
fn coordinates() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => (-3i32..4).prop_map(f64::from),
        2 => -1.0..1.0f64,
        1 => (-300i32..300).prop_map(|e| 10f64.powi(e)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn random_soups_never_break_a_promise(
        vertices in prop::collection::vec([coordinates(), coordinates(), coordinates()], 3..60),
        picks in prop::collection::vec([any::<u32>(), any::<u32>(), any::<u32>()], 0..150),
        all in any::<bool>(),
        working_size in prop_oneof![Just(0usize), 1usize..40],
        fill_holes_below in 0.0..4.0f64,
    ) {
        let n = vertices.len() as u32;
        let faces: Vec<[u32; 3]> = picks.iter().map(|f| f.map(|k| k % n)).collect();
        let options = PrepareOptions {
            components: if all { Components::All } else { Components::Largest },
            fill_holes_below,
            working_size,
        };
        if let Ok((mesh, report)) = prepare(TriangleSoup { vertices, faces, ..TriangleSoup::default() }, &options) {
            assert_prepared(&mesh, &report);
            if working_size > 0 {
                prop_assert!(report.vertices <= working_size.max(8));
            }
            if let Ok(white) = whiten(&mesh) {
                prop_assert!((white.area() - 1.0).abs() < 1e-9);
            }
            match double(&mesh) {
                Ok(closed) => prop_assert!((closed.area() - 1.0).abs() < 1e-9),
                Err(error) => prop_assert!(matches!(error, MeshError::Invalid { .. }), "{error}"),
            }
        }
    }
}
