//! Vertices and edges of very many faces: they are simplified to a mesh whose spectrum can be solved for.

use crate::shapes::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::mesh::{PrepareOptions, TriangleSoup, prepare};
use shapelex_core::spectral::{EigenOptions, assemble, smallest_eigenpairs};

/// More faces than the simplification gives the library at once.
const FACES: u32 = 660_000;

/// What lies around a hub.
#[derive(Clone, Copy, PartialEq)]
enum Around {
    /// A cone, and nothing else.
    Nothing,
    /// A second hub on the same rim.
    SecondHub,
    /// A strip of faces.
    Strip,
}

/// Cones side by side that touch in a vertex of their rims, of `n` faces each.
fn hubs(cones: u32, n: u32, around: Around) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    for cone in 0..cones {
        let x = 2.0 * f64::from(cone);
        let place = |i: u32, r: f64| {
            let turn = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
            [x + r * turn.cos(), r * turn.sin(), 0.3 * (5.0 * turn).sin()]
        };
        let hub = soup.vertices.len() as u32;
        let rim = |i: u32| hub + 1 + i % n;
        soup.vertices.push([x, 0.0, 0.0]);
        soup.vertices.extend((0..n).map(|i| place(i, 1.0)));
        soup.faces.extend((0..n).map(|i| [hub, rim(i), rim(i + 1)]));
        let next = soup.vertices.len() as u32;
        match around {
            Around::Nothing => {}
            Around::SecondHub => {
                soup.vertices.push([x, 0.0, 1.0]);
                soup.faces.extend((0..n).map(|i| [next, rim(i + 1), rim(i)]));
            }
            Around::Strip => {
                let outer = |i: u32| next + i % n;
                soup.vertices.extend((0..n).map(|i| place(i, 1.1)));
                for i in 0..n {
                    soup.faces.extend([
                        [rim(i), outer(i), outer(i + 1)],
                        [rim(i), outer(i + 1), rim(i + 1)],
                    ]);
                }
            }
        }
    }
    soup
}

/// Pages on one edge, or where they share a vertex only, one after the other.
fn pages(n: u32, on_an_edge: bool) -> TriangleSoup {
    let mut soup = TriangleSoup {
        vertices: vec![[0.0; 3], [0.0, 0.0, 1.0]],
        ..Default::default()
    };
    for i in 0..n {
        let turn = 2.4 * f64::from(i);
        let r = 1.0 + f64::from(i) / f64::from(n);
        let page = soup.vertices.len() as u32;
        soup.vertices.push([r * turn.cos(), r * turn.sin(), 0.5]);
        if on_an_edge {
            soup.faces.push([0, 1, page]);
        } else {
            let turn = turn + 0.3;
            soup.vertices.push([r * turn.cos(), r * turn.sin(), 0.5]);
            soup.faces.push([0, page, page + 1]);
        }
    }
    soup
}

#[test]
fn meshes_around_hubs_have_a_spectrum() {
    for (name, soup) in [
        ("cone", hubs(1, FACES, Around::Nothing)),
        ("five cones", hubs(5, FACES / 5, Around::Nothing)),
        ("two hubs", hubs(1, FACES / 2, Around::SecondHub)),
        ("five pairs of hubs", hubs(5, FACES / 10, Around::SecondHub)),
        ("cone with a rim", hubs(1, FACES / 3, Around::Strip)),
        ("pages on an edge", pages(FACES, true)),
        ("pages at a vertex", pages(FACES / 2, false)),
    ] {
        let (mesh, report) = prepare(soup, &PrepareOptions::default()).unwrap();
        assert_prepared(&mesh, &report);
        let operators = assemble(&mesh).unwrap();
        let pairs = smallest_eigenpairs(&operators, 60, &EigenOptions::default(), &Cancel::new());
        let pairs = pairs.unwrap_or_else(|error| panic!("{name}: {error}; {report:?}"));
        assert_eq!(pairs.values.len(), 60, "{name}");
        assert!(pairs.values[59] > 0.0, "{name}: {:?}", pairs.values);
    }
}
