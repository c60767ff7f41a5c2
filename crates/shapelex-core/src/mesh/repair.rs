//! Taking slivers out of a mesh without opening it.
//!
//! A face with three different vertices and no area still joins its neighbours: programs write such *caps* where a vertex
//! of one face lies on the edge of another. To drop one slits the surface open. Here the caps of one line are taken out
//! together, and the faces beside them are split at their vertices ([`line`](super::line)); a *needle* is closed by merging
//! the two ends of its shortest edge.

use super::MeshError;
use super::patch::{MOST_FACES, Outcome, Patch};
use super::sliver::{Shape, shape};
use super::trimesh::face_area;
use super::work::{Watch, Work};

/// Slivers left by one round are found anew in the next.
const ROUNDS: usize = 8;

/// Where slivers hold more than this share of the area they are the shape.
const MOST_AREA: f64 = 1e-3;

/// What [`repair`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Repaired {
    /// Slivers whose vertices were joined to the faces around.
    pub joined: usize,
    /// Slivers that joined nothing and were taken out.
    pub loose: usize,
}

/// Indices of the faces that are slivers; of none where there are too many to be taken out, or where they are the shape
/// itself. Faces with a repeated vertex are not among them.
pub(super) fn slivers(vertices: &[[f64; 3]], faces: &[[u32; 3]], work: Work) -> Result<Vec<u32>, MeshError> {
    let mut found = Vec::new();
    let (mut thin, mut total) = (0.0, 0.0);
    for (i, f) in faces.iter().enumerate() {
        work.look(i)?;
        if f[0] == f[1] || f[1] == f[2] || f[2] == f[0] {
            continue;
        }
        let area = face_area(vertices, f);
        total += area;
        if shape(vertices, f).0 != Shape::Sound {
            thin += area;
            found.push(i as u32);
            if found.len() > MOST_FACES {
                return Ok(Vec::new());
            }
        }
    }
    if thin > MOST_AREA * total {
        found.clear();
    }
    Ok(found)
}

/// Takes slivers out, given that there are some; no face may have a repeated vertex or be there twice. Faces keep their
/// order; of those that are split the second half comes at the end.
///
/// Where a surface was closed it stays so, and where it was a manifold as well, if that is possible at all: modulo 2 the
/// edges of one face stay the same. A sliver whose removal would fold a face with an area onto another stays, and so do
/// all where more than half a million faces touch them, or where vertices of many faces would make it slow; what has no area
/// of these is closed by merging corners ([`merge_lost`](super::lost::merge_lost)). The order of vertices and faces does not matter: slivers are taken by length
/// and place.
///
/// # Errors
/// [`MeshError::Cancelled`], [`MeshError::Memory`].
pub(super) fn repair(
    vertices: &[[f64; 3]],
    faces: &mut Vec<[u32; 3]>,
    work: Work,
) -> Result<Repaired, MeshError> {
    let mut left = slivers(vertices, faces, work)?;
    let found = left.len();
    let mut loose = 0;
    for _ in 0..ROUNDS {
        if left.is_empty() {
            break;
        }
        let Some(mut patch) = Patch::around(vertices, faces, &left, work)? else {
            break;
        };
        let mut steps = 0;
        patch.run(|outcome| {
            steps += 1;
            if let Outcome::Loose { faces } = outcome {
                loose += faces;
            }
        })?;
        patch.finish(faces);
        left = slivers(vertices, faces, work)?;
        if steps == 0 {
            break;
        }
    }
    Ok(Repaired {
        joined: found.saturating_sub(loose + left.len()),
        loose,
    })
}
