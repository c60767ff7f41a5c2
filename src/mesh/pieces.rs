//! The first reduction of a large mesh, piece by piece.

use super::clean::{Cleaned, drop_unreferenced};
use super::decimate::{ANY_ERROR, single_precision};
use super::tangle::pairs;
use crate::cancel::{Cancel, Cancelled};
use meshopt::{SimplifyOptions, simplify_decoder};
use rayon::prelude::*;

/// Faces of a piece: its edges' quadrics fit the second-level cache, and it is done within some milliseconds.
const PIECE: usize = 16_384;
/// Meshes of fewer pieces than this are collapsed as a whole.
const FEWEST: usize = 4;
/// Share of a piece's faces that a round leaves.
const KEPT: f64 = 0.25;
/// A round leaves at least this many times the faces that are wanted in the end, so that the collapses that shape the
/// result are chosen on the whole mesh.
const RESERVE: f64 = 4.0;
/// A round that would leave more than this share does not pay.
const WORTHWHILE: f64 = 0.6;
/// A piece with more [`pairs`] of faces at its vertices stays as it is: it would take longer than some ten milliseconds.
const MOST_PAIRS: u64 = 10_000_000;

/// Reduces a mesh of many faces, whose faces lie along a curve, towards `faces` faces, and stops well above.
///
/// A round cuts the faces into runs of neighbours and collapses edges within each; what lies on a run's border stays. The
/// next round's runs are longer, so their borders are elsewhere. Pieces are independent: they are worked on in parallel,
/// the result does not depend on the number of threads, and a cancelled one waits for no more than a piece.
///
/// False where a round hardly helps and many faces are left: almost all edges are borders or places where collapses are
/// not possible.
pub(super) fn collapse_in_pieces(
    mesh: &mut Cleaned,
    faces: usize,
    options: SimplifyOptions,
    cancel: &Cancel,
) -> Result<bool, Cancelled> {
    while mesh.faces.len() >= FEWEST * PIECE {
        let before = mesh.faces.len();
        let kept = (RESERVE * faces as f64 / before as f64).max(KEPT);
        if kept > WORTHWHILE {
            return Ok(true);
        }
        let pieces = mesh
            .faces
            .par_chunks(before.div_ceil(before / PIECE))
            .map(|piece| {
                cancel.check()?;
                Ok(collapse_piece(&mesh.vertices, piece, kept, options))
            })
            .collect::<Result<Vec<_>, Cancelled>>()?;
        mesh.faces = pieces.concat();
        drop_unreferenced(&mut mesh.vertices, &mut mesh.faces);
        if mesh.faces.len() as f64 > WORTHWHILE * before as f64 {
            return Ok(mesh.faces.len() < FEWEST * PIECE);
        }
    }
    Ok(true)
}

/// Collapses edges inside a run of faces until a share `kept` of them is left or no collapse is possible.
fn collapse_piece(
    vertices: &[[f64; 3]],
    piece: &[[u32; 3]],
    kept: f64,
    options: SimplifyOptions,
) -> Vec<[u32; 3]> {
    let mut used: Vec<u32> = piece.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    // Every corner is among `used`.
    let place = |v: &u32| used.binary_search(v).unwrap_or_default() as u32;
    let indices: Vec<u32> = piece.as_flattened().iter().map(place).collect();
    if pairs(used.len(), &indices) > MOST_PAIRS {
        return piece.to_vec();
    }
    let corners: Vec<[f64; 3]> = used.iter().map(|&v| vertices[v as usize]).collect();
    let target = (kept * piece.len() as f64) as usize;
    let options = options | SimplifyOptions::LockBorder;
    let result = simplify_decoder(
        &indices,
        &single_precision(&corners),
        3 * target,
        ANY_ERROR,
        options,
        None,
    );
    result
        .chunks_exact(3)
        .map(|f| [f[0], f[1], f[2]].map(|v| used[v as usize]))
        .collect()
}
