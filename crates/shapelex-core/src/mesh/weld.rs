//! Merging vertices that lie at the same place.

use super::MeshError;
use super::components::DisjointSets;
use super::sort::sort;
use super::work::{Watch, Work};

/// Coincident means: closer than this share of the bounding-box diagonal along every axis.
pub const WELD_TOLERANCE: f64 = 1e-9;

/// Bits per axis of a grid cell. The longest axis of a box has at most 1 / [`WELD_TOLERANCE`] < 2³⁰ cells.
const BITS: u32 = 30;

/// Welded vertices, and where each input vertex went.
pub(super) struct Welded {
    /// One vertex per place, in the order of first appearance.
    pub vertices: Vec<[f64; 3]>,
    /// For each input vertex its index in `vertices`.
    pub index: Vec<u32>,
}

/// Merges coincident vertices; coordinates must be finite and not all equal.
///
/// Space is cut into cells with sides of the tolerance: the larger of `within` and [`WELD_TOLERANCE`] of the
/// bounding-box diagonal. Vertices in one cell or in cells that touch are one vertex, and so on transitively, which makes
/// the outcome independent of the vertex order: pairs closer than the tolerance along every axis always merge, pairs
/// further apart than twice that never do unless others lie between them. The merged vertex takes the lexicographically
/// smallest of its members' coordinates.
///
/// Most vertices of most meshes are alone far and wide, which one hash table over coarse cells shows ([`suspects`]).
/// The others are sorted by cell and swept over: n log n whatever the distribution of the points.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn weld(mut vertices: Vec<[f64; 3]>, within: f64, work: Work) -> Result<Welded, MeshError> {
    let (low, diagonal) = bounding_box(&vertices);
    let side = within.max(WELD_TOLERANCE * diagonal);
    // Cells are numbered from 1, so that the cell before the first has a number too.
    let cell =
        |p: &[f64; 3]| std::array::from_fn(|k| (((p[k] - low[k]) / side) as u64 + 1).min((1 << BITS) - 2));
    let _cells = work.hold(vertices.len(), 4)?;
    let suspects = suspects(&vertices, cell, work)?;
    let _suspects = work.hold(suspects.len(), 4 + 16)?;
    let mut order: Vec<u128> = Vec::with_capacity(suspects.len());
    for (n, &i) in suspects.iter().enumerate() {
        work.look(n)?;
        let key = cell(&vertices[i as usize])
            .iter()
            .fold(0, |key, c| key << BITS | u128::from(*c));
        order.push(key << 32 | u128::from(i));
    }
    sort(&mut order, &work)?;

    const ALONE: u32 = u32::MAX;
    let _joined = work.hold(order.len(), 4 + 4)?;
    let mut index = vec![ALONE; vertices.len()];
    let cells = number_cells(order, &mut index, work)?;
    let mut sets = DisjointSets::new(cells.len());
    join_touching(&cells, &mut sets, work)?;

    let mut place = vec![u32::MAX; cells.len()];
    let mut kept = 0;
    for i in 0..vertices.len() {
        work.look(i)?;
        let (p, c) = (vertices[i], index[i]);
        let slot = if c == ALONE {
            kept
        } else {
            let slot = &mut place[sets.find(c) as usize];
            if *slot == u32::MAX {
                *slot = kept;
            }
            *slot
        };
        index[i] = slot;
        if slot == kept {
            vertices[kept as usize] = p;
            kept += 1;
        } else if p < vertices[slot as usize] {
            vertices[slot as usize] = p;
        }
    }
    vertices.truncate(kept as usize);
    Ok(Welded { vertices, index })
}

/// The cells that are not empty, ascending, and for each vertex of `order` the number of its cell.
fn number_cells(mut order: Vec<u128>, cell_of: &mut [u32], work: Work) -> Result<Vec<u128>, MeshError> {
    let mut count = 0;
    for i in 0..order.len() {
        work.look(i)?;
        let key = order[i];
        if count == 0 || order[count - 1] != key >> 32 {
            order[count] = key >> 32;
            count += 1;
        }
        cell_of[(key & 0xffff_ffff) as usize] = (count - 1) as u32;
    }
    order.truncate(count);
    Ok(order)
}

/// The vertices that may have another one in their cell or in a cell that touches it, ascending: those that share a
/// coarse cell of 2¹⁰ cells a side, and those in the outermost cells of theirs, whose neighbours may lie in the next.
fn suspects(
    vertices: &[[f64; 3]],
    cell: impl Fn(&[f64; 3]) -> [u64; 3],
    work: Work,
) -> Result<Vec<u32>, MeshError> {
    const COARSE: u32 = 10;
    const INNER: u64 = (1 << COARSE) - 1;
    const FREE: u32 = u32::MAX;
    /// Longer runs in a table half full are made on purpose; then every vertex is suspect, which the sort can bear.
    const LONGEST_RUN: usize = 256;
    // Open addressing, at most half full.
    let bits = (2 * vertices.len()).next_power_of_two().trailing_zeros().max(1);
    let _held = (work.hold(vertices.len(), 8 + 1 + 4)?, work.hold(1 << bits, 4)?);
    let mut suspect = vec![false; vertices.len()];
    let mut keys = Vec::with_capacity(vertices.len());
    for (i, (p, suspect)) in vertices.iter().zip(&mut suspect).enumerate() {
        work.look(i)?;
        let cell = cell(p);
        *suspect = cell.iter().any(|c| matches!(c & INNER, 0 | INNER));
        keys.push(cell.iter().fold(0, |key, c| key << (BITS - COARSE) | c >> COARSE));
    }
    let mut table = vec![FREE; 1 << bits];
    for (i, key) in keys.iter().enumerate() {
        work.look(i)?;
        // Fibonacci hashing: the high bits of a product with 2⁶⁴ / φ are well mixed.
        let mut slot = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - bits)) as usize;
        for run in 0.. {
            if run == LONGEST_RUN {
                return Ok((0..vertices.len() as u32).collect());
            }
            let there = table[slot];
            if there == FREE {
                table[slot] = i as u32;
                break;
            }
            if keys[there as usize] == *key {
                suspect[there as usize] = true;
                suspect[i] = true;
                break;
            }
            slot = (slot + 1) & ((1 << bits) - 1);
        }
    }
    Ok((0..vertices.len() as u32)
        .filter(|&i| suspect[i as usize])
        .collect())
}

/// Joins cells that touch, corners included. `cells` is sorted.
///
/// The neighbours behind a cell are three consecutive keys in each of four columns, and one in its own; as the keys
/// ascend so do those ranges, and one pointer per column walks through the list once.
fn join_touching(cells: &[u128], sets: &mut DisjointSets, work: Work) -> Result<(), MeshError> {
    let (x, y) = (1u128 << (2 * BITS), 1u128 << BITS);
    let columns = [0, y, x - y, x, x + y];
    let mut pointer = [0usize; 5];
    for (i, key) in cells.iter().enumerate() {
        work.look(i)?;
        for (column, p) in columns.iter().zip(&mut pointer) {
            let centre = key + column;
            while *p < cells.len() && cells[*p] < centre - 1 {
                *p += 1;
            }
            let mut q = *p;
            while q < cells.len() && cells[q] <= centre + 1 {
                sets.union(i as u32, q as u32);
                q += 1;
            }
        }
    }
    Ok(())
}

/// Lowest corner and diagonal of the axis-aligned bounding box.
fn bounding_box(vertices: &[[f64; 3]]) -> ([f64; 3], f64) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for p in vertices {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    (low, super::boundary::distance(&low, &high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::Cancel;
    use crate::memory::MemoryBudget;

    fn weld(vertices: &[[f64; 3]]) -> Welded {
        let (cancel, memory) = (Cancel::new(), MemoryBudget::unlimited().reservation());
        let work = Work {
            cancel: &cancel,
            memory: &memory,
        };
        super::weld(vertices.to_vec(), 0.0, work).unwrap()
    }

    #[test]
    fn merges_below_the_tolerance_and_not_above() {
        let d = 3f64.sqrt();
        let mut vertices = vec![[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.5, 0.5, 0.5]];
        vertices.push([0.5 + 0.9e-9 * d, 0.5 - 0.9e-9 * d, 0.5]); // merges with the third
        vertices.push([0.5, 0.5, 0.5 + 5e-9 * d]); // does not
        vertices.push([1.0, 1.0, 1.0]); // merges with the second
        let welded = weld(&vertices);
        assert_eq!(welded.index, [0, 1, 2, 2, 3, 1]);
        assert_eq!(welded.vertices[2], [0.5, 0.5, 0.5]);
    }

    #[test]
    fn finds_pairs_across_every_kind_of_cell_border() {
        // Pairs 0.9 tolerances apart along all 26 sign patterns, at places that fall anywhere within a cell.
        let mut vertices = vec![[-1.0; 3], [1.0; 3]];
        let step = 0.9 * WELD_TOLERANCE * 12f64.sqrt();
        for i in 0..27 {
            for j in 0..40 {
                let at = [
                    0.01 * f64::from(i) - 0.3,
                    0.013 * f64::from(j),
                    0.007 * f64::from(j),
                ];
                let sign = [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1].map(f64::from);
                vertices.push(at);
                vertices.push([
                    at[0] + step * sign[0],
                    at[1] + step * sign[1],
                    at[2] + step * sign[2],
                ]);
            }
        }
        assert_eq!(weld(&vertices).vertices.len(), 2 + 27 * 40);
    }

    #[test]
    fn many_distinct_points_in_a_small_corner_stay_apart() {
        let mut vertices = vec![[1.0, 1.0, 1.0]];
        for i in 0..20_000u32 {
            vertices.push([f64::from(i % 200) * 1e-8, f64::from(i / 200) * 1e-8, 0.0]);
        }
        assert_eq!(weld(&vertices).vertices.len(), 20_001);
    }
}
