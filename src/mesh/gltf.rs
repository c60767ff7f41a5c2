//! glTF 2.0, as JSON with buffers inside or beside it, and as GLB.
//!
//! The gltf crate parses the container and the JSON; what the JSON points to is followed here, step by step, because
//! an index, an offset or a count in an upload may be anything: every one is checked before it is used, and counts
//! before memory is asked for. Nothing is ever opened: a buffer is in the file or was sent with it.
//!
//! **Which pose is read.** A mesh without animation stands where the nodes put it. A skinned mesh is read in its
//! *resting pose*: each vertex follows its joints at the nodes' own transforms, which is what a viewer shows when no
//! clip plays (glTF 2.0, 3.7.3.3). Stored positions alone would not do: they are in the space the mesh had when it was
//! bound, which may differ from mesh to mesh of one body, and only joints × inverse bind matrices bring the parts
//! together. Where nodes rest exactly at the bind pose the two are the same up to a rigid motion and scale; in the
//! animals the tests use, edges differ by up to 5 % of their mean, and it is the resting pose that other software bakes
//! as the bind pose. Morph targets are applied with the default weights.

mod accessor;
mod animation;
mod document;
mod matrix;
mod primitive;
mod scene;

use super::{Format, MeshError, Pose, ReadContext, Source, TriangleSoup};
use animation::Clip;
use document::Document;
use scene::Scene;

/// Reads all triangles of the default scene (or the first, or all nodes where there is no scene) as one soup:
/// triangles, strips and fans; points and lines are passed over. Vertices are ordered by node, then as stored;
/// primitives that share their vertices share them here too.
///
/// Errors: [`MeshError::Unsupported`] names a required extension we do not read; [`MeshError::MissingBuffer`] a file
/// that was not sent along.
pub fn read(source: &Source<'_>, format: Format, context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let document = Document::open(source, format, &context.limits)?;
    let scene = Scene::open(&document)?;
    scene.build(&scene.nodes.rest())
}

/// Samples poses over all clips that move something, in the file's order: clip `i` of `A` gets the poses from
/// `⌊i·N/A⌋` to `⌊(i+1)·N/A⌋`, and `k` poses of one clip are taken in the middle of `k` equal parts of it, so that a
/// looping clip's equal ends never give the same pose twice. With fewer poses than clips, some clips get none.
///
/// Labels are `Clip@0.50`, the moment as a share of the clip.
pub fn read_poses(
    source: &Source<'_>,
    format: Format,
    poses: usize,
    context: &ReadContext,
) -> Result<Vec<Pose>, MeshError> {
    let limits = &context.limits;
    let document = Document::open(source, format, limits)?;
    let clips = Clip::list(&document)?;
    if clips.is_empty() {
        return Err(MeshError::NoAnimation);
    }
    let scene = Scene::open(&document)?;
    let all = scene.vertex_count().saturating_mul(poses);
    let limit = limits.max_vertices.saturating_mul(4);
    if all > limit {
        return Err(MeshError::TooLarge {
            what: "vertices in all poses",
            found: all,
            limit,
        });
    }
    let mut sampled = Vec::with_capacity(poses);
    for (i, clip) in clips.iter().enumerate() {
        let count = (i + 1) * poses / clips.len() - i * poses / clips.len();
        for j in 0..count {
            let moment = (j as f64 + 0.5) / count as f64;
            sampled.push(Pose {
                label: format!("{}@{moment:.2}", clip.name),
                soup: sample(&document, &scene, clip, moment)?,
            });
        }
    }
    Ok(sampled)
}

/// The scene at a moment, 0 to 1, of a clip.
fn sample(
    document: &Document<'_>,
    scene: &Scene<'_, '_>,
    clip: &Clip<'_>,
    moment: f64,
) -> Result<TriangleSoup, MeshError> {
    document.refill();
    let mut state = scene.nodes.rest();
    clip.apply(document, moment, &mut state)?;
    scene.build(&state)
}

#[cfg(test)]
mod tests;
