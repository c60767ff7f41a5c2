//! Simplification to the working size by quadric error (Garland and Heckbert 1997), with meshoptimizer.

use super::clean::{Cleaned, clean_again};
use super::cluster::cluster;
use super::edges::{EdgeCounts, count_edges};
use super::library::{ANY_ERROR, COLLAPSE_BYTES, adopt, single_precision};
use super::locality::order_along_curve;
use super::orient::orient;
use super::pieces::{Borders, PIECE, collapse_in_pieces};
use super::report::Simplified;
use super::tangle::{MOST_PAIRS, is_no_surface, is_tangle, pairs};
use super::work::{Watch, Work};
use super::{MeshError, PrepareOptions};
use meshopt::{SimplifyOptions, simplify_decoder};

/// What [`simplify_to`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reduction {
    /// How the mesh came to its size.
    pub how: Simplified,
    /// Share of the area that came apart and was left out, 0 to 1.
    pub torn_off: f64,
}

/// Rounds of collapses at most; each starts from the last one's result.
const ROUNDS: usize = 20;

/// The first round of collapses aims at this many times the working size.
const MARGIN: f64 = 1.1;

/// Larger meshes do not fit the cache, so it pays to bring neighbours together first.
const OUT_OF_CACHE: usize = 20_000;

/// The coarsest grid that keeps a face has eight cells, and one vertex for each.
const SMALLEST: usize = 8;

/// Faces of a mesh that is collapsed as a whole although pieces of it could not be: more would take longer than some tens
/// of milliseconds.
const MOST_AS_A_WHOLE: usize = 8 * PIECE;

/// Reduces a mesh to at most `working_size` vertices (less than 8 count as 8); 0 leaves it as it is. Near-linear in the
/// number of faces. `edges` are those of the mesh.
///
/// The result's vertices are a subset of the input's, at their full precision; only the choice of collapses is made
/// in single precision, within the mesh's unit frame. Collapses first keep to the topology, then go across
/// non-manifold places, and as the last resort vertices are clustered on a grid. Borders are free to move
/// along themselves. Light regularisation keeps flat regions from being reduced to slivers, on which the piecewise
/// linear Laplacian is poor: on three real meshes taken from 3400–4000 to 1500–2000 vertices the first 20 eigenvalues
/// are then off by 0.7–0.8 % on average, against 2.1–3.7 % without and 0.9–1.3 % with full regularisation, which also
/// loses 1–1.5 % of the area. The result is cleaned again. A mesh whose neighbouring faces do not all run
/// the same way is oriented first. A large one that is a surface hardly anywhere is clustered at once.
///
/// Errors: [`MeshError::NotSimplified`] when no face with an area would be left; [`MeshError::Cancelled`],
/// [`MeshError::Memory`].
pub(super) fn simplify_to(
    mesh: &mut Cleaned,
    options: &PrepareOptions,
    edges: &EdgeCounts,
    work: Work,
) -> Result<Reduction, MeshError> {
    let before = mesh.vertices.len();
    let size = options.working_size.max(SMALLEST);
    if options.working_size == 0 || before <= size {
        return Ok(Reduction::default());
    }
    let mut kept = 1.0;
    let mut tidy = |mesh: &mut Cleaned| match clean_again(mesh, options.components, work) {
        Ok(dropped) => {
            kept *= 1.0 - dropped;
            Ok(1.0 - kept)
        }
        Err(MeshError::Degenerate) => Err(MeshError::NotSimplified {
            vertices: before,
            size,
        }),
        Err(other) => Err(other),
    };
    let large = mesh.faces.len() >= MOST_AS_A_WHOLE;
    if !(large && is_no_surface(before, edges)) {
        if before > OUT_OF_CACHE {
            order_along_curve(&mut mesh.vertices, &mut mesh.faces, work)?;
        }
        if edges.inconsistent > 0 {
            orient(mesh.vertices.len(), &mut mesh.faces, &work)?;
        }
        for (options, how) in [
            (SimplifyOptions::RegularizeLight, Simplified::ByCollapse),
            (
                SimplifyOptions::RegularizeLight | SimplifyOptions::Permissive,
                Simplified::AcrossTopology,
            ),
        ] {
            if !reduce_in_pieces(mesh, 2 * size, options, work)? {
                continue;
            }
            collapse(mesh, size, options, work)?;
            let torn_off = tidy(mesh)?;
            if mesh.vertices.len() <= size {
                return Ok(Reduction { how, torn_off });
            }
        }
    }
    cluster(mesh, size, work)?;
    let torn_off = tidy(mesh)?;
    Ok(Reduction {
        how: Simplified::ByClustering,
        torn_off,
    })
}

/// Reduces a large mesh piece by piece. False where that does not bring it to a size at which collapses over the whole
/// are quick: on a large tangle, a random complex say, they would take minutes.
fn reduce_in_pieces(
    mesh: &mut Cleaned,
    faces: usize,
    options: SimplifyOptions,
    work: Work,
) -> Result<bool, MeshError> {
    if collapse_in_pieces(mesh, faces, options, Borders::Kept, work)? {
        return Ok(true);
    }
    if is_tangle(
        mesh.vertices.len(),
        &count_edges(mesh.vertices.len(), &mesh.faces, work)?,
    ) {
        return Ok(false);
    }
    if mesh.faces.len() <= MOST_AS_A_WHOLE {
        return Ok(true);
    }
    // A ribbon is all border.
    Ok(
        collapse_in_pieces(mesh, faces, options, Borders::Collapsed, work)?
            || mesh.faces.len() <= MOST_AS_A_WHOLE,
    )
}

/// Edge collapses until at most `size` vertices are left or no collapse is possible, or a hub makes them too slow.
///
/// The library counts faces, we count vertices. A collapse inside takes two faces with its vertex, one on a border a
/// single face, a face on its own has three vertices, and how many of each there will be is not known. So the first
/// round, which does the work, aims a tenth above the size, and the later ones approach it with the measured faces per
/// vertex.
fn collapse(mesh: &mut Cleaned, size: usize, options: SimplifyOptions, work: Work) -> Result<(), MeshError> {
    let mut faces_per_vertex = 2.0;
    for round in 0..ROUNDS {
        let (v, f) = (mesh.vertices.len(), mesh.faces.len());
        if v <= size {
            return Ok(());
        }
        work.check()?;
        let excess = (v - size) as f64;
        let coarse = MARGIN * size as f64 * (f as f64 / v as f64).max(2.0);
        let target = if round == 0 && coarse < f as f64 {
            coarse as usize
        } else {
            f.saturating_sub((0.9 * faces_per_vertex * excess).ceil() as usize)
        };
        if pairs(v, mesh.faces.as_flattened()) > MOST_PAIRS {
            return Ok(());
        }
        let _held = (work.hold(v, COLLAPSE_BYTES[0])?, work.hold(f, COLLAPSE_BYTES[1])?);
        let result = simplify_decoder(
            mesh.faces.as_flattened(),
            &single_precision(&mesh.vertices),
            3 * target,
            ANY_ERROR,
            options,
            None,
        );
        if result.is_empty() || result.len() == 3 * f {
            return Ok(());
        }
        adopt(mesh, &result, work)?;
        let removed = (v - mesh.vertices.len()).max(1);
        faces_per_vertex = ((f - mesh.faces.len()) as f64 / removed as f64).clamp(1.0 / 3.0, 2.0);
    }
    Ok(())
}
