//! The stages of the data flow, by name.

use std::cell::RefCell;
use tracing::info_span;
use tracing::span::EnteredSpan;

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

/// The span of the stage a piece of work is in; log lines and traces say by it where they are. Dropped, it ends.
#[derive(Default)]
pub struct StageSpan(RefCell<Option<EnteredSpan>>);

impl StageSpan {
    /// Ends the stage before and begins this one.
    pub fn begin(&self, stage: Stage) {
        // Ended first: the next one stands beside it, not in it.
        drop(self.0.take());
        let span = match stage {
            Stage::Read => info_span!("read"),
            Stage::Prepare => info_span!("prepare"),
            Stage::Laplacian => info_span!("laplacian"),
            Stage::Eigenpairs => info_span!("eigenpairs"),
            Stage::Signatures => info_span!("signatures"),
            Stage::Ranking => info_span!("ranking"),
        };
        self.0.replace(Some(span.entered()));
    }
}
