//! A dictionary: L atoms of M values, whole for coding at once or at single precision for being kept.
//!
//! What the Lasso needs beside the atoms, two Gram matrices most of all, takes several times their memory. An index of
//! thousands of classes keeps the atoms alone, which learning rounds to single precision, and prepares them where they are
//! used: for good while there is room, and else for the call. The codes are the same to the last bit.

use super::CodingError;
use super::prepared::{Prepared, prepared_bytes};
use faer::Mat;
use std::borrow::Cow;
use std::ops::Deref;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Up to so many signals are coded under atoms that are prepared for the call without their exact products.
const FEW_SIGNALS: usize = 128;

/// A learnt dictionary D.
#[derive(Clone, Debug)]
pub struct Dictionary(Form);

#[derive(Clone, Debug)]
enum Form {
    Whole(Box<Prepared>),
    Single(Single),
}

/// Atoms at single precision.
#[derive(Debug)]
struct Single {
    /// Atom after atom.
    values: Vec<f32>,
    dimension: usize,
    /// Filled at the first use that finds room.
    prepared: OnceLock<Box<Prepared>>,
    room: Arc<PreparedRoom>,
}

/// How much memory the prepared forms of many dictionaries may take together.
#[derive(Debug)]
pub struct PreparedRoom {
    left: AtomicUsize,
}

impl PreparedRoom {
    /// Room for this many bytes.
    pub fn new(bytes: usize) -> Arc<Self> {
        Arc::new(Self {
            left: AtomicUsize::new(bytes),
        })
    }

    /// Takes some of the room; false where there is not enough.
    fn take(&self, bytes: usize) -> bool {
        let rest = |left: usize| left.checked_sub(bytes);
        self.left
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, rest)
            .is_ok()
    }

    fn give_back(&self, bytes: usize) {
        self.left.fetch_add(bytes, Ordering::Relaxed);
    }
}

/// A prepared form, kept or made for a call.
pub(super) enum Loan<'a> {
    Kept(&'a Prepared),
    Made(Box<Prepared>),
}

impl Deref for Loan<'_> {
    type Target = Prepared;

    fn deref(&self) -> &Prepared {
        match self {
            Self::Kept(prepared) => prepared,
            Self::Made(prepared) => prepared,
        }
    }
}

impl Dictionary {
    /// Takes D (M × L, one atom per column, ‖d_j‖ ≤ 1 up to rounding, all finite) and prepares it for coding.
    ///
    /// # Errors
    /// [`CodingError::NotFinite`]; [`CodingError::BadParameter`] for an atom that is too long.
    pub fn new(atoms: Mat<f64>) -> Result<Self, CodingError> {
        Ok(Prepared::new(atoms)?.into())
    }

    /// Takes D at single precision, atom after atom of `dimension` values, to be kept as it is and prepared where it is
    /// used: for good while there is `room`. Codes are those of [`Dictionary::new`] to the last bit, but for up to 128
    /// signals at once, whose codes may differ by rounding.
    ///
    /// # Errors
    /// As [`Dictionary::new`]; [`CodingError::DimensionMismatch`] where the last atom is cut short.
    pub fn single(values: Vec<f32>, dimension: usize, room: &Arc<PreparedRoom>) -> Result<Self, CodingError> {
        let rest = values.len() % dimension.max(1);
        if dimension == 0 || rest != 0 {
            return Err(CodingError::DimensionMismatch {
                signature: dimension,
                atoms: rest,
            });
        }
        for atom in values.chunks_exact(dimension) {
            Prepared::check(atom.iter().map(|d| f64::from(*d) * f64::from(*d)).sum())?;
        }
        Ok(Self(Form::Single(Single {
            values,
            dimension,
            prepared: OnceLock::new(),
            room: Arc::clone(room),
        })))
    }

    /// The form that codes are computed by, for so many signals.
    pub(super) fn prepared(&self, signals: usize) -> Loan<'_> {
        match &self.0 {
            Form::Whole(prepared) => Loan::Kept(prepared),
            Form::Single(single) => single.prepared(signals),
        }
    }

    /// D, M × L, one atom per column.
    pub fn atoms(&self) -> Cow<'_, Mat<f64>> {
        match &self.0 {
            Form::Whole(prepared) => Cow::Borrowed(prepared.atoms()),
            Form::Single(single) => match single.prepared.get() {
                Some(prepared) => Cow::Borrowed(prepared.atoms()),
                None => Cow::Owned(single.atoms()),
            },
        }
    }

    /// r ← r − a d_j for every atom j and value a of a code.
    pub fn subtract(&self, atoms: &[u32], values: &[f64], residual: &mut [f64]) {
        for (&j, &a) in atoms.iter().zip(values) {
            match &self.0 {
                Form::Whole(prepared) => {
                    let atom = prepared.atoms().col_as_slice(j as usize);
                    residual.iter_mut().zip(atom).for_each(|(r, d)| *r -= a * d);
                }
                Form::Single(single) => {
                    let atom = &single.values[j as usize * single.dimension..][..single.dimension];
                    let atom = atom.iter().map(|d| f64::from(*d));
                    residual.iter_mut().zip(atom).for_each(|(r, d)| *r -= a * d);
                }
            }
        }
    }

    /// M, the length of an atom.
    pub fn dimension(&self) -> usize {
        match &self.0 {
            Form::Whole(prepared) => prepared.dimension(),
            Form::Single(single) => single.dimension,
        }
    }

    /// L, the number of atoms.
    pub fn len(&self) -> usize {
        match &self.0 {
            Form::Whole(prepared) => prepared.len(),
            Form::Single(single) => single.values.len() / single.dimension,
        }
    }

    /// Whether there are no atoms.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Memory it takes now, in bytes, its prepared form included where that is kept.
    pub fn resident_bytes(&self) -> usize {
        match &self.0 {
            Form::Whole(prepared) => prepared.bytes(),
            Form::Single(single) => {
                size_of::<f32>() * single.values.capacity()
                    + single.prepared.get().map_or(0, |prepared| prepared.bytes())
            }
        }
    }
}

impl From<Prepared> for Dictionary {
    fn from(prepared: Prepared) -> Self {
        Self(Form::Whole(Box::new(prepared)))
    }
}

impl Clone for Single {
    /// The copy finds room of its own for its prepared form.
    fn clone(&self) -> Self {
        Self {
            values: self.values.clone(),
            dimension: self.dimension,
            prepared: OnceLock::new(),
            room: Arc::clone(&self.room),
        }
    }
}

impl Single {
    fn count(&self) -> usize {
        self.values.len() / self.dimension
    }

    fn atoms(&self) -> Mat<f64> {
        let mut atoms = Mat::zeros(self.dimension, self.count());
        for (j, atom) in self.values.chunks_exact(self.dimension).enumerate() {
            for (to, from) in atoms.col_as_slice_mut(j).iter_mut().zip(atom) {
                *to = f64::from(*from);
            }
        }
        atoms
    }

    fn prepared(&self, signals: usize) -> Loan<'_> {
        if let Some(prepared) = self.prepared.get() {
            return Loan::Kept(prepared);
        }
        let bytes = prepared_bytes(self.dimension, self.count());
        if self.room.take(bytes) {
            let mut fresh = false;
            let kept = self.prepared.get_or_init(|| {
                fresh = true;
                Box::new(Prepared::of_sound(self.atoms()))
            });
            // Another thread was first.
            if !fresh {
                self.room.give_back(bytes);
            }
            return Loan::Kept(kept);
        }
        let atoms = self.atoms();
        Loan::Made(Box::new(if signals <= FEW_SIGNALS {
            Prepared::for_few_signals(atoms)
        } else {
            Prepared::of_sound(atoms)
        }))
    }
}

impl Drop for Single {
    fn drop(&mut self) {
        if let Some(prepared) = self.prepared.get() {
            self.room.give_back(prepared.bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::Cancel;
    use crate::coding::encode;

    /// 40 atoms of 24 values at single precision.
    fn atoms() -> Vec<f32> {
        let value = |i: usize, j: usize| ((i * (j + 2)) as f32 * 0.37).sin() / 6.0;
        (0..40).flat_map(|j| (0..24).map(move |i| value(i, j))).collect()
    }

    #[test]
    fn kept_atoms_code_as_whole_ones_with_and_without_room() {
        let values = atoms();
        let whole = Mat::from_fn(24, 40, |i, j| f64::from(values[j * 24 + i]));
        let whole = Dictionary::new(whole).unwrap();
        let signals = Mat::from_fn(24, 200, |i, j| ((i * 7 + j * 3) as f64 * 0.11).cos() / 3.0);
        let codes =
            |dictionary: &Dictionary| encode(dictionary, signals.as_ref(), 0.05, &Cancel::new()).unwrap();
        let bytes = prepared_bytes(24, 40);
        let room = PreparedRoom::new(bytes + bytes / 2);
        let single = || Dictionary::single(values.clone(), 24, &room).unwrap();
        let (first, second) = (single(), single());
        assert_eq!(first.resident_bytes(), 4 * 24 * 40);
        assert_eq!(codes(&first), codes(&whole));
        assert_eq!(codes(&second), codes(&whole));
        assert_eq!(first.resident_bytes(), 4 * 24 * 40 + bytes, "it is kept");
        assert_eq!(second.resident_bytes(), 4 * 24 * 40, "there was no room");
        assert_eq!(*second.atoms(), *whole.atoms());
        // Its room is free again for another.
        drop(first);
        codes(&second);
        assert_eq!(second.resident_bytes(), 4 * 24 * 40 + bytes);
    }

    #[test]
    fn atoms_that_are_none_are_refused() {
        let room = PreparedRoom::new(0);
        assert!(Dictionary::single(vec![0.5; 7], 2, &room).is_err());
        assert!(Dictionary::single(vec![0.5; 4], 0, &room).is_err());
        assert!(Dictionary::single(vec![2.0; 4], 2, &room).is_err());
        assert!(Dictionary::single(vec![f32::NAN; 4], 2, &room).is_err());
    }
}
