//! The boundary of a surface: which vertices lie on it, and how much of it there is.

use super::edges::edge_census;
use super::work::{Unwatched, Watch};
use super::{MeshError, TriMesh};

/// Which vertices lie on the boundary: V flags, true for the ends of every edge with exactly one face.
///
/// These are the vertices a mirrored copy shares ([`double`](super::double::double)) and the ones a Dirichlet
/// problem on the same mesh sets to zero. All false for a closed surface.
pub fn boundary_vertices(mesh: &TriMesh) -> Vec<bool> {
    let mut on_boundary = vec![false; mesh.vertices().len()];
    for edge in edge_census(mesh.vertices().len(), mesh.faces()).boundary {
        for v in edge {
            on_boundary[v as usize] = true;
        }
    }
    on_boundary
}

/// Length of the boundary's loops / √area: 0 for a closed surface, 2.507 for a half sphere, 8–16 for a single view of a
/// shape.
///
/// An edge of one face that is in no loop, as fins at non-manifold edges have them, bounds no part that is missing.
pub fn openness(mesh: &TriMesh) -> f64 {
    let boundary = edge_census(mesh.vertices().len(), mesh.faces()).boundary;
    let Ok(length) = loops_length(mesh.vertices(), &boundary, &Unwatched);
    length / mesh.area().sqrt()
}

/// Bytes that finding the loops takes for each boundary edge.
const LOOP_BYTES: usize = 100;

/// Summed length of the loops that boundary edges form.
///
/// # Errors
/// Those of the watch.
pub(super) fn loops_length<W: Watch>(
    vertices: &[[f64; 3]],
    boundary: &[[u32; 2]],
    watch: &W,
) -> Result<f64, W::Error> {
    let loops = boundary_loops(vertices, boundary, watch)?;
    // Folded from +0, as an empty float sum is −0.
    Ok(loops
        .iter()
        .fold(0.0, |length, edges| length + boundary_length(vertices, edges)))
}

/// The mesh with a smoother boundary: each vertex on it moves half-way to the mean of its neighbours along it. Faces,
/// order, signature vertices and everything inside stay.
///
/// Where a shape was cut by what could be seen of it, the cut follows the edges of the mesh in a zigzag, as wide as an
/// edge is long. A function that vanishes on the boundary is pressed into what lies behind all notches, which on a thin
/// limb is much less than there is.
///
/// # Errors
/// [`MeshError::Degenerate`] where nothing is left.
pub fn smooth_boundary(mesh: TriMesh) -> Result<TriMesh, MeshError> {
    let signature_vertices = mesh.signature_vertices();
    let (mut vertices, faces) = mesh.into_parts();
    let mut neighbours = vec![([0.0; 3], 0_u32); vertices.len()];
    for [a, b] in edge_census(vertices.len(), &faces).boundary {
        for (at, other) in [(a, b), (b, a)] {
            let (sum, count) = &mut neighbours[at as usize];
            for (s, x) in sum.iter_mut().zip(vertices[other as usize]) {
                *s += x;
            }
            *count += 1;
        }
    }
    for (vertex, (sum, count)) in vertices.iter_mut().zip(neighbours) {
        if count > 0 {
            for (x, s) in vertex.iter_mut().zip(sum) {
                *x = 0.5 * (*x + s / f64::from(count));
            }
        }
    }
    TriMesh::new(vertices, faces, signature_vertices)
}

/// Splits boundary edges into simple loops, each a list of the edges as given (their direction may vary).
///
/// At an ordinary boundary two edges meet in a vertex and there is nothing to choose. Where more meet (holes that
/// touch in a vertex, non-manifold spots) the walk takes the shortest edge first, and whenever it comes back to a
/// vertex it has passed, the part since then is a loop of its own. A walk that ends nowhere is dropped. Choices go by
/// place, never by index, so the order of vertices does not matter.
///
/// # Errors
/// Those of the watch.
pub(super) fn boundary_loops<W: Watch>(
    vertices: &[[f64; 3]],
    boundary: &[[u32; 2]],
    watch: &W,
) -> Result<Vec<Vec<[u32; 2]>>, W::Error> {
    let _held = watch.hold(boundary.len(), LOOP_BYTES)?;
    // Compact numbers of the vertices on the boundary, ordered by place.
    let mut on: Vec<u32> = boundary.iter().flatten().copied().collect();
    on.sort_unstable();
    on.dedup();
    let by_index = on.clone();
    let place = |v: u32| vertices[v as usize];
    on.sort_by(|&a, &b| {
        place(a)
            .partial_cmp(&place(b))
            .unwrap_or(std::cmp::Ordering::Equal)
            .then(a.cmp(&b))
    });
    let mut rank = vec![0u32; on.len()];
    for (r, v) in on.iter().enumerate() {
        rank[by_index.partition_point(|w| w < v)] = r as u32;
    }
    let rank_of = |v: u32| rank[by_index.partition_point(|w| *w < v)];

    // The edges of each vertex, shortest last, as a walk takes from the end: length, other end, edge.
    let mut start = vec![0u32; on.len() + 1];
    for &v in boundary.iter().flatten() {
        start[rank_of(v) as usize + 1] += 1;
    }
    for r in 0..on.len() {
        start[r + 1] += start[r];
    }
    let mut end = start.clone();
    let mut edges_at = vec![(0.0, 0u32, 0u32); 2 * boundary.len()];
    for (e, &[a, b]) in boundary.iter().enumerate() {
        watch.look(e)?;
        let (ra, rb) = (rank_of(a), rank_of(b));
        let length = distance(&place(a), &place(b));
        for (at, to) in [(ra, rb), (rb, ra)] {
            let slot = &mut end[at as usize];
            edges_at[*slot as usize] = (length, to, e as u32);
            *slot += 1;
        }
    }
    for r in 0..on.len() {
        watch.look(r)?;
        let list = &mut edges_at[start[r] as usize..start[r + 1] as usize];
        list.sort_by(|x, y| y.0.total_cmp(&x.0).then(y.1.cmp(&x.1)));
    }

    let mut used = vec![false; boundary.len()];
    let mut position = vec![usize::MAX; on.len()]; // where a vertex stands on the current path
    let mut loops = Vec::new();
    let mut steps = 0;
    for first in 0..on.len() {
        let mut path: Vec<usize> = vec![first]; // vertices
        let mut trail: Vec<usize> = Vec::new(); // edges between them
        position[first] = 0;
        while let Some(&at) = path.last() {
            watch.look(steps)?;
            steps += 1;
            let left = &mut end[at];
            if *left == start[at] {
                // A dead end: step back and leave the edge out.
                position[at] = usize::MAX;
                path.pop();
                trail.pop();
                continue;
            }
            *left -= 1;
            let (_, to, e) = edges_at[*left as usize];
            let (to, e) = (to as usize, e as usize);
            if used[e] {
                continue;
            }
            used[e] = true;
            trail.push(e);
            if position[to] == usize::MAX {
                position[to] = path.len();
                path.push(to);
            } else {
                let since = position[to];
                loops.push(trail.drain(since..).map(|e| boundary[e]).collect());
                for v in path.drain(since + 1..) {
                    position[v] = usize::MAX;
                }
            }
        }
    }
    Ok(loops)
}

/// Summed length of edges.
pub(super) fn boundary_length(vertices: &[[f64; 3]], edges: &[[u32; 2]]) -> f64 {
    // Folded from +0, as an empty float sum is −0.
    edges.iter().fold(0.0, |length, e| {
        length + distance(&vertices[e[0] as usize], &vertices[e[1] as usize])
    })
}

/// Euclidean distance of two points.
pub(super) fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_square_is_all_boundary_but_its_centre() {
        let vertices = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.5, 0.5, 0.0],
        ];
        let faces = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        let mesh = TriMesh::new(vertices, faces, 5).unwrap();
        assert_eq!(boundary_vertices(&mesh), [true, true, true, true, false]);
        assert!((openness(&mesh) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn a_zigzag_is_smoothed_and_nothing_else_moves() {
        // A strip: a straight row of vertices, a row inside, and a row that goes in and out by half.
        let n = 20;
        let mut vertices = Vec::new();
        for row in 0..3 {
            for i in 0..n {
                let tooth = if row == 2 && i % 2 == 0 { 0.5 } else { 0.0 };
                vertices.push([f64::from(i), f64::from(row) + tooth, 0.0]);
            }
        }
        let mut faces = Vec::new();
        for row in 0..2 {
            for i in 0..n as u32 - 1 {
                let a = row * n as u32 + i;
                let b = a + n as u32;
                faces.extend([[a, a + 1, b], [a + 1, b + 1, b]]);
            }
        }
        let mesh = TriMesh::new(vertices.clone(), faces, 50).unwrap();
        let smooth = smooth_boundary(mesh.clone()).unwrap();
        assert_eq!((smooth.faces(), smooth.signature_vertices()), (mesh.faces(), 50));
        let n = n as usize;
        let away_from_corners = 2..n - 2;
        assert_eq!(smooth.vertices()[n + 1..2 * n - 1], vertices[n + 1..2 * n - 1]);
        for i in away_from_corners {
            assert_eq!(smooth.vertices()[i], vertices[i]);
            assert_eq!(smooth.vertices()[2 * n + i], [i as f64, 2.25, 0.0]);
        }
    }

    #[test]
    fn a_closed_surface_has_no_boundary_to_smooth() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = TriMesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], 4).unwrap();
        assert_eq!(smooth_boundary(mesh.clone()).unwrap(), mesh);
    }
}
