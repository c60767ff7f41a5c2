//! The first reduction of a large mesh, piece by piece.

use super::MeshError;
use super::clean::{Cleaned, drop_unreferenced};
use super::library::{ANY_ERROR, COLLAPSE_BYTES, single_precision};
use super::tangle::pairs;
use super::work::{Watch, Work};
use meshopt::{SimplifyOptions, simplify_decoder, simplify_with_locks_decoder};
use rayon::prelude::*;

/// Faces of a piece: its edges' quadrics fit the second-level cache, and it is done within some milliseconds.
pub(super) const PIECE: usize = 16_384;
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

/// What becomes of the edges of one face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Borders {
    /// They stay.
    Kept,
    /// They are collapsed along themselves, as on the whole mesh; only vertices that other pieces share stay.
    Collapsed,
}

/// Reduces a mesh of many faces, whose faces lie along a curve, towards `faces` faces, and stops well above.
///
/// A round cuts the faces into runs of neighbours and collapses edges within each; what lies on a run's border stays. The
/// next round's runs are longer, so their borders are elsewhere. Pieces are independent: they are worked on in parallel,
/// the result does not depend on the number of threads, and a cancelled one waits for no more than a piece.
///
/// False where a round hardly helps and many faces are left: almost all edges are borders or places where collapses are
/// not possible.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn collapse_in_pieces(
    mesh: &mut Cleaned,
    faces: usize,
    options: SimplifyOptions,
    borders: Borders,
    work: Work,
) -> Result<bool, MeshError> {
    while mesh.faces.len() >= FEWEST * PIECE {
        let before = mesh.faces.len();
        let kept = (RESERVE * faces as f64 / before as f64).max(KEPT);
        if kept > WORTHWHILE {
            return Ok(true);
        }
        // The pieces' results, and their union.
        let _held = (
            work.hold(before, 2 * 12)?,
            work.hold(
                rayon::current_num_threads() * 2 * PIECE,
                COLLAPSE_BYTES[0] + COLLAPSE_BYTES[1],
            )?,
        );
        let length = before.div_ceil(before / PIECE);
        let shared = match borders {
            Borders::Kept => Vec::new(),
            Borders::Collapsed => shared_vertices(mesh, length, work)?,
        };
        let pieces = mesh
            .faces
            .par_chunks(length)
            .map(|piece| {
                work.check()?;
                Ok(collapse_piece(&mesh.vertices, piece, kept, options, &shared))
            })
            .collect::<Result<Vec<_>, MeshError>>()?;
        mesh.faces = pieces.concat();
        drop(pieces);
        drop_unreferenced(&mut mesh.vertices, &mut mesh.faces, work)?;
        if mesh.faces.len() as f64 > WORTHWHILE * before as f64 {
            return Ok(mesh.faces.len() < FEWEST * PIECE);
        }
    }
    Ok(true)
}

/// For each vertex whether faces of more than one run of `length` faces use it.
fn shared_vertices(mesh: &Cleaned, length: usize, work: Work) -> Result<Vec<bool>, MeshError> {
    const NONE: u32 = u32::MAX;
    let _held = work.hold(mesh.vertices.len(), 4 + 1)?;
    let mut piece_of = vec![NONE; mesh.vertices.len()];
    let mut shared = vec![false; mesh.vertices.len()];
    for (i, f) in mesh.faces.iter().enumerate() {
        work.look(i)?;
        let piece = (i / length) as u32;
        for &v in f {
            let known = &mut piece_of[v as usize];
            shared[v as usize] |= *known != NONE && *known != piece;
            *known = piece;
        }
    }
    Ok(shared)
}

/// Collapses edges inside a run of faces until a share `kept` of them is left or no collapse is possible. Where `shared`
/// is empty all borders of the run stay, otherwise only vertices it flags.
fn collapse_piece(
    vertices: &[[f64; 3]],
    piece: &[[u32; 3]],
    kept: f64,
    options: SimplifyOptions,
    shared: &[bool],
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
    let positions = single_precision(&corners);
    let target = 3 * (kept * piece.len() as f64) as usize;
    let result = if shared.is_empty() {
        let options = options | SimplifyOptions::LockBorder;
        simplify_decoder(&indices, &positions, target, ANY_ERROR, options, None)
    } else {
        let locks: Vec<bool> = used.iter().map(|&v| shared[v as usize]).collect();
        simplify_with_locks_decoder(&indices, &positions, &locks, target, ANY_ERROR, options, None)
    };
    result
        .chunks_exact(3)
        .map(|f| [f[0], f[1], f[2]].map(|v| used[v as usize]))
        .collect()
}
