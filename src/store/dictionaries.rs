//! Dictionaries as records: per channel M, L and the atoms as 32-bit floats.

use super::payload::only;
use super::record::{Family, Record};
use super::{Store, StoreError, backend::Batch, keys, record};
use crate::model::Generation;
use shapelex_core::coding::{Dictionary, PreparedRoom};
use shapelex_core::parameters::Channel;
use shapelex_core::ranking::{Index, IndexedClass, IndexedShape};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The dictionaries of one class or shape, by channel.
pub type Dictionaries = BTreeMap<Channel, Arc<Dictionary>>;

/// The number of a channel in records. Numbers are never given twice.
const CHANNELS: [(u8, Channel); 3] = [
    (1, Channel::Plain),
    (2, Channel::Whitened),
    (3, Channel::FixedGrid),
];

/// As many atoms as parameters may ask for.
const MAX_ATOMS: usize = 5000;

/// Memory that the dictionaries of an index may take beyond their atoms, in bytes: what the classes that are used first are
/// prepared in. 64 classes of the `default` preset take 40 MB.
pub const PREPARED_BYTES: usize = 48 << 20;

/// The atoms of one class or shape, by channel.
pub(super) struct DictionaryRecord(BTreeMap<Channel, Atoms>);

/// Atom after atom.
struct Atoms {
    dimension: usize,
    values: Vec<f32>,
}

impl Atoms {
    fn of(dictionary: &Dictionary) -> Self {
        let atoms = dictionary.atoms();
        let columns = (0..atoms.ncols()).flat_map(|j| atoms.col_as_slice(j));
        Self {
            dimension: dictionary.dimension(),
            values: columns.map(|value| *value as f32).collect(),
        }
    }
}

/// A dictionary's Gram matrix has L² values, however short its record is.
fn check_size(m: usize, l: usize) -> Result<(), String> {
    if m == 0 || l > MAX_ATOMS {
        return Err(format!("{l} atoms of {m} values are no dictionary"));
    }
    Ok(())
}

impl Record for DictionaryRecord {
    const FAMILY: Family = Family::Dictionary;
    const VERSION: u16 = 1;

    /// For each channel: its number (u8), M and L (u32), then M · L atoms (f32), one atom after the other.
    fn encode(&self) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        for (channel, atoms) in &self.0 {
            let number = CHANNELS
                .iter()
                .find(|(_, c)| c == channel)
                .ok_or("a channel has no number")?
                .0;
            let (m, l) = (atoms.dimension, atoms.values.len() / atoms.dimension.max(1));
            check_size(m, l)?;
            let narrow = |n: usize| u32::try_from(n).map_err(|_| "dictionary too large".to_owned());
            bytes.push(number);
            bytes.extend_from_slice(&narrow(m)?.to_le_bytes());
            bytes.extend_from_slice(&narrow(l)?.to_le_bytes());
            bytes.extend(atoms.values.iter().flat_map(|value| value.to_le_bytes()));
        }
        Ok(bytes)
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let mut dictionaries = BTreeMap::new();
        let mut rest = payload;
        while let Some((&number, after)) = rest.split_first() {
            let channel = CHANNELS
                .iter()
                .find(|(n, _)| *n == number)
                .ok_or_else(|| format!("unknown channel {number}"))?
                .1;
            let (head, after) = after
                .split_at_checked(8)
                .ok_or("cut short in a dictionary's size")?;
            let m = u32::from_le_bytes([head[0], head[1], head[2], head[3]]) as usize;
            let l = u32::from_le_bytes([head[4], head[5], head[6], head[7]]) as usize;
            check_size(m, l)?;
            let length = m
                .checked_mul(l)
                .and_then(|n| n.checked_mul(4))
                .ok_or("dictionary too large")?;
            let (values, after) = after
                .split_at_checked(length)
                .ok_or("cut short in a dictionary's atoms")?;
            let atoms = Atoms {
                dimension: m,
                values: values
                    .as_chunks()
                    .0
                    .iter()
                    .map(|value| f32::from_le_bytes(*value))
                    .collect(),
            };
            dictionaries.insert(channel, atoms);
            rest = after;
        }
        Ok(Self(dictionaries))
    }
}

impl Store {
    /// Keeps dictionaries under a key of the caller's choice and returns their size in bytes. They are durable, but
    /// nobody sees them before a generation names the key.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the write's failure.
    pub fn put_dictionaries(&self, key: &str, dictionaries: &Dictionaries) -> Result<u64, StoreError> {
        let key = keys::dictionary(key);
        let atoms = dictionaries.iter().map(|(channel, d)| (*channel, Atoms::of(d)));
        let bytes = record::seal(&key, &DictionaryRecord(atoms.collect()))?;
        let size = bytes.len() as u64;
        let mut batch = Batch::default();
        batch.put(key, bytes);
        self.inner.commit(&batch)?;
        Ok(size)
    }

    /// The dictionaries of a key, with their size as stored, in bytes; `None` where there are none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where the record is not what was written.
    pub fn dictionaries(&self, key: &str) -> Result<Option<(Dictionaries, u64)>, StoreError> {
        self.dictionaries_in(key, &PreparedRoom::new(PREPARED_BYTES))
    }

    fn dictionaries_in(
        &self,
        key: &str,
        room: &Arc<PreparedRoom>,
    ) -> Result<Option<(Dictionaries, u64)>, StoreError> {
        let key = keys::dictionary(key);
        let Some(bytes) = self.inner.backend.get(&key)? else {
            return Ok(None);
        };
        let record: DictionaryRecord = record::unseal(&key, &bytes)?;
        let dictionaries = record.0.into_iter().map(|(channel, atoms)| {
            let dictionary = Dictionary::single(atoms.values, atoms.dimension, room)
                .map_err(|e| StoreError::damaged(record::describe(&key), e.to_string()))?;
            Ok((channel, Arc::new(dictionary)))
        });
        let dictionaries = dictionaries.collect::<Result<_, StoreError>>()?;
        Ok(Some((dictionaries, bytes.len() as u64)))
    }

    /// The index of a generation, all dictionaries in memory. A class's label is its identifier as text, and so is a
    /// shape's.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where a dictionary is missing or not what was written.
    pub fn load_index(&self, generation: &Generation) -> Result<Index, StoreError> {
        let room = PreparedRoom::new(PREPARED_BYTES);
        let load = |key: &str| {
            self.dictionaries_in(key, &room)?
                .map(|(dictionaries, _)| dictionaries)
                .ok_or_else(|| StoreError::damaged(format!("dictionary {key}"), "it is missing"))
        };
        let classes = generation
            .classes
            .iter()
            .map(|class| {
                Ok(IndexedClass {
                    label: class.class.to_string(),
                    dictionaries: load(&class.dictionary)?,
                    shapes: class
                        .shape_dictionaries
                        .iter()
                        .map(|shape| {
                            Ok(IndexedShape {
                                label: shape.shape.to_string(),
                                dictionaries: load(&shape.dictionary)?,
                            })
                        })
                        .collect::<Result<_, StoreError>>()?,
                })
            })
            .collect::<Result<_, StoreError>>()?;
        Ok(Index {
            parameters: generation.parameters.clone(),
            classes,
        })
    }
}
