//! More vertices on the same surface, for meshes too coarse for the eigenfunctions that are asked of them.

use super::edges::for_each_edge;
use super::work::{Watch, Work};
use super::{MeshError, TriMesh};
use crate::cancel::Cancel;
use crate::memory::MemoryBudget;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// Two vertices, the smaller index first.
type Edge = (u32, u32);

/// Splits the longest edge at its midpoint, again and again, until there are `target` vertices; a mesh that has them
/// stays as it is.
///
/// The surface does not change, only its triangles: piecewise linear functions on the finer mesh follow short waves
/// that the coarse one cannot carry, so its eigenvalues come near those of the surface. All faces of an edge are split
/// with it, so boundaries and non-manifold places are kept. Vertices in edges between vertices that carry signatures
/// carry signatures too. Near-linear in `target`.
///
/// Errors: those of [`TriMesh::new`], which a mesh that came from it does not meet but by rounding.
pub fn refine(mesh: TriMesh, target: usize) -> Result<TriMesh, MeshError> {
    refine_until(mesh, target, &Cancel::new())
}

/// As [`refine`], for a caller that may ask to stop.
///
/// Errors: those of [`refine`], and [`MeshError::Cancelled`].
pub fn refine_until(mesh: TriMesh, target: usize, cancel: &Cancel) -> Result<TriMesh, MeshError> {
    if mesh.vertices().len() >= target {
        return Ok(mesh);
    }
    let mut carries: Vec<bool> = (0..mesh.vertices().len())
        .map(|v| v < mesh.signature_vertices())
        .collect();
    let (vertices, faces) = mesh.into_parts();
    let memory = MemoryBudget::unlimited().reservation();
    let work = Work {
        cancel,
        memory: &memory,
    };
    let mut surface = Surface::new(vertices, faces, work)?;
    while surface.vertices.len() < target {
        work.check()?;
        let Some((a, b)) = surface.split_longest() else {
            break;
        };
        carries.push(carries[a as usize] && carries[b as usize]);
    }
    // Those that carry signatures come first.
    let signature_vertices = carries.iter().filter(|c| **c).count();
    let (mut first, mut last) = (0, signature_vertices);
    let place: Vec<u32> = carries
        .iter()
        .map(|&carries| {
            let next = if carries { &mut first } else { &mut last };
            *next += 1;
            *next as u32 - 1
        })
        .collect();
    let mut vertices = vec![[0.0; 3]; place.len()];
    for (p, at) in surface.vertices.iter().zip(&place) {
        vertices[*at as usize] = *p;
    }
    let faces = surface
        .faces
        .iter()
        .map(|f| f.map(|v| place[v as usize]))
        .collect();
    TriMesh::new(vertices, faces, signature_vertices)
}

/// A triangle list that knows the faces of every edge.
struct Surface {
    vertices: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    faces_of: HashMap<Edge, Vec<u32>>,
    /// Edges by squared length, as the bits of a number that is not negative. Those that have been split are still in
    /// it and have no faces any more.
    longest: BinaryHeap<(u64, Reverse<Edge>)>,
}

impl Surface {
    fn new(vertices: Vec<[f64; 3]>, faces: Vec<[u32; 3]>, work: Work) -> Result<Self, MeshError> {
        let mut faces_of = HashMap::new();
        for_each_edge(vertices.len(), &faces, &work, |a, b, group| {
            let at: Vec<u32> = group.iter().map(|half| half / 6).collect();
            faces_of.insert((a, b), at);
        })?;
        let mut surface = Self {
            vertices,
            faces,
            longest: BinaryHeap::with_capacity(faces_of.len()),
            faces_of,
        };
        let edges: Vec<Edge> = surface.faces_of.keys().copied().collect();
        for (i, edge) in edges.into_iter().enumerate() {
            work.look(i)?;
            surface.queue(edge);
        }
        Ok(surface)
    }

    fn queue(&mut self, edge: Edge) {
        let (a, b) = (self.vertices[edge.0 as usize], self.vertices[edge.1 as usize]);
        let length2: f64 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
        self.longest.push((length2.to_bits(), Reverse(edge)));
    }

    /// Splits the longest edge and returns it; the new vertex is the last one. `None` where there is no edge.
    fn split_longest(&mut self) -> Option<Edge> {
        let (a, b, faces) = loop {
            let (_, Reverse((a, b))) = self.longest.pop()?;
            if let Some(faces) = self.faces_of.remove(&(a, b)) {
                break (a, b, faces);
            }
        };
        let middle = self.vertices.len() as u32;
        let (p, q) = (self.vertices[a as usize], self.vertices[b as usize]);
        self.vertices
            .push(std::array::from_fn(|k| 0.5 * p[k] + 0.5 * q[k]));
        for &face in &faces {
            let corners = self.faces[face as usize];
            let added = self.faces.len() as u32;
            let with = |from: u32| corners.map(|v| if v == from { middle } else { v });
            self.faces[face as usize] = with(b);
            self.faces.push(with(a));
            let Some(&apex) = corners.iter().find(|&&v| v != a && v != b) else {
                continue;
            };
            // The half at b is a new face, so the edge from b to the apex has changed its face.
            if let Some(list) = self.faces_of.get_mut(&edge(b, apex)) {
                list.iter_mut().filter(|f| **f == face).for_each(|f| *f = added);
            }
            self.faces_of.entry((a, middle)).or_default().push(face);
            self.faces_of.entry((b, middle)).or_default().push(added);
            self.faces_of
                .entry(edge(apex, middle))
                .or_default()
                .extend([face, added]);
            self.queue(edge(apex, middle));
        }
        self.queue((a, middle));
        self.queue((b, middle));
        Some((a, b))
    }
}

fn edge(a: u32, b: u32) -> Edge {
    (a.min(b), a.max(b))
}
