//! Making neighbouring faces run the same way round.

use super::edges::for_each_edge;

/// Reverses faces until neighbours across every edge of two faces agree, as far as the surface can be oriented.
///
/// Nothing spectral depends on orientation, but simplification does: it takes an edge whose faces disagree for a
/// boundary. Faces keep their order; the first of each edge-connected part keeps its direction. On a surface that
/// cannot be oriented (a Moebius strip) a line of disagreement is left. Linear.
pub(super) fn orient(vertex_count: usize, faces: &mut [[u32; 3]]) {
    const NONE: u32 = u32::MAX;
    // The face across each half-edge, and whether the two run the same way there, which is a disagreement.
    let mut across = vec![(NONE, false); 3 * faces.len()];
    for_each_edge(vertex_count, faces, |_, _, group| {
        if let [x, y] = *group {
            let same = x & 1 == y & 1;
            across[(x >> 1) as usize] = ((y >> 1) / 3, same);
            across[(y >> 1) as usize] = ((x >> 1) / 3, same);
        }
    });
    let mut reversed: Vec<Option<bool>> = vec![None; faces.len()];
    let mut stack = Vec::new();
    for seed in 0..faces.len() {
        if reversed[seed].is_some() {
            continue;
        }
        reversed[seed] = Some(false);
        stack.push((seed, false));
        while let Some((f, flip)) = stack.pop() {
            for &(g, same) in &across[3 * f..3 * f + 3] {
                if g != NONE && reversed[g as usize].is_none() {
                    reversed[g as usize] = Some(flip ^ same);
                    stack.push((g as usize, flip ^ same));
                }
            }
        }
    }
    for (f, flip) in faces.iter_mut().zip(reversed) {
        if flip == Some(true) {
            f.swap(1, 2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::edges::edge_census;
    use super::*;

    #[test]
    fn a_shuffled_octahedron_is_oriented_again() {
        let mut faces = vec![
            [0, 2, 4],
            [2, 1, 4],
            [1, 3, 4],
            [3, 0, 4],
            [2, 0, 5],
            [1, 2, 5],
            [3, 1, 5],
            [0, 3, 5],
        ];
        for f in [1, 2, 5, 7] {
            let face: &mut [u32; 3] = &mut faces[f];
            face.swap(0, 1);
        }
        assert!(edge_census(6, &faces).inconsistent > 0);
        orient(6, &mut faces);
        assert_eq!(edge_census(6, &faces), Default::default());
    }

    #[test]
    fn a_moebius_strip_ends_with_one_line_of_disagreement() {
        let n = 10u32;
        let mut faces = Vec::new();
        for i in 0..n {
            let (a, b) = (2 * i, 2 * i + 1);
            let (c, d) = if i + 1 < n { (a + 2, b + 2) } else { (1, 0) };
            faces.push([a, c, b]);
            faces.push([b, c, d]);
        }
        orient(2 * n as usize, &mut faces);
        let census = edge_census(2 * n as usize, &faces);
        assert_eq!((census.inconsistent, census.boundary.len()), (1, 2 * n as usize));
    }
}
