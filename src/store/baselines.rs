//! What the baselines need of a generation: a model its shapes share, and per class what each shape is kept as.
//!
//! The model's key is the hash of its contents, a class's that of its dictionaries with the model's: equal keys mean
//! equal contents, so an unchanged class is not written again.

use super::entry::{get, put};
use super::payload::{only, pack, unpack};
use super::record::{Family, Record};
use super::{Batch, Store, StoreError, keys};
use crate::model::{Generation, GenerationClass, ShapeId};
use faer::Mat;
use serde::{Deserialize, Serialize};
use shapelex_core::baseline::{
    BaselineClass, BaselineIndex, BaselineModel, BaselineShape, SignatureDistances, Vocabulary,
};

#[derive(Serialize, Deserialize)]
struct ModelV1 {
    largest: f64,
    seed: u64,
    /// M and the number of words.
    rows: u32,
    columns: u32,
    /// Word after word.
    words: Vec<f64>,
}

/// A model as a record.
pub(super) struct ModelRecord(BaselineModel);

impl Record for ModelRecord {
    const FAMILY: Family = Family::BaselineModel;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        let words = &self.0.vocabulary.words;
        let narrow = |n: usize| u32::try_from(n).map_err(|e| e.to_string());
        pack(&ModelV1 {
            largest: self.0.distances.largest,
            seed: self.0.seed,
            rows: narrow(words.nrows())?,
            columns: narrow(words.ncols())?,
            words: (0..words.ncols())
                .flat_map(|j| (0..words.nrows()).map(move |i| words[(i, j)]))
                .collect(),
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let v: ModelV1 = unpack(payload)?;
        let (rows, columns) = (v.rows as usize, v.columns as usize);
        if rows == 0 || rows.checked_mul(columns) != Some(v.words.len()) {
            return Err("the words' size is not that of their values".to_owned());
        }
        Ok(Self(BaselineModel {
            distances: SignatureDistances { largest: v.largest },
            vocabulary: Vocabulary {
                words: Mat::from_fn(rows, columns, |i, j| v.words[j * rows + i]),
            },
            seed: v.seed,
        }))
    }
}

#[derive(Serialize, Deserialize)]
struct ShapeV1 {
    shape: [u8; 16],
    eigenvalues: Vec<f64>,
    distances: Vec<f32>,
    words: Vec<f32>,
}

/// A class's shapes as a record; labels are identifiers as text.
pub(super) struct ShapesRecord(Vec<BaselineShape>);

impl Record for ShapesRecord {
    const FAMILY: Family = Family::Baselines;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        let shapes = self
            .0
            .iter()
            .map(|s| {
                let id: ShapeId = s
                    .label
                    .parse()
                    .map_err(|_| format!("'{}' is no shape", s.label))?;
                Ok(ShapeV1 {
                    shape: id.to_bytes(),
                    eigenvalues: s.eigenvalues.clone(),
                    distances: s.distances.clone(),
                    words: s.words.clone(),
                })
            })
            .collect::<Result<Vec<_>, String>>()?;
        pack(&shapes)
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let shapes: Vec<ShapeV1> = unpack(payload)?;
        Ok(Self(
            shapes
                .into_iter()
                .map(|s| BaselineShape {
                    label: ShapeId::from_bytes(s.shape).to_string(),
                    eigenvalues: s.eigenvalues,
                    distances: s.distances,
                    words: s.words,
                })
                .collect(),
        ))
    }
}

/// The key of a class's shapes under a model.
pub(super) fn class_key(class: &GenerationClass, model: &str) -> String {
    format!("{}-{model}", class.dictionary)
}

impl Store {
    /// Keeps a model; returns its key.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the write's failure.
    pub fn put_baseline_model(&self, model: &BaselineModel) -> Result<String, StoreError> {
        let record = ModelRecord(model.clone());
        let bytes = record.encode().map_err(|detail| StoreError::Io {
            what: "encode a model of the baselines".to_owned(),
            detail,
        })?;
        let name = format!("model-{}", &blake3::hash(&bytes).to_hex()[..32]);
        let mut batch = Batch::default();
        put(&mut batch, keys::baseline(&name), &record)?;
        self.inner.commit(&batch)?;
        Ok(name)
    }

    /// The model of a key; `None` where there is none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where the record is not what was written.
    pub fn baseline_model(&self, key: &str) -> Result<Option<BaselineModel>, StoreError> {
        let record: Option<ModelRecord> = get(&*self.inner.backend, &keys::baseline(key))?;
        Ok(record.map(|r| r.0))
    }

    /// Keeps what a class's shapes are under a model. Their labels are their identifiers as text.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], or the write's failure.
    pub fn put_baseline_shapes(
        &self,
        class: &GenerationClass,
        model: &str,
        shapes: Vec<BaselineShape>,
    ) -> Result<(), StoreError> {
        let mut batch = Batch::default();
        let key = keys::baseline(&class_key(class, model));
        put(&mut batch, key, &ShapesRecord(shapes))?;
        self.inner.commit(&batch)
    }

    /// What a class's shapes are kept as under a model; `None` where that was not written.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where the record is not what was written.
    pub fn baseline_shapes(
        &self,
        class: &GenerationClass,
        model: &str,
    ) -> Result<Option<Vec<BaselineShape>>, StoreError> {
        let record: Option<ShapesRecord> =
            get(&*self.inner.backend, &keys::baseline(&class_key(class, model)))?;
        Ok(record.map(|r| r.0))
    }

    /// Everything the baselines need of a generation; `None` where it was learnt without, or where a part of it is
    /// gone: another reindex brings it back, and ranking by sparse coding does not need it.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where a record is not what was written.
    pub fn load_baselines(&self, generation: &Generation) -> Result<Option<BaselineIndex>, StoreError> {
        let Some(key) = &generation.baselines else {
            return Ok(None);
        };
        let Some(model) = self.baseline_model(key)? else {
            return Ok(None);
        };
        let mut classes = Vec::with_capacity(generation.classes.len());
        for class in &generation.classes {
            let Some(shapes) = self.baseline_shapes(class, key)? else {
                return Ok(None);
            };
            classes.push(BaselineClass {
                label: class.class.to_string(),
                shapes,
            });
        }
        Ok(Some(BaselineIndex { model, classes }))
    }
}
