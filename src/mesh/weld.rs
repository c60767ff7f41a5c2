//! Merging vertices that lie at the same place.

use super::components::DisjointSets;

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
/// Space is cut into cells with sides of the tolerance. Vertices in one cell or in cells that touch are one vertex,
/// and so on transitively, which makes the outcome independent of the vertex order: pairs closer than the tolerance
/// along every axis always merge, pairs further apart than twice that never do unless others lie between them. The
/// merged vertex takes the lexicographically smallest of its members' coordinates.
///
/// One sort of the cells and one sweep over them: n log n whatever the distribution of the points.
pub(super) fn weld(vertices: &[[f64; 3]]) -> Welded {
    let (low, diagonal) = bounding_box(vertices);
    let side = WELD_TOLERANCE * diagonal;
    // Cells are numbered from 1, so that the cell before the first has a number too.
    let cell = |p: &[f64; 3]| {
        (0..3).fold(0u128, |key, k| {
            let i = ((p[k] - low[k]) / side) as u64 + 1;
            key << BITS | u128::from(i.min((1 << BITS) - 2))
        })
    };
    let mut order: Vec<u128> = vertices
        .iter()
        .enumerate()
        .map(|(i, p)| cell(p) << 32 | i as u128)
        .collect();
    order.sort_unstable();

    let mut cells: Vec<u128> = Vec::with_capacity(vertices.len());
    let mut cell_of = vec![0u32; vertices.len()];
    for key in order {
        if cells.last() != Some(&(key >> 32)) {
            cells.push(key >> 32);
        }
        cell_of[(key & 0xffff_ffff) as usize] = (cells.len() - 1) as u32;
    }
    let mut sets = DisjointSets::new(cells.len());
    join_touching(&cells, &mut sets);

    let mut place = vec![u32::MAX; cells.len()];
    let mut welded = Welded {
        vertices: Vec::with_capacity(cells.len()),
        index: Vec::with_capacity(vertices.len()),
    };
    for (p, &c) in vertices.iter().zip(&cell_of) {
        let slot = &mut place[sets.find(c) as usize];
        if *slot == u32::MAX {
            *slot = welded.vertices.len() as u32;
            welded.vertices.push(*p);
        } else {
            let kept = &mut welded.vertices[*slot as usize];
            if *p < *kept {
                *kept = *p;
            }
        }
        welded.index.push(*slot);
    }
    welded
}

/// Joins cells that touch, corners included. `cells` is sorted.
///
/// The neighbours behind a cell are three consecutive keys in each of four columns, and one in its own; as the keys
/// ascend so do those ranges, and one pointer per column walks through the list once.
fn join_touching(cells: &[u128], sets: &mut DisjointSets) {
    let (x, y) = (1u128 << (2 * BITS), 1u128 << BITS);
    let columns = [0, y, x - y, x, x + y];
    let mut pointer = [0usize; 5];
    for (i, key) in cells.iter().enumerate() {
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
