//! The stages of the data flow, by name.

/// A stage of the data flow, announced as it begins so that a caller with a clock can time it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Bytes → soup.
    Read,
    /// Soup → clean mesh.
    Prepare,
    /// Mesh → stiffness and mass.
    Laplacian,
    /// Operators → eigenpairs.
    Eigenpairs,
    /// Eigenpairs → signals.
    Signatures,
    /// Signals → codes and ranking.
    Ranking,
}

impl Stage {
    /// The stage's name on the wire and in metrics.
    pub fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Prepare => "prepare",
            Self::Laplacian => "laplacian",
            Self::Eigenpairs => "eigenpairs",
            Self::Signatures => "signatures",
            Self::Ranking => "ranking",
        }
    }
}
