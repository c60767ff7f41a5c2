//! A mesh file as it was sent or stored, and the buffers a glTF finds beside it.

use super::problem::{Code, Problem};
use crate::model::ShapePose;
use bytes::Bytes;
use shapelex_core::cancel::Cancel;
use shapelex_core::memory::Reservation;
use shapelex_core::mesh::gltf::{BufferFiles, external_buffers};
use shapelex_core::mesh::{Companion, Format, Limits, MeshError, Pose, ReadContext, Source, TriangleSoup};
use std::sync::Arc;

/// A file of a request's body.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Its name, with folders only where it came out of an archive.
    pub name: String,
    /// Its path within the request, where a form gave it one: buffers are told apart by it.
    pub path: Option<String>,
    /// The declared media type.
    pub media_type: Option<String>,
    /// Its contents.
    pub bytes: Bytes,
    /// Whether it came out of an archive, where files that are no meshes are nothing unusual.
    pub packed: bool,
}

impl Part {
    /// Where it lies among the files of the request.
    pub(super) fn place(&self) -> &str {
        self.path.as_deref().unwrap_or(&self.name)
    }

    /// The folder it lies in, empty at the top.
    pub(super) fn folder(&self) -> &str {
        self.place().rsplit_once('/').map_or("", |(folder, _)| folder)
    }
}

/// The buffers of a request, and where each is found.
#[derive(Debug)]
pub(super) struct SentBuffers {
    files: Vec<Part>,
    index: BufferFiles,
}

impl SentBuffers {
    /// These files.
    pub(super) fn new(files: Vec<Part>) -> Self {
        let index = BufferFiles::new(files.iter().map(|file| (file.place(), !file.packed)));
        Self { files, index }
    }
}

/// The files a glTF may refer to.
#[derive(Clone, Debug)]
pub(super) enum Buffers {
    /// All buffers of the request, to be searched by name.
    Sent(Arc<SentBuffers>),
    /// Those of a stored shape, under the names the glTF uses.
    Stored(Vec<Companion>),
}

/// Which pose of a file is meant.
#[derive(Clone, Debug)]
pub(super) enum Posture {
    /// The file as it is: its resting pose.
    Resting,
    /// One of the poses that are sampled from its animations.
    Sampled {
        /// Which, from 0.
        index: usize,
        /// How many are sampled.
        of: usize,
    },
    /// A pose that was read already, together with the others of its file.
    Read(Arc<ReadPose>),
}

/// A pose in memory, where the poses of one file are ranked one after the other.
#[derive(Debug)]
pub(super) struct ReadPose {
    format: Format,
    pose: ShapePose,
    soup: TriangleSoup,
    /// Memory of the soup.
    _memory: Reservation,
}

/// A mesh file that was sent or stored, with its buffers.
#[derive(Clone, Debug)]
pub struct UploadedMesh {
    /// Its name, or `mesh` where it was sent without one.
    pub name: String,
    /// The declared media type, where it names a mesh format.
    pub media_type: Option<String>,
    /// Its contents.
    pub bytes: Bytes,
    /// Its path in the archive it came out of, every character kept.
    pub(super) member: Option<String>,
    /// The folder among the files of the request from which its buffers are searched.
    pub(super) folder: String,
    pub(super) buffers: Buffers,
    pub(super) posture: Posture,
    /// The memory of the request it came with.
    pub(super) memory: Arc<Reservation>,
}

/// A mesh that was read.
#[derive(Debug)]
pub(super) struct ReadMesh {
    pub(super) format: Format,
    /// Which pose of the file it is, where poses were asked for.
    pub(super) pose: Option<ShapePose>,
    pub(super) soup: TriangleSoup,
}

/// Bytes of the names of all buffers that one mesh refers to, at most.
const MAX_COMPANION_NAMES: usize = 64 << 10;

/// Bytes held per byte of the file while it is read, beside what the reader reserves for its arrays: small buffers and
/// the allocator's slack.
const READING_FACTOR: u64 = 1;

impl UploadedMesh {
    /// What reading it works within: the service's limits, until it is stopped, and memory for this step of the
    /// request's work.
    pub fn context(&self, limits: Limits, cancel: &Cancel) -> ReadContext {
        ReadContext {
            cancel: cancel.clone(),
            memory: Arc::new(self.memory.step()),
            ..ReadContext::new(limits)
        }
    }

    /// Reads it as one mesh, which stays reserved.
    ///
    /// # Errors
    /// The reader's; `mesh_too_large` or `overloaded` where memory is short.
    pub fn read(&self, context: &ReadContext) -> Result<(Format, TriangleSoup), Problem> {
        let (format, soup) = {
            let _floor = context.memory.hold(self.reading_bytes())?;
            let companions = self.companions(context)?;
            shapelex_core::mesh::read_within(&self.source(&companions), context)?
        };
        context.memory.grow(soup_bytes(&soup))?;
        Ok((format, soup))
    }

    fn reading_bytes(&self) -> u64 {
        (self.bytes.len() as u64).saturating_mul(READING_FACTOR)
    }

    /// Reads the mesh that is meant, which stays reserved: the file, or one pose of it.
    ///
    /// # Errors
    /// As [`read`](Self::read); `no_animation`; `invalid_query` where the file gives fewer poses than the index asks for.
    pub(super) fn read_posture(&self, context: &ReadContext) -> Result<ReadMesh, Problem> {
        let (format, pose, soup) = match &self.posture {
            Posture::Resting => {
                let (format, soup) = self.read(context)?;
                (format, None, soup)
            }
            Posture::Sampled { index, of } => {
                let (format, mut poses) = self.read_poses(*of, context)?;
                let all: u64 = poses.iter().map(|pose| soup_bytes(&pose.soup)).sum();
                let of = poses.len();
                if *index >= of {
                    return Err(no_such_pose(*index, of));
                }
                let found = poses.swap_remove(*index);
                drop(poses);
                context.memory.shrink(all - soup_bytes(&found.soup));
                let pose = shape_pose(found.label, *index, of);
                (format, Some(pose), found.soup)
            }
            Posture::Read(read) => {
                context.memory.grow(soup_bytes(&read.soup))?;
                (read.format, Some(read.pose.clone()), read.soup.clone())
            }
        };
        Ok(ReadMesh { format, pose, soup })
    }

    /// The mesh once per pose. All poses are read now, so that the file is read only once.
    ///
    /// # Errors
    /// As [`read_poses`](Self::read_poses).
    pub(super) fn in_poses(
        &self,
        poses: usize,
        limits: Limits,
        cancel: &Cancel,
    ) -> Result<Vec<Self>, Problem> {
        let context = self.context(limits, cancel);
        let (format, found) = self.read_poses(poses, &context)?;
        let of = found.len();
        found
            .into_iter()
            .enumerate()
            .map(|(index, found)| {
                let memory = self.memory.step();
                memory.grow(soup_bytes(&found.soup))?;
                context.memory.shrink(soup_bytes(&found.soup));
                let read = ReadPose {
                    format,
                    pose: shape_pose(found.label, index, of),
                    soup: found.soup,
                    _memory: memory,
                };
                Ok(Self {
                    posture: Posture::Read(Arc::new(read)),
                    ..self.clone()
                })
            })
            .collect()
    }

    /// Which pose of its file this is, as far as that is known before it is read.
    pub(super) fn pose(&self) -> Option<&ShapePose> {
        match &self.posture {
            Posture::Read(read) => Some(&read.pose),
            Posture::Resting | Posture::Sampled { .. } => None,
        }
    }

    /// Reserves memory for what is kept of the mesh until its request ends.
    ///
    /// # Errors
    /// `mesh_too_large` or `overloaded` where memory is short.
    pub(super) fn hold(&self, bytes: u64) -> Result<(), Problem> {
        Ok(self.memory.grow(bytes)?)
    }

    /// Samples poses of an animated glTF.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_poses(&self, poses: usize, context: &ReadContext) -> Result<(Format, Vec<Pose>), Problem> {
        let (format, poses) = {
            let _floor = context.memory.hold(self.reading_bytes())?;
            let companions = self.companions(context)?;
            shapelex_core::mesh::read_poses_within(&self.source(&companions), poses, context)?
        };
        let bytes = poses.iter().map(|pose| soup_bytes(&pose.soup)).sum();
        context.memory.grow(bytes)?;
        Ok((format, poses))
    }

    /// The file as the readers want it.
    pub fn source<'a>(&'a self, companions: &'a [Companion]) -> Source<'a> {
        Source {
            bytes: &self.bytes,
            name: Some(&self.name),
            media_type: self.media_type.as_deref(),
            companions,
        }
    }

    /// The buffers a glTF refers to, as far as they came along, each once. They share the request's bytes.
    ///
    /// A buffer is looked for from the mesh's own folder or, since browsers send names without folders, by its last
    /// part alone.
    ///
    /// # Errors
    /// `mesh_too_large` or `overloaded` where memory is short; `mesh_too_large` where their names are longer than any file
    /// needs: each shape is stored with them.
    pub fn companions(&self, context: &ReadContext) -> Result<Vec<Companion>, Problem> {
        let SentBuffers { files, index } = match &self.buffers {
            Buffers::Stored(companions) => return Ok(companions.clone()),
            Buffers::Sent(buffers) if buffers.files.is_empty() => return Ok(Vec::new()),
            Buffers::Sent(buffers) => buffers.as_ref(),
        };
        let mut names = 0;
        let mut companions = Vec::new();
        for uri in external_buffers(&self.bytes, &context.memory)? {
            let found = index.find(&self.folder, &uri).and_then(|i| files.get(i));
            let Some(part) = found else { continue };
            names += uri.path().len();
            if names > MAX_COMPANION_NAMES {
                return Err(MeshError::TooLarge {
                    what: "bytes in the names of its buffers",
                    found: names,
                    limit: MAX_COMPANION_NAMES,
                }
                .into());
            }
            companions.push(Companion::new(uri.path(), part.bytes.clone()));
        }
        Ok(companions)
    }
}

fn shape_pose(label: String, index: usize, of: usize) -> ShapePose {
    ShapePose { label, index, of }
}

fn no_such_pose(index: usize, found: usize) -> Problem {
    Problem::new(
        Code::InvalidQuery,
        format!("pose must be below {found}, the number of poses the file gives; got {index}"),
    )
    .with("name", "pose")
    .with("poses", found)
}

/// Memory of a mesh as read, in bytes.
fn soup_bytes(soup: &TriangleSoup) -> u64 {
    (24 * soup.vertices.len() + 12 * soup.faces.len()) as u64
}
