//! Dictionaries in a safetensors file, readable from Python.
//!
//! One tensor per class and channel, named `<class>/<channel>`: M rows × L columns of little-endian f32, one atom per
//! column. The metadata has one key, `shapelex`: JSON with the file's format, the parameters, the classes, and since format
//! 2 what learning did (the held-out scores that answers are calibrated by among it) and what the baselines need
//! ([`exported_baselines`](super::exported_baselines)). Classes' names may hold a `/`, so the channel is what follows the
//! last one.

use super::CliError;
use super::exported_baselines::{self, Baselines};
use super::tensors::Tensors;
use faer::Mat;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use shapelex_core::baseline::BaselineIndex;
use shapelex_core::coding::Dictionary;
use shapelex_core::parameters::{Channel, Parameters};
use shapelex_core::pipeline::ModelReport;
use shapelex_core::ranking::{Calibration, Index, IndexedClass};
use shapelex_core::retrieval::SearchIndex;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// The file format's number; a reader refuses greater ones.
const FORMAT: u32 = 2;
/// The metadata's only key.
const KEY: &str = "shapelex";

/// What a file of dictionaries holds. Labels are the classes' names.
#[derive(Clone, Debug)]
pub struct Exported {
    /// Classes with their dictionaries, and the parameters they were learnt with.
    pub index: Index,
    /// What the file says about each class.
    pub classes: Vec<ExportedClass>,
    /// What learning did, by class; empty in a file of format 1.
    pub reports: BTreeMap<String, ModelReport>,
    /// What the baselines need; `None` where the index was without, and in a file of format 1.
    pub baselines: Option<BaselineIndex>,
}

impl Exported {
    /// What an index learnt from shapes has and this does not, one clause each.
    pub fn absent(&self) -> Vec<&'static str> {
        let mut absent = vec!["the training shapes"];
        if self.reports.values().all(|report| report.held_out.is_empty()) {
            absent.push("the calibration, so no answer is judged");
        }
        if self.baselines.is_none() {
            absent.push("what the baselines need, so queries rank by sparse coding only");
        }
        absent
    }

    /// What a query is compared with.
    pub fn into_search_index(self) -> SearchIndex {
        let reports = self.reports.iter();
        SearchIndex {
            calibration: Calibration::fit(reports.map(|(name, report)| report.held_out(name))),
            dictionaries: self.index,
            names: BTreeMap::new(),
            baselines: self.baselines,
        }
    }
}

/// What a file says about a class.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExportedClass {
    /// Its name.
    pub name: String,
    /// Shapes it was learnt from.
    pub shapes: usize,
}

#[derive(Serialize, Deserialize)]
struct Metadata {
    format: u32,
    parameters: Parameters,
    classes: Vec<ExportedClass>,
    #[serde(default)]
    reports: BTreeMap<String, ModelReport>,
    #[serde(default)]
    baselines: Option<Baselines>,
}

/// Writes a file's contents. Equal input gives equal bytes.
///
/// # Errors
/// [`CliError::Failed`] where the format's library refuses.
pub fn to_bytes(exported: &Exported) -> Result<Vec<u8>, CliError> {
    let failed = |error: &dyn std::fmt::Display| CliError::Failed(format!("writing safetensors: {error}"));
    let mut tensors = Tensors::new();
    for class in &exported.index.classes {
        for (channel, dictionary) in &class.dictionaries {
            let atoms = dictionary.atoms();
            let atoms = atoms.as_ref();
            let (rows, columns) = (atoms.nrows(), atoms.ncols());
            let bytes = (0..rows)
                .flat_map(|i| (0..columns).map(move |j| atoms[(i, j)] as f32))
                .flat_map(f32::to_le_bytes)
                .collect();
            let name = format!("{}/{}", class.label, channel_name(*channel));
            tensors.insert(name, (Dtype::F32, vec![rows, columns], bytes));
        }
    }
    let metadata = Metadata {
        format: FORMAT,
        parameters: exported.index.parameters.clone(),
        classes: exported.classes.clone(),
        reports: exported.reports.clone(),
        baselines: exported
            .baselines
            .as_ref()
            .map(|baselines| exported_baselines::write(baselines, &mut tensors)),
    };
    let metadata = serde_json::to_string(&metadata).map_err(|error| failed(&error))?;
    let views = tensors
        .iter()
        .map(|(name, (kind, shape, bytes))| Ok((name, TensorView::new(*kind, shape.clone(), bytes)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(|error| failed(&error))?;
    safetensors::serialize(views, Some(HashMap::from([(KEY.to_owned(), metadata)])))
        .map_err(|error| failed(&error))
}

/// Reads a file.
///
/// # Errors
/// [`CliError::Usage`] where there is no such file; [`CliError::Failed`] with the path and what is wrong.
pub fn load(path: &Path) -> Result<Exported, CliError> {
    if !path.is_file() {
        let what = if path.is_dir() {
            "this is a folder"
        } else {
            "there is no such file"
        };
        return Err(CliError::Usage(format!(
            "{}: {what}; expected a file written by `shapelex export`",
            path.display()
        )));
    }
    let bytes = std::fs::read(path).map_err(|error| CliError::at(path, error))?;
    from_bytes(&bytes).map_err(|reason| CliError::at(path, reason))
}

/// Reads a file's contents; every dictionary is checked.
///
/// # Errors
/// One sentence.
pub fn from_bytes(bytes: &[u8]) -> Result<Exported, String> {
    let unreadable = |error: &dyn std::fmt::Display| format!("not a file of shapelex dictionaries: {error}");
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| unreadable(&error))?;
    let metadata = header
        .metadata()
        .as_ref()
        .and_then(|m| m.get(KEY))
        .ok_or_else(|| unreadable(&"its metadata has no entry 'shapelex'"))?;
    #[derive(Deserialize)]
    struct Version {
        format: u32,
    }
    let version: Version = serde_json::from_str(metadata).map_err(|error| unreadable(&error))?;
    if !(1..=FORMAT).contains(&version.format) {
        return Err(format!(
            "the file has format {}, this shapelex reads formats 1 to {FORMAT}; use a newer one",
            version.format
        ));
    }
    let metadata: Metadata = serde_json::from_str(metadata).map_err(|error| unreadable(&error))?;
    metadata
        .parameters
        .validate()
        .map_err(|error| error.to_string())?;
    let tensors = SafeTensors::deserialize(bytes).map_err(|error| unreadable(&error))?;
    let channels = metadata.parameters.channels();
    let classes = metadata
        .classes
        .iter()
        .map(|class| {
            let dictionaries = channels
                .iter()
                .map(|&channel| {
                    let name = format!("{}/{}", class.name, channel_name(channel));
                    let tensor = tensors
                        .tensor(&name)
                        .map_err(|_| format!("tensor '{name}' is missing"))?;
                    let dictionary =
                        dictionary(&tensor).map_err(|reason| format!("tensor '{name}': {reason}"))?;
                    Ok((channel, Arc::new(dictionary)))
                })
                .collect::<Result<BTreeMap<_, _>, String>>()?;
            Ok(IndexedClass {
                label: class.name.clone(),
                dictionaries,
                shapes: Vec::new(),
            })
        })
        .collect::<Result<Vec<_>, String>>()?;
    let baselines = metadata
        .baselines
        .as_ref()
        .map(|described| exported_baselines::read(described, &tensors))
        .transpose()?;
    Ok(Exported {
        index: Index {
            parameters: metadata.parameters,
            classes,
        },
        classes: metadata.classes,
        reports: metadata.reports,
        baselines,
    })
}

fn dictionary(tensor: &TensorView<'_>) -> Result<Dictionary, String> {
    let &[rows, columns] = tensor.shape() else {
        return Err(format!(
            "expected a matrix, found {} dimensions",
            tensor.shape().len()
        ));
    };
    if tensor.dtype() != Dtype::F32 {
        return Err(format!("expected f32, found {:?}", tensor.dtype()));
    }
    let (values, _) = tensor.data().as_chunks::<4>();
    // The library has checked that the data has rows × columns values.
    let atoms = Mat::from_fn(rows, columns, |i, j| {
        f64::from(f32::from_le_bytes(values[i * columns + j]))
    });
    Dictionary::new(atoms).map_err(|error| error.to_string())
}

/// The channel's name in tensors: as it is serialised everywhere else.
fn channel_name(channel: Channel) -> &'static str {
    match channel {
        Channel::Plain => "plain",
        Channel::Whitened => "whitened",
        Channel::FixedGrid => "fixed_grid",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exported() -> Exported {
        let atoms = Mat::from_fn(3, 2, |i, j| if i == j { 1.0 } else { 0.0 });
        let dictionary = Arc::new(Dictionary::new(atoms).unwrap());
        let parameters = Parameters::default();
        let channels = parameters.channels();
        let class = |label: &str| IndexedClass {
            label: label.to_owned(),
            dictionaries: channels.iter().map(|&c| (c, dictionary.clone())).collect(),
            shapes: Vec::new(),
        };
        Exported {
            index: Index {
                parameters: parameters.clone(),
                classes: vec![class("cat"), class("great dane/old")],
            },
            classes: ["cat", "great dane/old"]
                .map(|name| ExportedClass {
                    name: name.to_owned(),
                    shapes: 6,
                })
                .to_vec(),
            reports: BTreeMap::from([(
                "cat".to_owned(),
                ModelReport {
                    held_out: vec![0.1, 0.2],
                    ..ModelReport::default()
                },
            )]),
            baselines: Some(baselines()),
        }
    }

    fn baselines() -> BaselineIndex {
        let shape = |label: &str, eigenvalues: &[f64]| shapelex_core::baseline::BaselineShape {
            label: label.to_owned(),
            eigenvalues: eigenvalues.to_vec(),
            distances: vec![0.25, 0.75],
            words: vec![1.0, 0.0, 0.0],
        };
        let class = |label: &str, shapes| shapelex_core::baseline::BaselineClass {
            label: label.to_owned(),
            shapes,
        };
        BaselineIndex {
            model: shapelex_core::baseline::BaselineModel {
                distances: shapelex_core::baseline::SignatureDistances { largest: 2.5 },
                vocabulary: shapelex_core::baseline::Vocabulary {
                    words: Mat::from_fn(4, 3, |i, j| (i * 3 + j) as f64 / 7.0),
                },
                seed: 9,
            },
            classes: vec![
                class("cat", vec![shape("a", &[1.0, 2.0]), shape("b", &[3.0])]),
                class("great dane/old", Vec::new()),
            ],
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let before = exported();
        let bytes = to_bytes(&before).unwrap();
        assert_eq!(bytes, to_bytes(&before).unwrap());
        let after = from_bytes(&bytes).unwrap();
        assert_eq!(after.classes, before.classes);
        assert_eq!(after.index.parameters, before.index.parameters);
        let atoms = |e: &Exported, i: usize| {
            e.index.classes[i].dictionaries[&Channel::Plain]
                .atoms()
                .into_owned()
        };
        assert_eq!(atoms(&after, 1), atoms(&before, 1));
        assert_eq!(after.reports, before.reports);
        let (read, written) = (after.baselines.unwrap(), before.baselines.unwrap());
        assert_eq!(read.classes, written.classes);
        assert_eq!(read.model.vocabulary.words, written.model.vocabulary.words);
        assert_eq!((read.model.distances.largest, read.model.seed), (2.5, 9));
    }

    #[test]
    fn a_file_of_format_1_says_nothing_of_calibration_and_baselines() {
        let bytes = to_bytes(&exported()).unwrap();
        let (length, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let mut metadata: serde_json::Value =
            serde_json::from_str(&header.metadata().as_ref().unwrap()[KEY]).unwrap();
        for key in ["reports", "baselines"] {
            metadata.as_object_mut().unwrap().remove(key);
        }
        metadata["format"] = 1.into();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        let views = tensors.tensors();
        let old = safetensors::serialize(
            views,
            Some(HashMap::from([(KEY.to_owned(), metadata.to_string())])),
        );
        let old = from_bytes(&old.unwrap()).unwrap();
        assert!(length > 0 && old.baselines.is_none() && old.reports.is_empty());
        assert_eq!(old.absent().len(), 3, "{:?}", old.absent());
        metadata["format"] = 3.into();
        let newer = safetensors::serialize(
            tensors.tensors(),
            Some(HashMap::from([(KEY.to_owned(), metadata.to_string())])),
        );
        assert!(from_bytes(&newer.unwrap()).unwrap_err().contains("format 3"));
    }

    #[test]
    fn other_files_are_refused() {
        assert!(from_bytes(b"").unwrap_err().contains("not a file"));
        let bytes = to_bytes(&exported()).unwrap();
        assert!(from_bytes(&bytes[..bytes.len() - 4]).is_err(), "cut short");
        let mut missing = exported();
        missing.classes.push(ExportedClass {
            name: "dog".to_owned(),
            shapes: 1,
        });
        let error = from_bytes(&to_bytes(&missing).unwrap()).unwrap_err();
        assert_eq!(error, "tensor 'dog/plain' is missing");
    }
}
