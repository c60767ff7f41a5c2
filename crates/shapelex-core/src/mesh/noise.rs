//! Merging copies of a vertex that differ in the last digits of the file.

use super::MeshError;
use super::boundary::distance;
use super::edges::{EdgeCounts, count_edges};
use super::weld::{Welded, weld};
use super::work::{Watch, Work};

/// Copies that are each off by one step in either direction lie two apart; a little more is for rounding.
const STEPS: f64 = 2.001;

/// The tolerance is at most this share of the median edge.
const OF_MEDIAN_EDGE: f64 = 0.1;

/// Share of the edges that must be borders for a mesh to be looked at.
const TORN: f64 = 0.01;

/// Share of the faces that may lose a corner.
const LOST: f64 = 0.01;

/// Share of the irregular edges that may be left.
const LEFT: f64 = 0.5;

/// Merges vertices within about two steps of the file's last digit where the faces fit together much better then, and
/// returns the tolerance; `None` where the mesh stays as it is.
///
/// A program that writes each triangle on its own, from coordinates that were rounded along different ways, leaves copies
/// of a vertex that differ in the last digit. The tolerance is at most a tenth of the median edge. It is taken where at
/// least 1 % of the edges are borders, half of the edges that are borders or have more than two faces are ordinary
/// ones afterwards, and at most 1 % of the faces lose a corner: close sheets, open boundaries and small details stay.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn weld_noise(
    vertices: &mut Vec<[f64; 3]>,
    faces: &mut [[u32; 3]],
    step: f64,
    work: Work,
) -> Result<Option<f64>, MeshError> {
    if !(step > 0.0 && step.is_finite()) {
        return Ok(None);
    }
    let before = count_edges(vertices.len(), faces, work)?;
    if (before.boundary as f64) < TORN * before.edges as f64 {
        return Ok(None);
    }
    let within = (STEPS * step).min(OF_MEDIAN_EDGE * median_edge(vertices, faces, work)?);
    let _copies = (work.hold(vertices.len(), 24)?, work.hold(faces.len(), 12)?);
    let mut copy = Vec::with_capacity(vertices.len());
    for (i, p) in vertices.iter().enumerate() {
        work.look(i)?;
        copy.push(*p);
    }
    let Welded {
        vertices: merged,
        index,
    } = weld(copy, within, work)?;
    if merged.len() == vertices.len() {
        return Ok(None);
    }
    let mut joined = Vec::with_capacity(faces.len());
    let mut lost = 0;
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        let g = f.map(|v| index[v as usize]);
        if has_three_corners(&g) {
            joined.push(g);
        } else {
            lost += usize::from(has_three_corners(f));
        }
    }
    let after = count_edges(merged.len(), &joined, work)?;
    let irregular = |c: &EdgeCounts| (c.boundary + c.non_manifold) as f64;
    if lost as f64 > LOST * faces.len() as f64 || irregular(&after) > LEFT * irregular(&before) {
        return Ok(None);
    }
    *vertices = merged;
    for f in faces.iter_mut() {
        *f = f.map(|v| index[v as usize]);
    }
    Ok(Some(within))
}

fn has_three_corners(f: &[u32; 3]) -> bool {
    f[0] != f[1] && f[1] != f[2] && f[2] != f[0]
}

/// The median length of the faces' edges, rounded down by less than an eighth. A histogram over exponents and the first
/// three bits after the point: the order of the faces does not matter.
fn median_edge(vertices: &[[f64; 3]], faces: &[[u32; 3]], work: Work) -> Result<f64, MeshError> {
    const SHIFT: u32 = 49;
    let mut counts = vec![0usize; 1 << (64 - SHIFT)];
    let mut total = 0;
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        for k in 0..3 {
            let length = distance(&vertices[f[k] as usize], &vertices[f[(k + 1) % 3] as usize]);
            if length > 0.0 {
                counts[(length.to_bits() >> SHIFT) as usize] += 1;
                total += 1;
            }
        }
    }
    let mut below = 0;
    for (bits, count) in counts.iter().enumerate() {
        below += count;
        if 2 * below >= total && total > 0 {
            return Ok(f64::from_bits((bits as u64) << SHIFT));
        }
    }
    Ok(0.0)
}
