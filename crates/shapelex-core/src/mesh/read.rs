//! One entrance for every format.

use super::{
    Format, Limits, MeshError, Pose, ReadContext, Source, TriangleSoup, detect, gltf, obj, off, ply, stl,
};

/// Reads one mesh: every mesh of an OBJ file or of a glTF's default scene merged into one, a skinned or morphing one
/// in its resting pose (see [`super::gltf`]).
///
/// Vertices keep the file's order except where a format's reader says otherwise. Errors: every [`MeshError`] but
/// [`MeshError::TooSmall`], [`MeshError::Degenerate`] and [`MeshError::NoAnimation`]. Hostile bytes end in an error,
/// never in a panic or in an allocation beyond `limits`.
pub fn read(source: &Source<'_>, limits: &Limits) -> Result<(Format, TriangleSoup), MeshError> {
    read_within(source, &limits.into())
}

/// As [`read`], within the memory of a request and until it is stopped.
///
/// Errors: those of [`read`], [`MeshError::Memory`] and [`MeshError::Cancelled`].
pub fn read_within(source: &Source<'_>, context: &ReadContext) -> Result<(Format, TriangleSoup), MeshError> {
    let format = format_of(source, &context.limits)?;
    let soup = guarded(format, || match format {
        Format::Obj => obj::read(source.bytes, context),
        Format::Gltf | Format::Glb => gltf::read(source, format, context),
        Format::Ply => ply::read(source.bytes, context),
        Format::Stl => stl::read(source.bytes, context),
        Format::Off => off::read(source.bytes, context),
    })?;
    Ok((format, soup))
}

/// Samples `poses` poses of an animated glTF, spread evenly over its clips (see [`super::gltf::read_poses`]). A file
/// without animation, of whatever format, is refused with [`MeshError::NoAnimation`].
///
/// Errors as for [`read`], and [`MeshError::TooLarge`] for more poses than the limit or more vertices in all of them
/// together than four times the limit of one mesh.
pub fn read_poses(
    source: &Source<'_>,
    poses: usize,
    limits: &Limits,
) -> Result<(Format, Vec<Pose>), MeshError> {
    read_poses_within(source, poses, &limits.into())
}

/// As [`read_poses`], within the memory of a request and until it is stopped.
///
/// Errors: those of [`read_poses`], [`MeshError::Memory`] and [`MeshError::Cancelled`].
pub fn read_poses_within(
    source: &Source<'_>,
    poses: usize,
    context: &ReadContext,
) -> Result<(Format, Vec<Pose>), MeshError> {
    let format = format_of(source, &context.limits)?;
    context.limits.check_poses(poses)?;
    let poses = guarded(format, || match format {
        Format::Gltf | Format::Glb => gltf::read_poses(source, format, poses, context),
        Format::Obj | Format::Ply | Format::Stl | Format::Off => Err(MeshError::NoAnimation),
    })?;
    Ok((format, poses))
}

fn format_of(source: &Source<'_>, limits: &Limits) -> Result<Format, MeshError> {
    limits.check_bytes(source.bytes.len())?;
    detect::detect(source.bytes, source.media_type, source.name)
}

/// Runs a reader so that a panic inside a third-party parser is one more malformed file.
fn guarded<T>(format: Format, reader: impl FnOnce() -> Result<T, MeshError>) -> Result<T, MeshError> {
    // The readers own everything they change, so nothing half-changed can be seen after a panic.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(reader))
        .unwrap_or_else(|_| Err(MeshError::malformed(format, "the parser gave up on it")))
}
