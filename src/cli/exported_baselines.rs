//! What the baselines need, in a file of dictionaries.
//!
//! The words that all shapes share are the tensor `/vocabulary` (f64, M × k). A class has three tensors with a row per shape,
//! in the order of the names in the metadata: `<class>/shape_dna` (f64, eigenvalues; rows are filled up with NaN),
//! `<class>/signature_distances` and `<class>/bag_of_words` (f32, histograms).

use super::tensors::Tensors;
use faer::Mat;
use safetensors::tensor::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};
use shapelex_core::baseline::{
    BaselineClass, BaselineIndex, BaselineModel, BaselineShape, SignatureDistances, Vocabulary,
};
use std::collections::BTreeMap;

const VOCABULARY: &str = "/vocabulary";
const EIGENVALUES: &str = "shape_dna";
const DISTANCES: &str = "signature_distances";
const WORDS: &str = "bag_of_words";

/// What the metadata says about the baselines.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Baselines {
    /// Distance at the end of the histograms' last bin.
    largest: f64,
    /// Seed of the pairs the distances are taken of.
    seed: u64,
    /// Class → what its shapes are called.
    shapes: BTreeMap<String, Vec<String>>,
}

/// Adds the tensors and says what belongs into the metadata.
pub(super) fn write(index: &BaselineIndex, tensors: &mut Tensors) -> Baselines {
    let words = &index.model.vocabulary.words;
    let (rows, columns) = (words.nrows(), words.ncols());
    let values = (0..rows).flat_map(|i| (0..columns).map(move |j| words[(i, j)]));
    let bytes = values.flat_map(f64::to_le_bytes).collect();
    tensors.insert(VOCABULARY.to_owned(), (Dtype::F64, vec![rows, columns], bytes));
    for class in &index.classes {
        let count = class.shapes.len();
        let mut add = |what: &str, kind: Dtype, width: usize, bytes: Vec<u8>| {
            tensors.insert(
                format!("{}/{what}", class.label),
                (kind, vec![count, width], bytes),
            );
        };
        let width = class
            .shapes
            .iter()
            .map(|s| s.eigenvalues.len())
            .max()
            .unwrap_or(0);
        let filled = class.shapes.iter().flat_map(|s| {
            let rest = std::iter::repeat_n(f64::NAN, width - s.eigenvalues.len());
            s.eigenvalues.iter().copied().chain(rest)
        });
        add(
            EIGENVALUES,
            Dtype::F64,
            width,
            filled.flat_map(f64::to_le_bytes).collect(),
        );
        for (what, values) in [
            (DISTANCES, (|s| &s.distances) as fn(&BaselineShape) -> &Vec<f32>),
            (WORDS, |s| &s.words),
        ] {
            let width = class.shapes.first().map_or(0, |s| values(s).len());
            let all = class.shapes.iter().flat_map(values);
            add(
                what,
                Dtype::F32,
                width,
                all.flat_map(|v| v.to_le_bytes()).collect(),
            );
        }
    }
    let shapes = index.classes.iter().map(|class| {
        let names = class.shapes.iter().map(|s| s.label.clone()).collect();
        (class.label.clone(), names)
    });
    Baselines {
        largest: index.model.distances.largest,
        seed: index.model.seed,
        shapes: shapes.collect(),
    }
}

/// The baselines of a file.
///
/// # Errors
/// One sentence where a tensor is missing or not as long as the metadata has it.
pub(super) fn read(described: &Baselines, tensors: &SafeTensors<'_>) -> Result<BaselineIndex, String> {
    let words = Rows::<f64>::read(tensors, VOCABULARY, None)?;
    let classes = described.shapes.iter().map(|(class, names)| {
        let of = |what: &str| format!("{class}/{what}");
        let eigenvalues = Rows::<f64>::read(tensors, &of(EIGENVALUES), Some(names.len()))?;
        let distances = Rows::<f32>::read(tensors, &of(DISTANCES), Some(names.len()))?;
        let histograms = Rows::<f32>::read(tensors, &of(WORDS), Some(names.len()))?;
        let shapes = names.iter().enumerate().map(|(i, label)| BaselineShape {
            label: label.clone(),
            eigenvalues: eigenvalues
                .row(i)
                .iter()
                .copied()
                .take_while(|v| !v.is_nan())
                .collect(),
            distances: distances.row(i).to_vec(),
            words: histograms.row(i).to_vec(),
        });
        Ok(BaselineClass {
            label: class.clone(),
            shapes: shapes.collect(),
        })
    });
    Ok(BaselineIndex {
        classes: classes.collect::<Result<_, String>>()?,
        model: BaselineModel {
            distances: SignatureDistances {
                largest: described.largest,
            },
            vocabulary: Vocabulary {
                words: Mat::from_fn(words.count, words.width, |i, j| words.row(i)[j]),
            },
            seed: described.seed,
        },
    })
}

/// A matrix by rows.
struct Rows<T> {
    values: Vec<T>,
    count: usize,
    width: usize,
}

/// A number as tensors have it.
trait Number: Sized {
    const KIND: Dtype;
    fn all(bytes: &[u8]) -> Vec<Self>;
}

impl Number for f64 {
    const KIND: Dtype = Dtype::F64;
    fn all(bytes: &[u8]) -> Vec<Self> {
        bytes
            .as_chunks()
            .0
            .iter()
            .map(|b| Self::from_le_bytes(*b))
            .collect()
    }
}

impl Number for f32 {
    const KIND: Dtype = Dtype::F32;
    fn all(bytes: &[u8]) -> Vec<Self> {
        bytes
            .as_chunks()
            .0
            .iter()
            .map(|b| Self::from_le_bytes(*b))
            .collect()
    }
}

impl<T: Number> Rows<T> {
    fn read(tensors: &SafeTensors<'_>, name: &str, count: Option<usize>) -> Result<Self, String> {
        let tensor = tensors
            .tensor(name)
            .map_err(|_| format!("tensor '{name}' is missing"))?;
        match *tensor.shape() {
            [rows, width] if tensor.dtype() == T::KIND && count.is_none_or(|count| count == rows) => {
                Ok(Self {
                    values: T::all(tensor.data()),
                    count: rows,
                    width,
                })
            }
            _ => Err(format!("tensor '{name}' does not go with the metadata")),
        }
    }

    fn row(&self, i: usize) -> &[T] {
        &self.values[i * self.width..][..self.width]
    }
}
