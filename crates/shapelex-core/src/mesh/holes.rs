//! Closing small boundary loops.

use super::MeshError;
use super::boundary::{boundary_length, boundary_loops};
use super::trimesh::face_area;
use super::work::{Watch, Work};

/// A fan face below this share of the total area is not added, as the cleaning would drop it.
const NO_AREA: f64 = 1e-12;

/// Vertices for each loop of a surface with holes, at least.
const VERTICES_OF_LOOP: usize = 4;

/// Closes every boundary loop with a perimeter below `below` · √area by a fan around the mean of its vertices, and
/// returns how many were closed. `boundary` are the edges of one face ([`edge_census`](super::edges::edge_census)).
///
/// The new vertices are appended, so the indices of the old ones stay. The area is that before anything is closed.
/// Fan faces run against their neighbours' direction, as on a consistently oriented surface. A loop whose whole fan
/// has no area (a slit) stays, and so do all where there is more than one loop for four vertices: in a tangle of faces, or
/// between many faces at one edge, they bound no holes, and their centres would be a large part of the mesh.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn fill_small_holes(
    vertices: &mut Vec<[f64; 3]>,
    faces: &mut Vec<[u32; 3]>,
    boundary: &[[u32; 2]],
    below: f64,
    work: Work,
) -> Result<usize, MeshError> {
    if below.is_nan() || below <= 0.0 {
        return Ok(0);
    }
    let area: f64 = faces.iter().map(|f| face_area(vertices, f)).sum();
    let mut filled = 0;
    let loops = boundary_loops(vertices, boundary, &work)?;
    if loops.len() > vertices.len() / VERTICES_OF_LOOP {
        return Ok(0);
    }
    for (i, edges) in loops.into_iter().enumerate() {
        work.look(i)?;
        if boundary_length(vertices, &edges) >= below * area.sqrt() {
            continue;
        }
        // Every vertex of a simple loop is in two of its edges, so the mean over ends is the mean over vertices.
        let mut mean = [0.0; 3];
        for v in edges.iter().flatten() {
            for k in 0..3 {
                mean[k] += vertices[*v as usize][k];
            }
        }
        let centre = vertices.len() as u32;
        vertices.push(mean.map(|x| x / (2 * edges.len()) as f64));
        let before = faces.len();
        for &[a, b] in &edges {
            let fan = [b, a, centre];
            if face_area(vertices, &fan) >= NO_AREA * area {
                faces.push(fan);
            }
        }
        if faces.len() == before {
            vertices.pop();
        } else {
            filled += 1;
        }
    }
    Ok(filled)
}

#[cfg(test)]
mod tests {
    use super::super::edges::edge_census;
    use super::super::work::Unwatched;
    use super::*;
    use crate::cancel::Cancel;
    use crate::memory::MemoryBudget;

    fn fill(vertices: &mut Vec<[f64; 3]>, faces: &mut Vec<[u32; 3]>, below: f64) -> usize {
        let boundary = edge_census(vertices.len(), faces).boundary;
        let (cancel, memory) = (Cancel::new(), MemoryBudget::unlimited().reservation());
        let work = Work {
            cancel: &cancel,
            memory: &memory,
        };
        fill_small_holes(vertices, faces, &boundary, below, work).unwrap()
    }

    /// A flat n × n grid of unit squares, two triangles each.
    fn grid(n: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let at = |i: u32, j: u32| i * (n + 1) + j;
        let vertices = (0..=n)
            .flat_map(|i| (0..=n).map(move |j| [f64::from(i), f64::from(j), 0.0]))
            .collect();
        let faces = (0..n)
            .flat_map(|i| {
                (0..n).flat_map(move |j| {
                    [
                        [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                        [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                    ]
                })
            })
            .collect();
        (vertices, faces)
    }

    /// Removes the squares with the given lower corners.
    fn without(n: u32, squares: &[(u32, u32)]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let (vertices, faces) = grid(n);
        let gone: Vec<u32> = squares.iter().map(|(i, j)| 2 * (i * n + j)).collect();
        let faces = (faces.iter().enumerate())
            .filter(|(f, _)| !gone.contains(&(*f as u32 & !1)))
            .map(|(_, f)| *f)
            .collect();
        (vertices, faces)
    }

    fn area(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
        faces.iter().map(|f| face_area(vertices, f)).sum()
    }

    #[test]
    fn a_small_hole_is_closed_and_the_outer_boundary_stays() {
        let (mut vertices, mut faces) = without(8, &[(3, 3)]);
        assert_eq!(fill(&mut vertices, &mut faces, 1.2), 1);
        assert_eq!(vertices.len(), 82);
        assert_eq!(vertices[81], [3.5, 3.5, 0.0]);
        assert!((area(&vertices, &faces) - 64.0).abs() < 1e-12);
        let census = edge_census(vertices.len(), &faces);
        assert_eq!(
            (census.boundary.len(), census.non_manifold, census.inconsistent),
            (32, 0, 0)
        );
    }

    #[test]
    fn holes_that_touch_in_a_vertex_are_two_loops() {
        let (mut vertices, mut faces) = without(8, &[(3, 3), (4, 4), (4, 2)]);
        assert_eq!(fill(&mut vertices, &mut faces, 1.2), 3);
        assert!((area(&vertices, &faces) - 64.0).abs() < 1e-12);
    }

    #[test]
    fn a_hole_above_the_limit_stays() {
        let (mut vertices, mut faces) = without(8, &[(2, 3), (3, 3), (4, 3), (5, 3)]); // perimeter 10 > 1.2 · √60
        let before = faces.clone();
        assert_eq!(fill(&mut vertices, &mut faces, 1.2), 0);
        assert_eq!(faces, before);
        assert_eq!(fill(&mut vertices, &mut faces, 0.0), 0);
        assert_eq!(fill(&mut vertices, &mut faces, f64::NAN), 0);
    }

    #[test]
    fn walks_end_on_odd_vertices_and_dead_ends() {
        // A lollipop: a square with a tail that ends nowhere, and a second tail.
        let vertices: Vec<[f64; 3]> = (0..7)
            .map(|i| [f64::from(i), f64::from(i * i % 5), 0.0])
            .collect();
        let edges = [[0, 1], [1, 2], [2, 3], [3, 0], [3, 4], [4, 5], [6, 4]];
        let Ok(loops) = boundary_loops(&vertices, &edges, &Unwatched);
        assert_eq!(loops.len(), 1);
        let mut found = loops[0].clone();
        found.sort_unstable();
        assert_eq!(found, [[0, 1], [1, 2], [2, 3], [3, 0]]);
    }
}
