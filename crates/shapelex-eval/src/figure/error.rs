//! Why a figure could not be drawn.

use plotters::drawing::DrawingAreaErrorKind;
use std::error::Error;

/// Why there is no figure.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FigureError {
    /// There is nothing to draw.
    #[error("there are no {what} to draw")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// The data do not fit together.
    #[error("{what}: {found} where {expected} belong")]
    Shape {
        /// Which data.
        what: &'static str,
        /// How many there should be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A mesh has nothing that could be drawn.
    #[error("a mesh of the gallery cannot be drawn: {0}")]
    Mesh(#[from] shapelex_core::mesh::MeshError),
    /// A decomposition did not converge.
    #[error("the distances have no embedding: {detail}")]
    Embedding {
        /// What the decomposition said.
        detail: String,
    },
    /// The plotting library gave up.
    #[error("drawing failed: {detail}")]
    Drawing {
        /// What it said.
        detail: String,
    },
}

impl<E: Error + Send + Sync> From<DrawingAreaErrorKind<E>> for FigureError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self::Drawing {
            detail: error.to_string(),
        }
    }
}
