//! glTF 2.0, as JSON with buffers inside or beside it, and as GLB.
//!
//! The gltf crate gives the vocabulary; what the document points to is followed here, step by step, because an index,
//! an offset or a count in an upload may be anything: every one is checked before it is used, counts before memory is
//! asked for, and products of counts before the work is done ([`work`]). What has no shape is not looked at, so a slip
//! in a material, a camera or a name is no reason to refuse a mesh ([`schema`]). Nothing is ever opened: a buffer is in
//! the file or came with it.
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
mod buffers;
mod container;
mod document;
mod draco;
mod geometry;
mod influences;
mod list;
mod matrix;
mod meshopt;
mod nodes;
mod part;
mod scene;
mod schema;
mod skin;
mod uri;
mod used;
mod view;
mod work;

pub use uri::{BufferFiles, BufferUri, external_buffers};

use super::{Format, MeshError, Pose, ReadContext, Source, TriangleSoup};
use animation::{Clip, Tracks};
use container::Container;
use document::Document;
use scene::Scene;

/// Largest number of vertices, and of faces, in all poses of a file together, in meshes of the largest size.
const VERTICES_OF_MESHES: usize = 4;
const FACES_OF_MESHES: usize = 2;

/// Reads all triangles of the default scene (or the first, or all nodes where there is no scene) as one soup:
/// triangles, strips and fans; points and lines are passed over. Vertices are ordered by node, then as stored;
/// primitives that share their vertices share them here too, and vertices that no face uses are left out.
///
/// Errors: [`MeshError::Unsupported`] names a required extension we do not read; [`MeshError::MissingBuffer`] a file
/// that did not come along; [`MeshError::EmptyScene`] a scene without meshes.
pub fn read(source: &Source<'_>, format: Format, context: &ReadContext) -> Result<TriangleSoup, MeshError> {
    let mut copy = None;
    let container = open(source, format, context, &mut copy)?;
    let document = Document::open(&container, source, context)?;
    Scene::open(&document)?.into_soup()
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
    let mut copy = None;
    let container = open(source, format, context, &mut copy)?;
    let document = Document::open(&container, source, context)?;
    let clips = Clip::list(&document)?;
    if clips.is_empty() {
        return Err(MeshError::NoAnimation);
    }
    let scene = Scene::open(&document)?;
    check_poses(&scene, poses, context)?;
    let mut sampled = Vec::with_capacity(poses);
    for (i, clip) in clips.iter().enumerate() {
        let count = (i + 1) * poses / clips.len() - i * poses / clips.len();
        if count == 0 {
            continue;
        }
        let tracks = clip.tracks(&document)?;
        for j in 0..count {
            let moment = (j as f64 + 0.5) / count as f64;
            sampled.push(Pose {
                label: format!("{}@{moment:.2}", clip.name),
                soup: sample(&document, &scene, &tracks, moment)?,
            });
        }
    }
    Ok(sampled)
}

/// Takes a file apart; a copy of its text, where one is needed, is reserved in `copy`.
fn open<'a>(
    source: &Source<'a>,
    format: Format,
    context: &'a ReadContext,
    copy: &mut Option<crate::memory::Held<'a>>,
) -> Result<Container<'a>, MeshError> {
    Container::open(source.bytes, format, |bytes| {
        *copy = Some(context.memory.hold(bytes as u64)?);
        Ok(())
    })
}

/// Refuses poses that are too much together.
fn check_poses(scene: &Scene<'_, '_>, poses: usize, context: &ReadContext) -> Result<(), MeshError> {
    let limits = &context.limits;
    for (what, each, limit) in [
        (
            "vertices in all poses",
            scene.vertices,
            limits.max_vertices.saturating_mul(VERTICES_OF_MESHES),
        ),
        (
            "faces in all poses",
            scene.faces,
            limits.max_faces.saturating_mul(FACES_OF_MESHES),
        ),
    ] {
        let found = each.saturating_mul(poses);
        if found > limit {
            return Err(MeshError::TooLarge { what, found, limit });
        }
    }
    Ok(())
}

/// The scene at a moment, 0 to 1, of a clip.
fn sample(
    document: &Document<'_>,
    scene: &Scene<'_, '_>,
    tracks: &Tracks<'_>,
    moment: f64,
) -> Result<TriangleSoup, MeshError> {
    let mut state = scene.nodes.rest();
    tracks.apply(document, moment, &mut state)?;
    scene.build(&state)
}

#[cfg(test)]
mod tests;
