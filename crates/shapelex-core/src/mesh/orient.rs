//! Making neighbouring faces run the same way round.

use super::edges::for_each_edge;
use super::work::Watch;

/// Reverses faces until neighbours across every edge of two faces agree, as far as the surface can be oriented.
///
/// Nothing spectral depends on orientation, but simplification does: it takes an edge whose faces disagree for a
/// boundary. Faces keep their order; the first of each edge-connected part keeps its direction. On a surface that
/// cannot be oriented (a Moebius strip) a line of disagreement is left. Linear.
///
/// # Errors
/// Those of the watch.
pub(super) fn orient<W: Watch>(
    vertex_count: usize,
    faces: &mut [[u32; 3]],
    work: &W,
) -> Result<(), W::Error> {
    const NONE: u32 = u32::MAX;
    const REVERSED: u8 = 1;
    const SEEN: u8 = 2;
    let _across = work.hold(faces.len(), 3 * size_of::<u32>())?;
    // The face across each half-edge, doubled, and one more where the two run the same way there, a disagreement.
    let mut across = vec![NONE; 3 * faces.len()];
    for_each_edge(vertex_count, faces, work, |_, _, group| {
        if let [x, y] = *group {
            let same = u32::from(x & 1 == y & 1);
            across[(x >> 1) as usize] = (y >> 1) / 3 * 2 + same;
            across[(y >> 1) as usize] = (x >> 1) / 3 * 2 + same;
        }
    })?;
    // A stack that grows by doubling holds up to three times its length for a moment.
    let _walk = work.hold(faces.len(), 1 + 3 * size_of::<u32>())?;
    let mut state = vec![0u8; faces.len()];
    let mut stack: Vec<u32> = Vec::new();
    let mut steps = 0;
    for seed in 0..faces.len() {
        if state[seed] != 0 {
            continue;
        }
        state[seed] = SEEN;
        stack.push(seed as u32);
        while let Some(f) = stack.pop() {
            work.look(steps)?;
            steps += 1;
            let f = f as usize;
            for &entry in &across[3 * f..3 * f + 3] {
                let g = (entry >> 1) as usize;
                if entry != NONE && state[g] == 0 {
                    state[g] = SEEN | (state[f] & REVERSED) ^ (entry & 1) as u8;
                    stack.push(g as u32);
                }
            }
        }
    }
    for (f, state) in faces.iter_mut().zip(state) {
        if state & REVERSED != 0 {
            f.swap(1, 2);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::edges::edge_census;
    use super::super::work::Work;
    use crate::cancel::Cancel;
    use crate::memory::MemoryBudget;

    fn orient(vertex_count: usize, faces: &mut [[u32; 3]]) {
        let memory = MemoryBudget::unlimited().reservation();
        let cancel = Cancel::new();
        let work = Work {
            cancel: &cancel,
            memory: &memory,
        };
        super::orient(vertex_count, faces, &work).unwrap();
    }

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
