//! Stored files → cached descriptions.

use super::failure::{ReindexError, code, panic_text};
use super::progress::Progress;
use crate::cancel::Cancel;
use crate::mesh::{self, Companion, Format, Limits, Source, TriangleSoup};
use crate::model::{ContentHash, FailedShape, Shape};
use crate::parameters::Parameters;
use crate::pipeline::{Description, PipelineError, StageSpan, describe_shape};
use crate::store::{OriginalDamage, Store, StoreError};
use bytes::Bytes;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The code of a file that could not be opened because too many are.
const OUT_OF_DESCRIPTORS: &str = "out_of_descriptors";

/// Why a shape has no description.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    pub(super) code: &'static str,
    pub(super) detail: String,
}

impl Failure {
    fn new(code: &'static str, detail: impl Into<String>) -> Self {
        Self {
            code,
            detail: detail.into(),
        }
    }

    /// Whether the same shape may well be described a moment later.
    pub(super) fn is_passing(&self) -> bool {
        self.code == OUT_OF_DESCRIPTORS
    }

    pub(super) fn of(&self, shape: &Shape) -> FailedShape {
        FailedShape {
            class: shape.class,
            shape: shape.id,
            code: self.code.to_owned(),
            detail: self.detail.clone(),
        }
    }
}

impl From<PipelineError> for Failure {
    fn from(error: PipelineError) -> Self {
        Self::new(code(&error), error.to_string())
    }
}

/// Describes shapes with one set of parameters.
pub(super) struct Describer<'a> {
    pub(super) store: &'a Store,
    pub(super) limits: &'a Limits,
    pub(super) parameters: &'a Parameters,
    pub(super) fingerprint: String,
    pub(super) cancel: &'a Cancel,
}

/// What describing many shapes came to.
#[derive(Default)]
pub(super) struct Described {
    /// By the identity of the shape.
    pub(super) failures: BTreeMap<ContentHash, Failure>,
    pub(super) computed: usize,
    pub(super) cached: usize,
}

impl Describer<'_> {
    /// Describes what is not described yet, in parallel, and keeps the descriptions in the store's cache. A file that
    /// gives several poses is read once.
    pub(super) fn describe_all(
        &self,
        shapes: &[&Shape],
        progress: &Progress,
    ) -> Result<Described, ReindexError> {
        let mut sources: BTreeMap<_, Vec<&Shape>> = BTreeMap::new();
        for shape in shapes {
            let mut source = (*shape).clone();
            source.pose = None;
            let of = shape.pose.as_ref().map(|pose| pose.of);
            sources.entry((source.identity(), of)).or_default().push(shape);
        }
        let (computed, cached) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let failures = Mutex::new(BTreeMap::new());
        let sources: Vec<_> = sources.into_values().collect();
        sources.par_iter().with_max_len(1).for_each(|poses| {
            let (there, missing): (Vec<&Shape>, Vec<&Shape>) = poses
                .iter()
                .partition(|s| self.store.has_signatures(s.identity(), &self.fingerprint));
            cached.fetch_add(there.len(), Ordering::Relaxed);
            there.iter().for_each(|_| progress.advance());
            if missing.is_empty() || self.cancel.is_cancelled() {
                return;
            }
            let soups = guarded(|| self.read(&missing));
            missing.par_iter().enumerate().for_each(|(i, shape)| {
                let _span =
                    tracing::info_span!(parent: progress.step(), "describe", shape = %shape.id).entered();
                let described = match &soups {
                    Ok(soups) => guarded(|| self.describe(shape, soups[i].clone())),
                    Err(failure) => Err(failure.clone()),
                };
                match described {
                    Ok(_) => {
                        computed.fetch_add(1, Ordering::Relaxed);
                    }
                    Err(failure) => {
                        // Only inserts happen under this lock, and they do not panic.
                        if let Ok(mut failures) = failures.lock() {
                            failures.insert(shape.identity(), failure);
                        }
                    }
                }
                progress.advance();
            });
        });
        if self.cancel.is_cancelled() {
            return Err(ReindexError::Cancelled);
        }
        let failures = failures.into_inner().unwrap_or_default();
        // The file is fine; without it the class would be learnt from less than it has.
        if let Some(failure) = failures.values().find(|failure| failure.is_passing()) {
            return Err(ReindexError::Later(failure.detail.clone()));
        }
        Ok(Described {
            failures,
            computed: computed.into_inner(),
            cached: cached.into_inner(),
        })
    }

    /// A shape's description, from the cache where it is there.
    pub(super) fn description(&self, shape: &Shape) -> Result<Description, Failure> {
        if let Some(description) = self.store.signatures(shape.identity(), &self.fingerprint) {
            return Ok(description);
        }
        guarded(|| {
            let soup = self.read(&[shape])?.remove(0);
            self.describe(shape, soup)
        })
    }

    fn describe(&self, shape: &Shape, soup: TriangleSoup) -> Result<Description, Failure> {
        let stages = StageSpan::default();
        let description = describe_shape(soup, self.parameters, self.cancel, &|stage| stages.begin(stage))?;
        drop(stages);
        let kept = self
            .store
            .put_signatures(shape.identity(), &self.fingerprint, &description);
        if let Err(error) = kept {
            tracing::warn!(%error, shape = %shape.id, "signatures were not cached and will be computed again");
        }
        Ok(description)
    }

    /// The meshes of shapes that come from one file, in their order.
    fn read(&self, shapes: &[&Shape]) -> Result<Vec<TriangleSoup>, Failure> {
        let Some(shape) = shapes.first() else {
            return Ok(Vec::new());
        };
        let load = |content| {
            self.store
                .original(content)
                .map_err(|e| Failure::new(original_failure(&e), e.to_string()))
        };
        let bytes = load(shape.content)?;
        // A file under several names is loaded once.
        let mut loaded: BTreeMap<ContentHash, Bytes> = BTreeMap::new();
        let mut companions = Vec::with_capacity(shape.companions.len());
        for file in &shape.companions {
            let bytes = match loaded.entry(file.content) {
                Entry::Occupied(known) => known.get().clone(),
                Entry::Vacant(slot) => slot.insert(Bytes::from(load(file.content)?)).clone(),
            };
            companions.push(Companion::new(file.name.clone(), bytes));
        }
        let source = Source {
            bytes: &bytes,
            name: Some(name_of(shape.format)),
            media_type: None,
            companions: &companions,
        };
        let unusable = |e: mesh::MeshError| Failure::from(PipelineError::from(e));
        let Some(pose) = &shape.pose else {
            let (_, soup) = mesh::read(&source, self.limits).map_err(unusable)?;
            return Ok(vec![soup; shapes.len()]);
        };
        let (_, poses) = mesh::read_poses(&source, pose.of, self.limits).map_err(unusable)?;
        shapes
            .iter()
            .map(|shape| {
                let index = shape.pose.as_ref().map_or(0, |pose| pose.index);
                poses.get(index).map(|pose| pose.soup.clone()).ok_or_else(|| {
                    Failure::new(
                        "mesh_unusable",
                        format!("the file gives {} poses, not pose {index}", poses.len()),
                    )
                })
            })
            .collect()
    }
}

/// The stable name of a failure to read a stored file.
fn original_failure(error: &StoreError) -> &'static str {
    match error {
        StoreError::Original {
            damage: OriginalDamage::Missing,
            ..
        } => "original_missing",
        StoreError::Original { .. } => "original_damaged",
        StoreError::Denied { .. } => "storage_denied",
        StoreError::OutOfDescriptors { .. } => OUT_OF_DESCRIPTORS,
        _ => "file_unreadable",
    }
}

/// The format was found when the shape was uploaded; a name with its ending finds it again where the bytes alone do
/// not tell, whatever the file was called then.
fn name_of(format: Format) -> &'static str {
    match format {
        Format::Obj => "shape.obj",
        Format::Gltf => "shape.gltf",
        Format::Glb => "shape.glb",
        Format::Ply => "shape.ply",
        Format::Stl => "shape.stl",
        Format::Off => "shape.off",
    }
}

/// One shape's panic is that shape's failure.
fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic_text(panic.as_ref());
        tracing::error!(text, "describing a shape panicked");
        Err(Failure::new("internal", format!("a defect in shapelex: {text}")))
    })
}
