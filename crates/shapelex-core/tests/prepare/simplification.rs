//! Down to the working size: the size is met, the shape is kept, also across holes and bad topology.

use crate::shapes::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{PrepareOptions, TriMesh, TriangleSoup, prepare};
use shapelex_core::spectral::{EigenOptions, assemble, smallest_eigenpairs};
use std::time::Instant;

/// Distance from a point to a triangle (Ericson 2005, section 5.1.5, by regions).
fn to_triangle(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> f64 {
    let sub = |x: [f64; 3], y: [f64; 3]| [x[0] - y[0], x[1] - y[1], x[2] - y[2]];
    let dot = |x: [f64; 3], y: [f64; 3]| x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    let at = |x: [f64; 3], d: [f64; 3], t: f64| [x[0] + t * d[0], x[1] + t * d[1], x[2] + t * d[2]];
    let segment = |x: [f64; 3], y: [f64; 3]| {
        let d = sub(y, x);
        let t = (dot(sub(p, x), d) / dot(d, d)).clamp(0.0, 1.0);
        let r = sub(p, at(x, d, t));
        dot(r, r).sqrt()
    };
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d00, d01, d11, d20, d21) = (dot(ab, ab), dot(ab, ac), dot(ac, ac), dot(ap, ab), dot(ap, ac));
    let det = d00 * d11 - d01 * d01;
    let (v, w) = ((d11 * d20 - d01 * d21) / det, (d00 * d21 - d01 * d20) / det);
    if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
        let r = sub(ap, at(ab.map(|x| x * v), ac, w));
        return dot(r, r).sqrt();
    }
    segment(a, b).min(segment(b, c)).min(segment(c, a))
}

/// Largest distance from every `step`-th vertex of `fine` to the surface of `coarse`.
fn one_sided_distance(fine: &TriMesh, coarse: &TriMesh, step: usize) -> f64 {
    (fine.vertices().iter().step_by(step))
        .map(|p| {
            (coarse.faces().iter())
                .map(|f| to_triangle(*p, f.map(|v| coarse.vertices()[v as usize])))
                .fold(f64::INFINITY, f64::min)
        })
        .fold(0.0, f64::max)
}

#[test]
fn a_surface_keeps_its_area_and_place() {
    let soup = bumpy(5); // 10242 vertices
    let (fine, fine_report) = prepare_full(soup.clone());
    let (coarse, report) = prepare(soup, &PrepareOptions::default()).unwrap();
    assert_prepared(&coarse, &report);
    assert_eq!(report.simplified_from, Some(10242));
    assert!((1990..=2000).contains(&report.vertices), "{}", report.vertices);
    assert_eq!((report.boundary_edges, report.non_manifold_edges), (0, 0));
    assert_eq!(report.faces, 2 * report.vertices - 4, "still a sphere");
    let ratio = report.area / fine_report.area;
    let distance = one_sided_distance(&fine, &coarse, 10);
    eprintln!(
        "10242 → {} vertices: area × {ratio:.5}, distance {distance:.5} of √area",
        report.vertices
    );
    assert!((0.99..1.001).contains(&ratio), "{ratio}");
    assert!(distance < 0.006, "{distance}");
}

/// A globe of mountains and valleys.
fn rough_globe(side: u32) -> TriangleSoup {
    let mut soup = globe(side, side);
    for p in &mut soup.vertices {
        let [x, y, z] = *p;
        let r = 1.0 + 0.2 * (5.0 * x).sin() * (4.0 * y).cos() + 0.1 * (7.0 * z).sin();
        *p = [r * x, r * y, r * z];
    }
    soup
}

#[test]
fn a_surface_simplified_in_pieces_keeps_its_area_place_and_spectrum() {
    let soup = rough_globe(300);
    let (fine, fine_report) = prepare_full(soup.clone());
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap()
            .install(|| prepare(soup.clone(), &PrepareOptions::default()).unwrap())
    };
    let (coarse, report) = on(1);
    assert_prepared(&coarse, &report);
    assert!((1990..=2000).contains(&report.vertices), "{}", report.vertices);
    assert_eq!((report.boundary_edges, report.non_manifold_edges), (0, 0));
    assert_eq!(report.faces, 2 * report.vertices - 4, "still a sphere");
    assert_eq!(on(2), (coarse.clone(), report.clone()), "whatever the threads");
    let ratio = report.area / fine_report.area;
    let distance = one_sided_distance(&fine, &coarse, 100);
    assert!((0.99..1.001).contains(&ratio), "{ratio}");
    assert!(distance < 0.01, "{distance}");
    let spectrum = |mesh: &TriMesh| {
        let operators = assemble(mesh).unwrap();
        let pairs = smallest_eigenpairs(&operators, 21, &EigenOptions::default(), &Cancel::new());
        pairs.unwrap().values
    };
    // A mesh of 10 000 vertices stands for the surface itself, whose solve would take seconds.
    let options = PrepareOptions {
        working_size: 10_000,
        ..Default::default()
    };
    let (finer, _) = prepare(soup.clone(), &options).unwrap();
    for (k, (a, b)) in spectrum(&coarse).iter().zip(spectrum(&finer)).enumerate().skip(1) {
        assert!((a / b - 1.0).abs() < 0.01, "{k}: {a} {b}");
    }
}

#[test]
fn a_million_vertices() {
    let soup = rough_globe(1000);
    let clock = Instant::now();
    let (mesh, report) = prepare(soup, &PrepareOptions::default()).unwrap();
    eprintln!(
        "{} vertices → {} in {:.2} s",
        report.input_vertices,
        report.vertices,
        clock.elapsed().as_secs_f64()
    );
    assert_prepared(&mesh, &report);
    assert!((1950..=2000).contains(&report.vertices), "{}", report.vertices);
    assert_eq!(report.faces, 2 * report.vertices - 4);
}

#[test]
fn inconsistent_orientation_does_not_stop_it() {
    let mut soup = bumpy(5);
    for f in soup.faces.iter_mut().step_by(2) {
        f.swap(0, 1);
    }
    let (_, report) = prepare(soup, &PrepareOptions::default()).unwrap();
    assert!((1990..=2000).contains(&report.vertices));
    assert_eq!(report.boundary_edges, 0);
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
}

#[test]
fn thousands_of_micro_holes_do_not_stop_it() {
    let mut soup = bumpy(5);
    soup.faces = (soup.faces.iter().enumerate())
        .filter(|(f, _)| f % 13 != 0)
        .map(|(_, f)| *f)
        .collect();
    let (mesh, report) = prepare(soup, &PrepareOptions::default()).unwrap();
    eprintln!(
        "1576 micro holes: {} vertices, {} holes filled, openness {:.3}, {:?}",
        report.vertices, report.holes_filled, report.openness, report.warnings
    );
    assert_prepared(&mesh, &report);
    assert!((1900..=2000).contains(&report.vertices));
    assert!(report.openness < 0.1);
}

#[test]
fn an_open_surface_keeps_its_boundary_length() {
    let mut soup = bumpy(5);
    let height: Vec<f64> = soup.vertices.iter().map(|p| p[0]).collect();
    soup.faces.retain(|f| f.iter().all(|v| height[*v as usize] < 0.3));
    let (_, fine) = prepare_full(soup.clone());
    let (mesh, coarse) = prepare(soup, &PrepareOptions::default()).unwrap();
    assert_prepared(&mesh, &coarse);
    eprintln!("openness {:.4} → {:.4}", fine.openness, coarse.openness);
    assert!((coarse.openness / fine.openness - 1.0).abs() < 0.1);
    assert!((1950..=2000).contains(&coarse.vertices), "{}", coarse.vertices);
}

/// Shapes that no collapse, or no grid, takes to the working size by the usual number of faces per vertex.
#[test]
fn needles_and_random_faces_meet_the_size() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let anywhere =
        |rng: &mut ChaCha8Rng| -> [f64; 3] { std::array::from_fn(|_| rng.random_range(-1.0..1.0)) };
    let mut star = TriangleSoup {
        vertices: vec![[0.0; 3]],
        faces: Vec::new(),
        ..TriangleSoup::default()
    };
    let mut chain = star.clone();
    let mut last = 0;
    for _ in 0..5000 {
        let p = anywhere(&mut rng);
        let k = star.vertices.len() as u32;
        for (needles, tip) in [(&mut star, 0), (&mut chain, last)] {
            needles.vertices.extend([p, [p[0] + 1e-2, p[1], p[2]]]);
            needles.faces.push([tip, k, k + 1]);
        }
        last = k;
    }
    let n = 10_000;
    let random = TriangleSoup {
        vertices: (0..n).map(|_| anywhere(&mut rng)).collect(),
        faces: (0..3 * n)
            .map(|_| std::array::from_fn(|_| rng.random_range(0..n)))
            .collect(),
        ..TriangleSoup::default()
    };
    for (name, soup) in [("star", star), ("chain", chain), ("random", random)] {
        for working_size in [5, 50, 1500] {
            let options = PrepareOptions {
                working_size,
                ..PrepareOptions::default()
            };
            let (mesh, report) = prepare(soup.clone(), &options).unwrap_or_else(|e| panic!("{name}: {e}"));
            eprintln!("{name} to {working_size}: {}", report.vertices);
            assert_prepared(&mesh, &report);
            assert!(report.vertices <= working_size.max(8), "{name}");
            // A chain that loses links falls apart, and the largest part is kept.
            assert!(name == "chain" || 8 * report.vertices >= working_size, "{name}");
        }
    }
}

#[test]
fn hostile_topology_meets_the_size_or_says_so() {
    // Every face on one of 40 edges: a book with 2500 pages of many triangles.
    let mut soup = TriangleSoup::default();
    for i in 0..=40 {
        soup.vertices.push([f64::from(i) / 40.0, 0.0, 0.0]);
    }
    for page in 0..2500u32 {
        let angle = f64::from(page) * 2.4;
        let r = 0.5 + 0.4 * f64::from(page % 7) / 7.0;
        let first = soup.vertices.len() as u32;
        for i in 0..40 {
            soup.vertices
                .push([(f64::from(i) + 0.5) / 40.0, r * angle.cos(), r * angle.sin()]);
            soup.faces.push([i, i + 1, first + i]);
        }
    }
    let (mesh, report) = prepare(soup, &PrepareOptions::default()).unwrap();
    eprintln!("book: {} vertices, {:?}", report.vertices, report.warnings);
    assert_prepared(&mesh, &report);
    assert!(report.vertices <= 2000);
    assert!(report.warnings.iter().any(|w| w.contains("simplif")));
}

#[test]
fn a_large_tangle_is_clustered_within_seconds() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let n = 300_000;
    let soup = TriangleSoup {
        vertices: (0..n)
            .map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
            .collect(),
        faces: (0..2 * n)
            .map(|_| std::array::from_fn(|_| rng.random_range(0..n)))
            .collect(),
        ..TriangleSoup::default()
    };
    let clock = Instant::now();
    let (mesh, report) = prepare(soup, &PrepareOptions::default()).unwrap();
    let took = clock.elapsed().as_secs_f64();
    eprintln!(
        "{} faces → {} vertices in {took:.2} s",
        report.input_faces, report.vertices
    );
    assert_prepared(&mesh, &report);
    assert!((1000..=2000).contains(&report.vertices), "{}", report.vertices);
    assert_eq!(report.holes_filled, 0, "loops in a tangle bound no holes");
    assert!(report.warnings.iter().any(|w| w.contains("clustered")));
    assert!(
        took < 20.0,
        "collapses over the whole would take minutes: {took:.1} s"
    );
}

#[test]
fn a_large_ribbon_and_a_large_fan_are_simplified() {
    // No collapse is possible in a piece of a ribbon of one triangle's width, whose edges are all on the border.
    let n = 200_000u32;
    let ribbon = TriangleSoup {
        vertices: (0..n)
            .map(|i| {
                let turn = f64::from(i / 2) * 20.0 / f64::from(n);
                [turn.cos(), turn.sin(), 0.1 * turn + 0.02 * f64::from(i % 2)]
            })
            .collect(),
        faces: (2..n).map(|i| [i - 2, i - 1, i]).collect(),
        ..TriangleSoup::default()
    };
    let fan = TriangleSoup {
        vertices: (0..=n)
            .map(|i| {
                let turn = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
                let r = f64::from(i.min(1));
                [r * turn.cos(), r * turn.sin(), 0.3 * r * (5.0 * turn).sin()]
            })
            .collect(),
        faces: (1..=n).map(|i| [0, i, i % n + 1]).collect(),
        ..TriangleSoup::default()
    };
    for (name, soup) in [("ribbon", ribbon), ("fan", fan)] {
        let (_, full) = prepare_full(soup.clone());
        let (mesh, report) = prepare(soup, &PrepareOptions::default()).unwrap();
        assert_prepared(&mesh, &report);
        assert!(
            (1500..=2000).contains(&report.vertices),
            "{name}: {}",
            report.vertices
        );
        assert!(report.faces + 4 >= report.vertices, "{name} is still one piece");
        let ratio = report.area / full.area;
        assert!((0.95..1.05).contains(&ratio), "{name}: {ratio}");
    }
}
