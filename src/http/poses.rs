//! Which poses of animated files a request asks for.

use super::problem::{Code, Problem};
use super::uploaded::{Posture, UploadedMesh};
use shapelex_core::mesh::Limits;

/// What a query asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Poses {
    /// Files as they are.
    Resting,
    /// One of the sampled poses.
    One {
        /// Which, from 0.
        index: usize,
        /// How many are sampled.
        of: usize,
    },
    /// Each of so many sampled poses.
    Each(usize),
}

impl Poses {
    /// What the parameters `poses` and `pose` ask for.
    ///
    /// # Errors
    /// `invalid_query` where they are out of range, or do not fit together.
    pub(super) fn new(poses: Option<usize>, pose: Option<usize>, limits: &Limits) -> Result<Self, Problem> {
        check_poses(poses, limits)?;
        match (poses, pose) {
            (None, None) => Ok(Self::Resting),
            (Some(of), None) => Ok(Self::Each(of)),
            (Some(of), Some(index)) if index < of => Ok(Self::One { index, of }),
            (Some(of), Some(index)) => Err(refused(
                "pose",
                format!("pose must be below poses, which is {of}; got {index}"),
            )),
            (None, Some(_)) => Err(refused(
                "pose",
                "pose says which of the sampled poses is meant; say with poses how many are sampled"
                    .to_owned(),
            )),
        }
    }

    /// Meshes that are ranked for each file.
    pub(super) fn per_file(self) -> usize {
        match self {
            Self::Resting | Self::One { .. } => 1,
            Self::Each(poses) => poses,
        }
    }

    /// The one mesh of a file.
    ///
    /// # Errors
    /// `one_mesh_expected` where several poses are asked for.
    pub(super) fn only(self, mut mesh: UploadedMesh) -> Result<UploadedMesh, Problem> {
        match self {
            Self::Resting => {}
            Self::One { index, of } => mesh.posture = Posture::Sampled { index, of },
            Self::Each(1) => mesh.posture = Posture::Sampled { index: 0, of: 1 },
            Self::Each(poses) => {
                return Err(Problem::new(
                    Code::OneMeshExpected,
                    format!(
                        "{poses} poses were asked for; say which with pose, from 0 to {}, or use POST /v1/query/batch, \
                         which answers each",
                        poses - 1
                    ),
                )
                .with("found", poses));
            }
        }
        Ok(mesh)
    }
}

/// Checks how many poses are sampled of a file.
///
/// # Errors
/// `invalid_query`.
pub(super) fn check_poses(poses: Option<usize>, limits: &Limits) -> Result<(), Problem> {
    match poses {
        Some(poses) if !(1..=limits.max_poses).contains(&poses) => Err(refused(
            "poses",
            format!("poses must be between 1 and {}, got {poses}", limits.max_poses),
        )),
        _ => Ok(()),
    }
}

fn refused(name: &str, detail: String) -> Problem {
    Problem::new(Code::InvalidQuery, detail).with("name", name)
}
