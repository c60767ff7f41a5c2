//! An order of vertices and faces in which neighbours on the surface are neighbours in memory.

use super::MeshError;
use super::sort::sort;
use super::work::{Watch, Work};

/// Bits per axis of the curve: cells of a thousandth of the mesh hold a handful of a million vertices.
const BITS: u32 = 10;

/// Orders vertices along a Z curve (Morton 1966) and faces by their smallest vertex. Coordinates must lie within
/// [−1, 1]. Vertices of one cell keep their order, and so do faces of one vertex.
///
/// A file may list its faces in any order; a million of them taken at random miss the cache at every step. One sort
/// of the vertices and a linear pass over the faces.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn order_along_curve(
    vertices: &mut Vec<[f64; 3]>,
    faces: &mut Vec<[u32; 3]>,
    work: Work,
) -> Result<(), MeshError> {
    let place = order_vertices(vertices, work)?;
    order_faces(&place, faces, work)
}

/// Orders the vertices and returns the new index of each.
fn order_vertices(vertices: &mut Vec<[f64; 3]>, work: Work) -> Result<Vec<u32>, MeshError> {
    let _held = work.hold(vertices.len(), 8 + 4 + 24)?;
    let cells = f64::from(1u32 << BITS);
    let mut order: Vec<u64> = vertices
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let key = (0..3).fold(0, |key, k| {
                let cell = ((0.5 * p[k] + 0.5) * cells).clamp(0.0, cells - 1.0);
                key | spread(cell as u32) << k
            });
            u64::from(key) << 32 | i as u64
        })
        .collect();
    sort(&mut order, &work)?;
    let mut place = vec![0u32; vertices.len()];
    let mut moved = Vec::with_capacity(vertices.len());
    for (new, key) in order.iter().enumerate() {
        work.look(new)?;
        let old = (key & 0xffff_ffff) as usize;
        place[old] = new as u32;
        moved.push(vertices[old]);
    }
    *vertices = moved;
    Ok(place)
}

/// Renumbers the corners by `place` and orders the faces by their smallest.
fn order_faces(place: &[u32], faces: &mut Vec<[u32; 3]>, work: Work) -> Result<(), MeshError> {
    let _held = (work.hold(place.len(), 8)?, work.hold(faces.len(), 12)?);
    let mut start = vec![0u32; place.len() + 1];
    for (i, f) in faces.iter_mut().enumerate() {
        work.look(i)?;
        *f = f.map(|v| place[v as usize]);
        start[f[0].min(f[1]).min(f[2]) as usize + 1] += 1;
    }
    for v in 0..place.len() {
        start[v + 1] += start[v];
    }
    let mut moved = vec![[0; 3]; faces.len()];
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        let slot = &mut start[f[0].min(f[1]).min(f[2]) as usize];
        moved[*slot as usize] = *f;
        *slot += 1;
    }
    *faces = moved;
    Ok(())
}

/// The lowest ten bits, each followed by two zeros.
fn spread(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::Cancel;
    use crate::memory::MemoryBudget;

    #[test]
    fn bits_are_spread() {
        assert_eq!(spread(0b11_1111_1111), 0b001_001_001_001_001_001_001_001_001_001);
        assert_eq!(spread(0b10_0000_0101), 0b001_000_000_000_000_000_000_001_000_001);
    }

    #[test]
    fn the_surface_stays_and_neighbours_come_together() {
        let side = 40u32;
        let coordinate = |i: u32| f64::from(i) / 20.0 - 1.0;
        // A grid whose vertices and faces are listed at a stride.
        let number = |i: u32, j: u32| (i * side + j) * 763 % (side * side);
        let mut vertices = vec![[0.0; 3]; (side * side) as usize];
        let mut faces = Vec::new();
        for i in 0..side {
            for j in 0..side {
                vertices[number(i, j) as usize] = [coordinate(i), coordinate(j), 0.25];
            }
        }
        for k in 0..side * side {
            let (i, j) = (k * 763 % (side * side) / side, k * 763 % side);
            if i + 1 < side && j + 1 < side {
                faces.push([number(i, j), number(i + 1, j), number(i, j + 1)]);
            }
        }
        let corners = |vertices: &[[f64; 3]], faces: &[[u32; 3]]| {
            let mut all: Vec<String> = faces
                .iter()
                .map(|f| format!("{:?}", f.map(|v| vertices[v as usize])))
                .collect();
            all.sort();
            all
        };
        let reach = |faces: &[[u32; 3]]| {
            let far = faces.iter().map(|f| u64::from(f[0].abs_diff(f[1])));
            far.sum::<u64>() / faces.len() as u64
        };
        let before = (corners(&vertices, &faces), reach(&faces));
        let (cancel, memory) = (Cancel::new(), MemoryBudget::unlimited().reservation());
        let work = Work {
            cancel: &cancel,
            memory: &memory,
        };
        order_along_curve(&mut vertices, &mut faces, work).unwrap();
        assert_eq!(corners(&vertices, &faces), before.0);
        assert!(reach(&faces) * 5 < before.1, "{} {}", reach(&faces), before.1);
        assert!(faces.is_sorted_by_key(|f| f.iter().min().copied()));
    }
}
