//! Connected components of a triangle list.
//!
//! Faces belong together when they share a vertex, not only an edge: that is what the Laplacian sees, whose null
//! space has one dimension per such component.

use super::work::{Watch, Work};
use super::{Components, MeshError};

/// Share of the area below which [`Components::All`] leaves a component out.
pub const SMALLEST_SHARE: f64 = 0.01;

/// Relative difference below which two areas count as equal, so that rounding does not choose between twins.
const AREA_TIE: f64 = 1e-9;

/// Disjoint sets of 0..n with path halving; the smaller index is the representative.
pub(super) struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    /// n singletons.
    pub fn new(n: usize) -> Self {
        Self {
            parent: (0..n as u32).collect(),
        }
    }

    /// The representative of `x`'s set.
    pub fn find(&mut self, mut x: u32) -> u32 {
        while self.parent[x as usize] != x {
            let up = self.parent[self.parent[x as usize] as usize];
            self.parent[x as usize] = up;
            x = up;
        }
        x
    }

    /// Merges the sets of `a` and `b`.
    pub fn union(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        if a != b {
            self.parent[a.max(b) as usize] = a.min(b);
        }
    }
}

/// What [`select`] kept.
pub(super) struct Selection {
    /// Faces of the kept components, in their order.
    pub faces: Vec<[u32; 3]>,
    /// Components found.
    pub found: usize,
    /// Components left out.
    pub dropped: usize,
    /// Area left out as a share of the total, 0 to 1.
    pub area_dropped: f64,
}

/// Keeps the largest component or all with at least 1 % of the area; the largest stays in any case.
///
/// `areas` holds one area per face. Components of equal area (to 1e-9) are told apart by their lexicographically
/// smallest vertex, so that the order of the faces does not matter.
pub(super) fn select(
    vertices: &[[f64; 3]],
    mut faces: Vec<[u32; 3]>,
    areas: &[f64],
    keep: Components,
    work: Work,
) -> Result<Selection, MeshError> {
    // There are at most as many components as faces, and no more than vertices.
    let _held = (
        work.hold(vertices.len(), 8)?,
        work.hold(vertices.len().min(faces.len()), 17)?,
    );
    let mut sets = DisjointSets::new(vertices.len());
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        sets.union(f[0], f[1]);
        sets.union(f[0], f[2]);
    }
    let mut number = vec![u32::MAX; vertices.len()];
    let mut component: Vec<f64> = Vec::new(); // areas
    for (i, (f, area)) in faces.iter().zip(areas).enumerate() {
        work.look(i)?;
        let slot = &mut number[sets.find(f[0]) as usize];
        if *slot == u32::MAX {
            *slot = component.len() as u32;
            component.push(0.0);
        }
        component[*slot as usize] += area;
    }
    let mut of_face = |f: &[u32; 3]| number[sets.find(f[0]) as usize] as usize;
    let total: f64 = component.iter().sum();
    let largest = largest(vertices, &faces, &mut of_face, &component);
    let kept: Vec<bool> = component
        .iter()
        .enumerate()
        .map(|(i, area)| i == largest || (keep == Components::All && *area >= SMALLEST_SHARE * total))
        .collect();
    let area_kept: f64 = (component
        .iter()
        .zip(&kept)
        .filter(|(_, k)| **k)
        .map(|(area, _)| area))
    .sum();
    let dropped = kept.iter().filter(|k| !**k).count();
    if dropped > 0 {
        work.check()?;
        faces.retain(|f| kept[of_face(f)]);
    }
    Ok(Selection {
        faces,
        found: component.len(),
        dropped,
        area_dropped: if dropped == 0 || total <= 0.0 {
            0.0
        } else {
            (1.0 - area_kept / total).clamp(0.0, 1.0)
        },
    })
}

/// The component of the largest area; of several, the one with the smallest vertex.
fn largest(
    vertices: &[[f64; 3]],
    faces: &[[u32; 3]],
    mut of_face: impl FnMut(&[u32; 3]) -> usize,
    areas: &[f64],
) -> usize {
    let most = areas.iter().copied().fold(0.0, f64::max);
    let tied = |c: usize| areas[c] >= most * (1.0 - AREA_TIE);
    let mut candidates = (0..areas.len()).filter(|&c| tied(c));
    let first = candidates.next().unwrap_or(0);
    if candidates.next().is_none() {
        return first;
    }
    let mut best = (first, [f64::INFINITY; 3]);
    for f in faces {
        let c = of_face(f);
        if !tied(c) {
            continue;
        }
        for &v in f {
            if vertices[v as usize] < best.1 {
                best = (c, vertices[v as usize]);
            }
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::Cancel;
    use crate::memory::MemoryBudget;

    fn select(vertices: &[[f64; 3]], faces: Vec<[u32; 3]>, areas: &[f64], keep: Components) -> Selection {
        let (cancel, memory) = (Cancel::new(), MemoryBudget::unlimited().reservation());
        let work = Work {
            cancel: &cancel,
            memory: &memory,
        };
        super::select(vertices, faces, areas, keep, work).unwrap()
    }

    fn triangle_at(vertices: &mut Vec<[f64; 3]>, x: f64, side: f64) -> [u32; 3] {
        let n = vertices.len() as u32;
        vertices.extend([[x, 0.0, 0.0], [x + side, 0.0, 0.0], [x, side, 0.0]]);
        [n, n + 1, n + 2]
    }

    #[test]
    fn keeps_the_largest_or_all_above_one_percent() {
        let mut vertices = Vec::new();
        let faces: Vec<[u32; 3]> = [(0.0, 1.0), (5.0, 2.0), (10.0, 0.1)]
            .iter()
            .map(|&(x, side)| triangle_at(&mut vertices, x, side))
            .collect();
        let areas = [0.5, 2.0, 0.005];
        let largest = select(&vertices, faces.clone(), &areas, Components::Largest);
        assert_eq!(largest.faces, [[3, 4, 5]]);
        assert_eq!((largest.found, largest.dropped), (3, 2));
        assert!((largest.area_dropped - 0.505 / 2.505).abs() < 1e-12);
        let all = select(&vertices, faces, &areas, Components::All);
        assert_eq!(all.faces, [[0, 1, 2], [3, 4, 5]]);
    }

    #[test]
    fn faces_that_share_only_a_vertex_are_one_component() {
        let vertices = vec![[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3], [4.0; 3]];
        let found = select(
            &vertices,
            vec![[0, 1, 2], [2, 3, 4]],
            &[1.0, 1.0],
            Components::Largest,
        );
        assert_eq!((found.found, found.dropped), (1, 0));
    }
}
