//! Simplification to the working size by quadric error (Garland and Heckbert 1997), with meshoptimizer.

use super::clean::{Cleaned, clean_again, drop_unreferenced};
use super::locality::order_along_curve;
use super::orient::orient;
use super::pieces::collapse_in_pieces;
use super::tangle::{MOST_PAIRS, is_tangle, pairs};
use super::{Components, MeshError};
use crate::cancel::{Cancel, Cancelled};
use meshopt::{SimplifyOptions, simplify_decoder, simplify_sloppy_decoder};

/// How a mesh came to its working size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Simplified {
    /// It was small enough already.
    No,
    /// By edge collapses that keep the topology.
    ByCollapse,
    /// Non-manifold places had to be collapsed across.
    AcrossTopology,
    /// Collapses did not suffice; vertices were clustered on a grid, which may change the topology.
    ByClustering,
}

/// Rounds of collapses at most; each starts from the last one's result.
const ROUNDS: usize = 20;

/// The first round of collapses aims at this many times the working size.
const MARGIN: f64 = 1.1;

/// Larger meshes do not fit the cache, so it pays to bring neighbours together first.
const OUT_OF_CACHE: usize = 20_000;

/// The coarsest grid that keeps a face has eight cells, and one vertex for each.
const SMALLEST: usize = 8;

/// Cells along the longest side of the grids that clustering tries; one cell keeps no face, the library's limit is 1025.
const COARSEST_GRID: usize = 2;
const FINEST_GRID: usize = 1000;

/// No bound on the error: the target is a size.
pub(super) const ANY_ERROR: f32 = 1e3;

/// Reduces a mesh to at most `working_size` vertices (less than 8 count as 8); 0 leaves it as it is. Near-linear in the
/// number of faces.
///
/// The result's vertices are a subset of the input's, at their full precision; only the choice of collapses is made
/// in single precision, within the mesh's unit frame. Collapses first keep to the topology, then go across
/// non-manifold places, and as the last resort vertices are clustered on a grid. Borders are free to move
/// along themselves. Light regularisation keeps flat regions from being reduced to slivers, on which the piecewise
/// linear Laplacian is poor: on three real meshes taken from 3400–4000 to 1500–2000 vertices the first 20 eigenvalues
/// are then off by 0.7–0.8 % on average, against 2.1–3.7 % without and 0.9–1.3 % with full regularisation, which also
/// loses 1–1.5 % of the area. The result is cleaned again. A mesh whose neighbouring faces do not all run
/// the same way (not `oriented`) is oriented first.
///
/// Errors: [`MeshError::NotSimplified`] when no face with an area would be left; [`MeshError::Cancelled`].
pub(super) fn simplify_to(
    mesh: &mut Cleaned,
    working_size: usize,
    keep: Components,
    oriented: bool,
    cancel: &Cancel,
) -> Result<Simplified, MeshError> {
    if working_size == 0 {
        return Ok(Simplified::No);
    }
    let before = mesh.vertices.len();
    let size = working_size.max(SMALLEST);
    if before <= size {
        return Ok(Simplified::No);
    }
    cancel.check()?;
    if before > OUT_OF_CACHE {
        order_along_curve(&mut mesh.vertices, &mut mesh.faces);
        cancel.check()?;
    }
    if !oriented {
        orient(mesh.vertices.len(), &mut mesh.faces);
        cancel.check()?;
    }
    let tidy = |mesh: &mut Cleaned| match clean_again(mesh, keep, cancel) {
        Err(MeshError::Degenerate) => Err(MeshError::NotSimplified {
            vertices: before,
            size,
        }),
        other => other,
    };
    let steps = [
        (SimplifyOptions::RegularizeLight, Simplified::ByCollapse),
        (
            SimplifyOptions::RegularizeLight | SimplifyOptions::Permissive,
            Simplified::AcrossTopology,
        ),
    ];
    for (options, outcome) in steps {
        let reduced = collapse_in_pieces(mesh, 2 * size, options, cancel)?;
        // On a large tangle, a random complex say, collapses over the whole would take minutes.
        if !reduced && is_tangle(mesh.vertices.len(), &mesh.faces) {
            continue;
        }
        collapse(mesh, size, options, cancel)?;
        tidy(mesh)?;
        if mesh.vertices.len() <= size {
            return Ok(outcome);
        }
    }
    cluster(mesh, size, cancel)?;
    tidy(mesh)?;
    Ok(Simplified::ByClustering)
}

/// Edge collapses until at most `size` vertices are left or no collapse is possible, or a hub makes them too slow.
///
/// The library counts faces, we count vertices. A collapse inside takes two faces with its vertex, one on a border a
/// single face, a face on its own has three vertices, and how many of each there will be is not known. So the first
/// round, which does the work, aims a tenth above the size, and the later ones approach it with the measured faces per
/// vertex.
fn collapse(
    mesh: &mut Cleaned,
    size: usize,
    options: SimplifyOptions,
    cancel: &Cancel,
) -> Result<(), Cancelled> {
    let mut faces_per_vertex = 2.0;
    for round in 0..ROUNDS {
        let (v, f) = (mesh.vertices.len(), mesh.faces.len());
        if v <= size {
            return Ok(());
        }
        cancel.check()?;
        let excess = (v - size) as f64;
        let coarse = MARGIN * size as f64 * (f as f64 / v as f64).max(2.0);
        let target = if round == 0 && coarse < f as f64 {
            coarse as usize
        } else {
            f.saturating_sub((0.9 * faces_per_vertex * excess).ceil() as usize)
        };
        let indices: Vec<u32> = mesh.faces.iter().flatten().copied().collect();
        if pairs(v, &indices) > MOST_PAIRS {
            return Ok(());
        }
        let result = simplify_decoder(
            &indices,
            &single_precision(&mesh.vertices),
            3 * target,
            ANY_ERROR,
            options,
            None,
        );
        if result.is_empty() || result.len() == indices.len() {
            return Ok(());
        }
        adopt(mesh, &result);
        let removed = (v - mesh.vertices.len()).max(1);
        faces_per_vertex = ((f - mesh.faces.len()) as f64 / removed as f64).clamp(1.0 / 3.0, 2.0);
    }
    Ok(())
}

/// Vertex clustering on the finest grid that leaves at most `size` vertices.
///
/// The library is asked for faces, of which a vertex may have any number here; so it is given the grid, as the error,
/// and the grid is searched for. A surface fills some four times the square of the cells along a side.
fn cluster(mesh: &mut Cleaned, size: usize, cancel: &Cancel) -> Result<(), Cancelled> {
    let indices: Vec<u32> = mesh.faces.iter().flatten().copied().collect();
    let positions = single_precision(&mesh.vertices);
    let mut best = Vec::new();
    let mut cells = ((size as f64 / 4.0).sqrt() as usize).clamp(COARSEST_GRID, FINEST_GRID);
    let (mut fits, mut exceeds) = (COARSEST_GRID - 1, FINEST_GRID + 1);
    while exceeds - fits > 1 {
        cancel.check()?;
        // The inverse, rounded down, is the number of cells. No faces are asked for, which every grid meets.
        let error = 1.0 / (cells as f32 + 0.5);
        let result = simplify_sloppy_decoder(&indices, &positions, 0, error, None);
        if distinct(&result, positions.len()) <= size {
            best = result;
            fits = cells;
        } else {
            exceeds = cells;
        }
        cells = if exceeds > FINEST_GRID {
            (2 * cells).min(FINEST_GRID)
        } else {
            fits.midpoint(exceeds)
        };
    }
    adopt(mesh, &best);
    Ok(())
}

/// How many of `n` vertices an index list names.
fn distinct(indices: &[u32], n: usize) -> usize {
    let mut seen = vec![false; n];
    indices
        .iter()
        .filter(|&&v| !std::mem::replace(&mut seen[v as usize], true))
        .count()
}

pub(super) fn single_precision(vertices: &[[f64; 3]]) -> Vec<[f32; 3]> {
    vertices.iter().map(|p| p.map(|x| x as f32)).collect()
}

/// Takes an index list over the mesh's own vertices as its faces.
fn adopt(mesh: &mut Cleaned, indices: &[u32]) {
    mesh.faces = indices.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
    drop_unreferenced(&mut mesh.vertices, &mut mesh.faces);
}
