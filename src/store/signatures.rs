//! Cached descriptions of training shapes, so that learning again does not repeat the spectral work:
//! `signatures/ab/abcd…-<fingerprint>`, named after the shape's identity and what gave it its signatures.
//!
//! A cache: every file can be made again, so none is synced, and one that fails its checksum is as good as missing.

use super::payload::{from_json, only, pack, to_json, unpack};
use super::record::{Family, Record, seal, unseal};
use super::{Store, StoreError, files};
use crate::model::ContentHash;
use faer::Mat;
use serde::{Deserialize, Serialize};
use shapelex_core::mesh::PrepareReport;
use shapelex_core::parameters::{Channel, Hypothesis};
use shapelex_core::pipeline::Description;
use shapelex_core::ranking::View;
use shapelex_core::signature::Signatures;
use std::path::PathBuf;

#[derive(Serialize, Deserialize)]
struct ViewV1 {
    hypothesis: u8,
    channel: u8,
    area_scale: f64,
    rows: u32,
    columns: u32,
    /// Column after column. 64-bit, so that learning from the cache gives the bytes learning afresh gives.
    values: Vec<f64>,
    vertices: Vec<u32>,
}

#[derive(Serialize, Deserialize)]
struct DescriptionV1 {
    views: Vec<ViewV1>,
    report: String,
    eigenvalues: Vec<f64>,
}

const HYPOTHESES: [Hypothesis; 3] = [Hypothesis::Plain, Hypothesis::Whitened, Hypothesis::Doubled];
const CHANNELS: [Channel; 3] = [Channel::Plain, Channel::Whitened, Channel::FixedGrid];

fn number_of<T: PartialEq>(list: &[T], item: &T) -> Result<u8, String> {
    list.iter()
        .position(|i| i == item)
        .and_then(|i| u8::try_from(i).ok())
        .ok_or_else(|| "a view of an unknown kind".to_owned())
}

impl Record for Description {
    const FAMILY: Family = Family::Signatures;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        let views = self
            .views
            .iter()
            .map(|view| {
                let matrix = &view.signatures.matrix;
                let narrow = |n: usize| u32::try_from(n).map_err(|e| e.to_string());
                Ok(ViewV1 {
                    hypothesis: number_of(&HYPOTHESES, &view.hypothesis)?,
                    channel: number_of(&CHANNELS, &view.channel)?,
                    area_scale: view.area_scale,
                    rows: narrow(matrix.nrows())?,
                    columns: narrow(matrix.ncols())?,
                    values: (0..matrix.ncols())
                        .flat_map(|j| (0..matrix.nrows()).map(move |i| matrix[(i, j)]))
                        .collect(),
                    vertices: view.signatures.vertices.clone(),
                })
            })
            .collect::<Result<_, String>>()?;
        pack(&DescriptionV1 {
            views,
            report: to_json(&self.report)?,
            eigenvalues: self.eigenvalues.clone(),
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let v: DescriptionV1 = unpack(payload)?;
        let report: PrepareReport = from_json(&v.report)?;
        let views = v
            .views
            .into_iter()
            .map(|view| {
                let (rows, columns) = (view.rows as usize, view.columns as usize);
                if rows.checked_mul(columns) != Some(view.values.len()) || view.vertices.len() != columns {
                    return Err("a view's size is not that of its values".to_owned());
                }
                let unknown = || "a view of an unknown kind".to_owned();
                Ok(View {
                    hypothesis: *HYPOTHESES.get(usize::from(view.hypothesis)).ok_or_else(unknown)?,
                    channel: *CHANNELS.get(usize::from(view.channel)).ok_or_else(unknown)?,
                    area_scale: view.area_scale,
                    bounded: report.openness > 0.0,
                    signatures: Signatures {
                        matrix: Mat::from_fn(rows, columns, |i, j| view.values[j * rows + i]),
                        vertices: view.vertices,
                    },
                })
            })
            .collect::<Result<_, String>>()?;
        Ok(Self {
            views,
            report,
            eigenvalues: v.eigenvalues,
        })
    }
}

pub(super) fn file_name(identity: ContentHash, fingerprint: &str) -> String {
    format!("{identity}-{fingerprint}")
}

impl Store {
    fn signatures_path(&self, name: &str) -> PathBuf {
        self.inner.path.join("signatures").join(&name[..2]).join(name)
    }

    /// The cached description of a shape under parameters of the given
    /// [`description_fingerprint`](shapelex_core::parameters::Parameters::description_fingerprint); `None` where there is
    /// none, or none that can be read.
    pub fn signatures(&self, identity: ContentHash, fingerprint: &str) -> Option<Description> {
        let name = file_name(identity, fingerprint);
        let path = self.signatures_path(&name);
        let bytes = std::fs::read(&path).ok()?;
        match unseal(name.as_bytes(), &bytes) {
            Ok(description) => Some(description),
            Err(error) => {
                tracing::warn!(%error, "cached signatures are made again");
                let _ = files::remove(&path);
                None
            }
        }
    }

    /// Whether a description is cached; reading it may still find it damaged.
    pub fn has_signatures(&self, identity: ContentHash, fingerprint: &str) -> bool {
        self.signatures_path(&file_name(identity, fingerprint)).exists()
    }

    /// Caches a description.
    ///
    /// # Errors
    /// A failure of the file system. The store stays writable: nothing of worth was lost.
    pub fn put_signatures(
        &self,
        identity: ContentHash,
        fingerprint: &str,
        description: &Description,
    ) -> Result<(), StoreError> {
        let name = file_name(identity, fingerprint);
        let bytes = seal(name.as_bytes(), description)?;
        files::write_lazily(&self.signatures_path(&name), &bytes)
    }
}
