//! Vertex clustering, the last resort of the simplification.

use super::MeshError;
use super::clean::Cleaned;
use super::grid::{COARSEST_GRID, FINEST_GRID, finest_grid};
use super::library::{adopt, single_precision};
use super::work::{Watch, Work};
use meshopt::simplify_sloppy_decoder;

/// A mesh is first brought to this many times the size on a grid of our own, so that the library's calls are short.
const COARSE: usize = 16;

/// Faces that the library is given: one call takes some tens of milliseconds.
const MOST_FACES: usize = 600_000;

/// Faces for each vertex of the size up to which that also holds for large sizes, whose surfaces have that many.
const FACES_OF_SURFACE: usize = 64;

/// Faces of the result for each vertex of the size. A surface has two; a random complex may have any number, which the
/// operators would have to be assembled from.
const FACES_LEFT: usize = 300;

/// Bytes that a call of the library takes for each vertex and for each face.
const CALL_BYTES: [usize; 2] = [100, 60];

/// Vertex clustering on the finest grid that leaves at most `size` vertices. Where a complex has far more faces than a
/// surface of that many vertices the grid is coarser.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn cluster(mesh: &mut Cleaned, size: usize, work: Work) -> Result<(), MeshError> {
    if mesh.faces.len() > MOST_FACES && mesh.vertices.len() > COARSE * size {
        finest_grid(&mesh.vertices, COARSE * size, work)?.apply(mesh, work)?;
    }
    if mesh.faces.len() <= MOST_FACES.max(FACES_OF_SURFACE * size) {
        return cluster_by_quadrics(mesh, size, work);
    }
    let mut grid = finest_grid(&mesh.vertices, size, work)?;
    grid.apply(mesh, work)?;
    while let Some(coarser) = grid.coarser()
        && mesh.faces.len() > FACES_LEFT * size
    {
        grid = coarser;
        grid.apply(mesh, work)?;
    }
    Ok(())
}

/// Clustering by the library, which keeps the vertex of the least quadric error in each cell.
///
/// The library is asked for faces, of which a vertex may have any number here; so it is given the grid, as the error,
/// and the grid is searched for. A surface fills some four times the square of the cells along a side.
fn cluster_by_quadrics(mesh: &mut Cleaned, size: usize, work: Work) -> Result<(), MeshError> {
    let _held = (
        work.hold(mesh.vertices.len(), CALL_BYTES[0])?,
        work.hold(mesh.faces.len(), CALL_BYTES[1])?,
    );
    let positions = single_precision(&mesh.vertices);
    let mut best = Vec::new();
    let mut cells = ((size as f64 / 4.0).sqrt() as usize).clamp(COARSEST_GRID, FINEST_GRID);
    let (mut fits, mut exceeds) = (COARSEST_GRID - 1, FINEST_GRID + 1);
    while exceeds - fits > 1 {
        work.check()?;
        // The inverse, rounded down, is the number of cells. No faces are asked for, which every grid meets.
        let error = 1.0 / (cells as f32 + 0.5);
        let result = simplify_sloppy_decoder(mesh.faces.as_flattened(), &positions, 0, error, None);
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
    adopt(mesh, &best, work)
}

/// How many of `n` vertices an index list names.
fn distinct(indices: &[u32], n: usize) -> usize {
    let mut seen = vec![false; n];
    indices
        .iter()
        .filter(|&&v| !std::mem::replace(&mut seen[v as usize], true))
        .count()
}
