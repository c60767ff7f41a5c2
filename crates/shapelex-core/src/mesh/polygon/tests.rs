use super::*;
use crate::mesh::Limits;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// The triangles of a polygon, and the area they cover together.
fn split(points: &[[f64; 3]]) -> (Vec<[u32; 3]>, f64) {
    let context = ReadContext::new(Limits::default());
    let mut fan: Vec<[u32; 3]> = (1..points.len() as u32 - 1).map(|k| [0, k, k + 1]).collect();
    Triangulator::new(points, &context)
        .triangulate(&mut fan)
        .expect("memory and time enough");
    assert_eq!(context.memory.bytes(), 0);
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|k| points[k as usize]);
        let n = cross(sub(b, a), sub(c, a));
        dot(n, n).sqrt() / 2.0
    };
    assert_keeps_border(points.len(), &fan);
    let covered = fan.iter().map(area).sum();
    (fan, covered)
}

/// Each border edge is in one triangle, each other edge in two that pass it in opposite directions.
fn assert_keeps_border(n: usize, triangles: &[[u32; 3]]) {
    assert_eq!(triangles.len(), n - 2);
    let mut edges = BTreeMap::new();
    for &[a, b, c] in triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            assert!(edges.insert(edge, ()).is_none(), "{edge:?} twice");
        }
    }
    let border: Vec<[u32; 2]> = edges
        .keys()
        .filter(|&&[a, b]| !edges.contains_key(&[b, a]))
        .copied()
        .collect();
    let mut expected: Vec<[u32; 2]> = (0..n as u32).map(|k| [k, (k + 1) % n as u32]).collect();
    expected.sort_unstable();
    assert_eq!(border, expected);
}

/// Points of a plane in space.
fn tilt(points: &[[f64; 2]]) -> Vec<[f64; 3]> {
    let (u, v) = ([0.6, 0.64, 0.48], [-0.8, 0.48, 0.36]);
    points
        .iter()
        .map(|[x, y]| std::array::from_fn(|k| 3.0 + x * u[k] + y * v[k]))
        .collect()
}

/// The area of a plane polygon.
fn shoelace(points: &[[f64; 2]]) -> f64 {
    let n = points.len();
    let pair = |k: usize| {
        let ([a, b], [c, d]) = (points[k], points[(k + 1) % n]);
        a * d - b * c
    };
    ((0..n).map(pair).sum::<f64>() / 2.0).abs()
}

fn assert_covers(points: &[[f64; 2]]) {
    let expected = shoelace(points);
    for turned in [points.to_vec(), points.iter().rev().copied().collect()] {
        let (_, covered) = split(&tilt(&turned));
        assert!(
            (covered - expected).abs() <= 1e-9 * expected,
            "{covered} of {expected}: {} corners",
            points.len()
        );
    }
}

fn comb(teeth: usize) -> Vec<[f64; 2]> {
    let tip = |k: usize| [[k as f64, 0.0], [k as f64 + 0.5, teeth as f64]];
    let mut points: Vec<_> = (0..teeth).flat_map(tip).collect();
    points.push([teeth as f64, 0.0]);
    points.push([teeth as f64, -1.0]);
    points.push([0.0, -1.0]);
    points
}

fn spiral(corners: usize) -> Vec<[f64; 2]> {
    let half = corners / 2;
    let at = |k: usize, shift: f64| {
        let t = k as f64 / half as f64;
        let (r, angle) = (0.1 + t + shift / 60.0, 40.0 * TAU * t);
        [r * angle.cos(), r * angle.sin()]
    };
    let outer = (0..half).map(|k| at(k, 0.0));
    let inner = (0..half).rev().map(|k| at(k, 0.5));
    outer.chain(inner).collect()
}

fn star(radii: &[f64]) -> Vec<[f64; 2]> {
    let angle = |k: usize| TAU * k as f64 / radii.len() as f64;
    radii
        .iter()
        .enumerate()
        .map(|(k, r)| [r * angle(k).cos(), r * angle(k).sin()])
        .collect()
}

fn area_by_earcut(points: &[[f64; 2]]) -> f64 {
    let mut triangles: Vec<u32> = Vec::new();
    earcut::Earcut::new().earcut(points.iter().copied(), &[], &mut triangles);
    triangles
        .chunks(3)
        .map(|t| shoelace(&[t[0], t[1], t[2]].map(|k| points[k as usize])))
        .sum()
}

proptest! {
    /// Polygons whose corners are seen from one point, of few corners (ears) and many (sweep).
    #[test]
    fn simple_polygons_are_covered_once(radii in prop::collection::vec(0.05..1.0f64, 5..120)) {
        let points = star(&radii);
        assert_covers(&points);
        let (ours, theirs) = (split(&tilt(&points)).1, area_by_earcut(&points));
        prop_assert!((ours - theirs).abs() <= 1e-9 * ours, "{} and {}", ours, theirs);
    }

    /// Corners on straight borders and repeated corners stay.
    #[test]
    fn straight_and_repeated_corners_stay(
        radii in prop::collection::vec(0.05..1.0f64, 5..50),
        middles in prop::collection::vec((any::<prop::sample::Index>(), any::<bool>()), 1..10),
    ) {
        let mut points = star(&radii);
        for (at, middle) in middles {
            let k = at.index(points.len());
            let (p, q) = (points[k], points[(k + 1) % points.len()]);
            let between = [(p[0] + q[0]) / 2.0, (p[1] + q[1]) / 2.0];
            points.insert(k + 1, if middle { between } else { p });
        }
        let expected = shoelace(&points);
        let (_, covered) = split(&tilt(&points));
        prop_assert!((covered - expected).abs() <= 1e-7 * expected, "{} of {}", covered, expected);
    }

    /// Whatever the points, in space, crossing and repeated, the border is kept.
    #[test]
    fn any_polygon_keeps_its_border(
        points in prop::collection::vec(prop::array::uniform3((0..6i8).prop_map(f64::from)), 3..80),
    ) {
        split(&points);
    }

    #[test]
    fn any_flat_polygon_keeps_its_border(
        points in prop::collection::vec(prop::array::uniform2(-1e3..1e3f64), 3..200),
    ) {
        let (first, _) = split(&tilt(&points));
        prop_assert_eq!(first, split(&tilt(&points)).0);
    }
}

#[test]
fn convex_polygons_stay_fans() {
    for n in [3, 4, 5, 7, 32, 33, 1000] {
        let fan: Vec<[u32; 3]> = (1..n - 1).map(|k| [0, k, k + 1]).collect();
        assert_eq!(split(&tilt(&star(&vec![1.0; n as usize]))).0, fan, "{n}");
    }
    // Also one that is not plane, and one without an area.
    assert_eq!(
        split(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.2], [1.0, 1.0, 0.0], [0.0, 1.0, 0.2]]).0,
        [[0, 1, 2], [0, 2, 3]]
    );
    assert_eq!(split(&[[1.0; 3]; 5]).0, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
}

#[test]
fn concave_polygons_are_covered() {
    let l = [
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0, 1.0],
        [1.0, 1.0],
        [1.0, 2.0],
        [0.0, 2.0],
    ];
    let dart = [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [1.0, 1.0]];
    // Whichever corner comes first.
    for polygon in [l.as_slice(), &dart] {
        for first in 0..polygon.len() {
            let mut points = polygon.to_vec();
            points.rotate_left(first);
            assert_covers(&points);
        }
    }
    for teeth in [1, 3, 14, 15, 16, 100, 2000] {
        assert_covers(&comb(teeth));
    }
    for corners in [100, 1000, 20_000] {
        assert_covers(&spiral(corners));
    }
}

/// A ring, cut open along a bridge that the border passes twice: how holes are written.
#[test]
fn holes_on_a_bridge_are_left_open() {
    for sides in [4, 8, 12, 40, 300] {
        let outer = star(&vec![1.0; sides]);
        let inner: Vec<_> = star(&vec![0.5; sides]).into_iter().rev().collect();
        let mut points = outer.clone();
        points.push(outer[0]);
        // The inner border begins beside the outer one's first corner.
        points.push(inner[sides - 1]);
        points.extend(&inner);
        assert_covers(&points);
    }
}

#[test]
fn a_corner_on_a_straight_border_leaves_no_flat_triangle() {
    let square = [
        [0.0, 0.0],
        [0.5, 0.0],
        [1.0, 0.0],
        [1.0, 0.5],
        [1.0, 1.0],
        [0.0, 1.0],
    ];
    for first in 0..square.len() {
        let mut points = square.to_vec();
        points.rotate_left(first);
        let tilted = tilt(&points);
        for triangle in split(&tilted).0 {
            let corners = triangle.map(|k| points[k as usize]);
            assert!(shoelace(&corners) > 0.1, "{first}: {corners:?}");
        }
    }
}

#[test]
fn many_corners_take_no_quadratic_time() {
    // A quadratic algorithm would need minutes.
    let began = std::time::Instant::now();
    assert_covers(&comb(100_000));
    assert_covers(&spiral(200_000));
    let radii: Vec<f64> = (0..200_000)
        .map(|k| 1.0 + 0.3 * (f64::from(k) * PI).cos())
        .collect();
    assert_covers(&star(&radii));
    // Crossing itself everywhere.
    let points: Vec<[f64; 3]> = (0..100_000u64)
        .map(|k| [17, 31, 0].map(|m| (k * k * m % 10_007) as f64))
        .collect();
    split(&points);
    assert!(began.elapsed().as_secs() < 60, "{:?}", began.elapsed());
}

#[test]
fn a_stop_is_seen_within_one_polygon() {
    let context = ReadContext::new(Limits::default());
    context.cancel.cancel();
    let points = tilt(&comb(10_000));
    let mut fan: Vec<[u32; 3]> = (1..points.len() as u32 - 1).map(|k| [0, k, k + 1]).collect();
    let stopped = Triangulator::new(&points, &context).triangulate(&mut fan);
    assert!(matches!(stopped, Err(MeshError::Cancelled(_))));
}
