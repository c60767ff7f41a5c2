//! A dictionary: L atoms of M values, and what the Lasso needs of it over and over.

use super::CodingError;
use super::dot::dot;
use super::screen::Screen;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, Mat, MatRef, Par};
use std::sync::OnceLock;

/// Gram matrices of up to so many entries (1 MB) are kept; of larger ones, most of whose entries few codes touch, a
/// product is computed when it is met.
const KEPT: usize = 1 << 17;

/// A learnt dictionary D with what the Lasso needs of it.
#[derive(Clone, Debug)]
pub struct Dictionary {
    atoms: Mat<f64>,
    /// ‖d_j‖² of each atom.
    squares: Vec<f64>,
    /// Computed at once for a dictionary of few atoms that codes many signals, and for others only where it is missed.
    gram: OnceLock<Mat<f64>>,
    screen: Screen,
}

impl Dictionary {
    /// Takes D (M × L, one atom per column, ‖d_j‖ ≤ 1 up to rounding, all finite) and computes DᵀD.
    pub fn new(atoms: Mat<f64>) -> Result<Self, CodingError> {
        let squares = squares(&atoms);
        for &norm2 in &squares {
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
        let kept = if gram.ncols() * gram.nrows() <= KEPT {
            OnceLock::from(gram)
        } else {
            OnceLock::new()
        };
        Ok(Self {
            atoms,
            squares,
            gram: kept,
            screen,
        })
    }

    /// As [`Dictionary::new`] for atoms known to be sound, and quicker: for coding a few hundred signals and no more.
    pub(super) fn for_few_signals(atoms: Mat<f64>) -> Self {
        let screen = Screen::direct(&atoms);
        Self {
            squares: squares(&atoms),
            atoms,
            gram: OnceLock::new(),
            screen,
        }
    }

    /// The atoms, to be changed; [`Dictionary::renew`] must follow before anything is coded.
    pub(super) fn atoms_mut(&mut self) -> &mut Mat<f64> {
        &mut self.atoms
    }

    /// Does with changed atoms what [`Dictionary::for_few_signals`] does, in the memory there is.
    pub(super) fn renew(&mut self) {
        self.squares = squares(&self.atoms);
        self.gram.take();
        self.screen.renew(&self.atoms);
    }

    /// D, given up.
    pub(super) fn into_atoms(self) -> Mat<f64> {
        self.atoms
    }

    /// D, M × L, one atom per column.
    pub fn atoms(&self) -> &Mat<f64> {
        &self.atoms
    }

    /// DᵀD, L × L, symmetric.
    pub fn gram(&self) -> &Mat<f64> {
        self.gram.get_or_init(|| gram(&self.atoms))
    }

    /// DᵀD where it has been computed and is small. Whether a large one has been depends on what was coded before, and
    /// codes must not, to the last bit.
    pub(super) fn known_gram(&self) -> Option<MatRef<'_, f64>> {
        let small = |gram: &&Mat<f64>| gram.ncols() * gram.nrows() <= KEPT;
        self.gram.get().filter(small).map(|gram| gram.as_ref())
    }

    /// ‖d_j‖² of each atom.
    pub(super) fn squares(&self) -> &[f64] {
        &self.squares
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

fn squares(atoms: &Mat<f64>) -> Vec<f64> {
    (0..atoms.ncols())
        .map(|j| dot(atoms.col_as_slice(j), atoms.col_as_slice(j)))
        .collect()
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
