//! One entrance for every format.

use super::{Format, Limits, MeshError, TriangleSoup};

/// A file that came with another one in the same upload, such as a glTF's `.bin`.
#[derive(Clone, Debug)]
pub struct Companion {
    /// The name it was sent under, matched against the URI that refers to it.
    pub name: String,
    /// Its contents.
    pub bytes: Vec<u8>,
}

/// A mesh file as it arrived.
#[derive(Clone, Copy, Debug, Default)]
pub struct Source<'a> {
    /// The file's contents.
    pub bytes: &'a [u8],
    /// The file's name, if known: the last resort for telling its format.
    pub name: Option<&'a str>,
    /// The declared media type, if any: asked after the bytes and before the name.
    pub media_type: Option<&'a str>,
    /// Other files of the same upload.
    pub companions: &'a [Companion],
}

/// One pose of an animated file.
#[derive(Clone, Debug)]
pub struct Pose {
    /// Clip and moment, for people: `Gallop@0.50`.
    pub label: String,
    /// The mesh in this pose.
    pub soup: TriangleSoup,
}

/// Reads one mesh: every mesh of an OBJ file or of a glTF's default scene merged into one, in bind pose.
pub fn read(_source: &Source<'_>, _limits: &Limits) -> Result<(Format, TriangleSoup), MeshError> {
    Err(MeshError::UnknownFormat)
}

/// Samples `poses` poses of an animated glTF, spread evenly over its clips. A file without animation is refused with
/// [`MeshError::NoAnimation`].
pub fn read_poses(
    _source: &Source<'_>,
    _poses: usize,
    _limits: &Limits,
) -> Result<(Format, Vec<Pose>), MeshError> {
    Err(MeshError::NoAnimation)
}
