//! A dictionary: L atoms of M values, and what the Lasso needs of it over and over.

use super::CodingError;
use super::screen::Screen;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, Mat, MatRef, Par};
use std::sync::OnceLock;

/// A learnt dictionary D with its Gram matrix.
#[derive(Clone, Debug)]
pub struct Dictionary {
    atoms: Mat<f64>,
    /// Computed at once for a dictionary that codes many signals, and for one that codes few only where it is missed.
    gram: OnceLock<Mat<f64>>,
    screen: Screen,
}

impl Dictionary {
    /// Takes D (M × L, one atom per column, ‖d_j‖ ≤ 1 up to rounding, all finite) and computes DᵀD.
    pub fn new(atoms: Mat<f64>) -> Result<Self, CodingError> {
        for j in 0..atoms.ncols() {
            let mut norm2 = 0.0;
            for i in 0..atoms.nrows() {
                norm2 += atoms[(i, j)] * atoms[(i, j)];
            }
            if !norm2.is_finite() {
                return Err(CodingError::NotFinite { what: "dictionary" });
            }
            if norm2 > 1.0 + 1e-5 {
                return Err(CodingError::BadParameter {
                    name: "atom norm",
                    expected: "at most 1",
                    found: format!("{}", norm2.sqrt()),
                });
            }
        }
        let gram = gram(&atoms);
        let screen = Screen::new(&atoms, &gram);
        let gram = OnceLock::from(gram);
        Ok(Self { atoms, gram, screen })
    }

    /// As [`Dictionary::new`] for atoms known to be sound, and quicker: for coding a few hundred signals and no more.
    pub(super) fn for_few_signals(atoms: Mat<f64>) -> Self {
        let screen = Screen::direct(&atoms);
        Self {
            atoms,
            gram: OnceLock::new(),
            screen,
        }
    }

    /// D, M × L, one atom per column.
    pub fn atoms(&self) -> &Mat<f64> {
        &self.atoms
    }

    /// DᵀD, L × L, symmetric.
    pub fn gram(&self) -> &Mat<f64> {
        self.gram.get_or_init(|| gram(&self.atoms))
    }

    /// DᵀD where it has been computed.
    pub(super) fn known_gram(&self) -> Option<MatRef<'_, f64>> {
        self.gram.get().map(|gram| gram.as_ref())
    }

    pub(super) fn screen(&self) -> &Screen {
        &self.screen
    }

    /// M, the length of an atom.
    pub fn dimension(&self) -> usize {
        self.atoms.nrows()
    }

    /// L, the number of atoms.
    pub fn len(&self) -> usize {
        self.atoms.ncols()
    }

    /// Whether there are no atoms.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// DᵀD: half of it is computed, the other mirrored.
fn gram(atoms: &Mat<f64>) -> Mat<f64> {
    use BlockStructure::{Rectangular, TriangularLower};
    let l = atoms.ncols();
    let mut gram = Mat::zeros(l, l);
    let (left, right) = (atoms.transpose(), atoms.as_ref());
    matmul(
        gram.as_mut(),
        TriangularLower,
        Accum::Replace,
        left,
        Rectangular,
        right,
        Rectangular,
        1.0,
        Par::Seq,
    );
    for j in 0..l {
        for i in j + 1..l {
            gram[(j, i)] = gram[(i, j)];
        }
    }
    gram
}
