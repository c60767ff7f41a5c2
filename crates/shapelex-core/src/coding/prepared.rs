//! L atoms of M values at double precision, with what the Lasso needs of them over and over.

use super::CodingError;
use super::dot::dot;
use super::rows::padded;
use super::screen::Screen;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, Mat, MatRef, Par};
use std::sync::OnceLock;

/// Gram matrices of up to so many entries (1 MB) are kept; of larger ones, most of whose entries few codes touch, a
/// product is computed when it is met.
const KEPT: usize = 1 << 17;

/// A dictionary D made ready for coding.
#[derive(Clone, Debug)]
pub(super) struct Prepared {
    atoms: Mat<f64>,
    /// ‖d_j‖² of each atom.
    squares: Vec<f64>,
    /// Computed at once for a dictionary of few atoms that codes many signals, and for others only where it is missed.
    gram: OnceLock<Mat<f64>>,
    screen: Screen,
}

impl Prepared {
    /// Takes D (M × L, one atom per column, ‖d_j‖ ≤ 1 up to rounding, all finite) and computes DᵀD.
    pub fn new(atoms: Mat<f64>) -> Result<Self, CodingError> {
        squares(&atoms).into_iter().try_for_each(Self::check)?;
        Ok(Self::of_sound(atoms))
    }

    /// Refuses an atom by its ‖d‖².
    pub fn check(norm2: f64) -> Result<(), CodingError> {
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
        Ok(())
    }

    /// As [`Prepared::new`] for atoms known to be sound.
    pub fn of_sound(atoms: Mat<f64>) -> Self {
        let gram = gram(&atoms);
        let screen = Screen::new(&atoms, &gram);
        let kept = if gram.ncols() * gram.nrows() <= KEPT {
            OnceLock::from(gram)
        } else {
            OnceLock::new()
        };
        Self {
            squares: squares(&atoms),
            atoms,
            gram: kept,
            screen,
        }
    }

    /// As [`Prepared::new`] for atoms known to be sound, and quicker: for coding a few hundred signals and no more.
    pub fn for_few_signals(atoms: Mat<f64>) -> Self {
        let screen = Screen::direct(&atoms);
        Self {
            squares: squares(&atoms),
            atoms,
            gram: OnceLock::new(),
            screen,
        }
    }

    /// The atoms, to be changed; [`Prepared::renew`] must follow before anything is coded.
    pub fn atoms_mut(&mut self) -> &mut Mat<f64> {
        &mut self.atoms
    }

    /// Does with changed atoms what [`Prepared::for_few_signals`] does, in the memory there is.
    pub fn renew(&mut self) {
        self.squares = squares(&self.atoms);
        self.gram.take();
        self.screen.renew(&self.atoms);
    }

    /// D, given up.
    pub fn into_atoms(self) -> Mat<f64> {
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
    pub fn known_gram(&self) -> Option<MatRef<'_, f64>> {
        let small = |gram: &&Mat<f64>| gram.ncols() * gram.nrows() <= KEPT;
        self.gram.get().filter(small).map(|gram| gram.as_ref())
    }

    /// ‖d_j‖² of each atom.
    pub fn squares(&self) -> &[f64] {
        &self.squares
    }

    pub fn screen(&self) -> &Screen {
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

    /// Memory it takes, in bytes, about.
    pub fn bytes(&self) -> usize {
        prepared_bytes(self.dimension(), self.len())
    }
}

/// Memory that L prepared atoms of M values take, in bytes, about: the atoms, their Gram matrix twice, of which a large
/// one is made only where it is missed, and the screen.
pub(super) fn prepared_bytes(m: usize, l: usize) -> usize {
    let exact_gram = if l * l <= KEPT { 8 * l * l } else { 0 };
    8 * m * l + exact_gram + 4 * l * padded(l) + 4 * m * l
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
