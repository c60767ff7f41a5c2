//! Stored files → cached descriptions.

use super::failure::{MEMORY_EXCEEDED, ReindexError, code, no_memory, panic_text};
use super::progress::Progress;
use super::share::Share;
use crate::model::{ContentHash, FailedShape, Shape};
use crate::store::{OriginalDamage, Store, StoreError};
use bytes::Bytes;
use rayon::prelude::*;
use shapelex_core::cancel::Cancel;
use shapelex_core::memory::{MemoryBudget, MemoryError};
use shapelex_core::mesh::{self, Companion, Format, Limits, ReadContext, Source, TriangleSoup};
use shapelex_core::parameters::Parameters;
use shapelex_core::pipeline::estimate::{self, Role};
use shapelex_core::pipeline::{Description, PipelineError, StageSpan, Within, describe_shape_within};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

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

impl From<MemoryError> for Failure {
    fn from(error: MemoryError) -> Self {
        Self::new(MEMORY_EXCEEDED, no_memory("describing the shape", &error))
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
    /// What is left of the memory for reindexing beside the index that is served.
    pub(super) share: Share,
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
        let sources: Vec<Vec<&Shape>> = sources.into_values().collect();
        let work = Describing {
            describer: self,
            progress,
            failures: Mutex::default(),
            computed: AtomicUsize::new(0),
            cached: AtomicUsize::new(0),
        };
        // One whose file takes more to read than most of its length has the whole share for itself.
        let again = work.run(&sources, self.share);
        let again: Vec<Vec<&Shape>> = again.into_iter().map(|i| sources[i].clone()).collect();
        let failed = work.run(&again, self.share.alone());
        for poses in failed.into_iter().map(|i| &again[i]) {
            let needed = self.source_bytes(poses).max(self.share.bytes + 1);
            let limit = self.share.bytes;
            work.fail(poses, &MemoryError::NeverFits { needed, limit }.into());
        }
        if self.cancel.is_cancelled() {
            return Err(ReindexError::Cancelled);
        }
        let failures = work.failures.into_inner().unwrap_or_default();
        // The file is fine; without it the class would be learnt from less than it has.
        if let Some(failure) = failures.values().find(|failure| failure.is_passing()) {
            return Err(ReindexError::Later(failure.detail.clone()));
        }
        Ok(Described {
            failures,
            computed: work.computed.into_inner(),
            cached: work.cached.into_inner(),
        })
    }

    /// Memory that reading a file and describing the poses of it takes at most, in bytes.
    fn source_bytes(&self, poses: &[&Shape]) -> u64 {
        let largest = poses.iter().map(|shape| self.shape_bytes(shape)).max();
        let side_by_side = poses.len().min(self.share.threads) as u64;
        let soups: u64 = poses.iter().map(|shape| soup_bytes(shape)).sum();
        let file = poses.first().map_or(0, |shape| shape.bytes);
        FILE_COPIES * file + 2 * soups + side_by_side * largest.unwrap_or(0)
    }

    /// Memory that describing a shape takes at most, in bytes, its file not counted.
    pub(super) fn shape_bytes(&self, shape: &Shape) -> u64 {
        let (vertices, faces) = (shape.report.input_vertices, shape.report.input_faces);
        estimate::preparing_bytes(vertices, faces).max(estimate::describing_bytes(
            vertices,
            self.parameters,
            Role::Training,
        ))
    }

    /// Memory that a shape's description takes at most, in bytes.
    pub(super) fn description_bytes(&self, shape: &Shape) -> u64 {
        let vertices = estimate::prepared_vertices(shape.report.input_vertices, self.parameters);
        estimate::description_bytes(vertices, self.parameters, Role::Training)
    }

    /// A shape's description, from the cache where it is there.
    pub(super) fn description(&self, shape: &Shape) -> Result<Description, Failure> {
        if let Some(description) = self.store.signatures(shape.identity(), &self.fingerprint) {
            return Ok(description);
        }
        guarded(|| {
            let soup = self
                .read(&[shape], &MemoryBudget::new(self.share.bytes))?
                .remove(0);
            self.describe(shape, soup)
        })
    }

    fn describe(&self, shape: &Shape, soup: TriangleSoup) -> Result<Description, Failure> {
        let stages = StageSpan::default();
        // What a mesh that is no surface takes is known only now.
        let memory = MemoryBudget::new(self.share.bytes).reservation();
        let within = Within {
            cancel: self.cancel,
            memory: &memory,
        };
        let description = describe_shape_within(soup, self.parameters, within, &|stage| stages.begin(stage))?;
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
    fn read(&self, shapes: &[&Shape], budget: &MemoryBudget) -> Result<Vec<TriangleSoup>, Failure> {
        let Some(shape) = shapes.first() else {
            return Ok(Vec::new());
        };
        let context = ReadContext {
            cancel: self.cancel.clone(),
            memory: Arc::new(budget.reservation()),
            ..ReadContext::new(*self.limits)
        };
        context.memory.grow(shape.bytes)?;
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
            let (_, soup) = mesh::read_within(&source, &context).map_err(unusable)?;
            return Ok(vec![soup; shapes.len()]);
        };
        let (_, poses) = mesh::read_poses_within(&source, pose.of, &context).map_err(unusable)?;
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

/// A file is held as stored, and its parts again while they are decoded and parsed.
const FILE_COPIES: u64 = 4;

/// Memory of a shape's mesh as read, in bytes.
fn soup_bytes(shape: &Shape) -> u64 {
    (24 * shape.report.input_vertices + 12 * shape.report.input_faces) as u64
}

/// Many files being described.
struct Describing<'a> {
    describer: &'a Describer<'a>,
    progress: &'a Progress,
    failures: Mutex<BTreeMap<ContentHash, Failure>>,
    computed: AtomicUsize,
    cached: AtomicUsize,
}

impl Describing<'_> {
    /// Describes what fits; returns the numbers of the files for which there was too little memory.
    fn run(&self, sources: &[Vec<&Shape>], share: Share) -> Vec<usize> {
        let estimates: Vec<u64> = sources
            .iter()
            .map(|poses| self.describer.source_bytes(poses))
            .collect();
        let results = share.run(&estimates, |i, budget| self.source(&sources[i], budget));
        let too_little =
            |(i, fits): (usize, Result<bool, MemoryError>)| (!fits.unwrap_or(false)).then_some(i);
        results.into_iter().enumerate().filter_map(too_little).collect()
    }

    /// Describes the poses of one file; `false` where reading it would take more than the budget.
    fn source(&self, poses: &[&Shape], budget: &MemoryBudget) -> bool {
        let describer = self.describer;
        let (there, missing): (Vec<&Shape>, Vec<&Shape>) = poses.iter().partition(|s| {
            describer
                .store
                .has_signatures(s.identity(), &describer.fingerprint)
        });
        if !missing.is_empty() && !describer.cancel.is_cancelled() {
            let soups = match guarded(|| describer.read(&missing, budget)) {
                Err(failure) if failure.code == MEMORY_EXCEEDED => return false,
                other => other,
            };
            missing
                .par_iter()
                .enumerate()
                .for_each(|(i, shape)| self.shape(shape, soups.as_ref().map(|soups| &soups[i])));
        }
        self.cached.fetch_add(there.len(), Ordering::Relaxed);
        there.iter().for_each(|_| self.progress.advance());
        true
    }

    fn shape(&self, shape: &Shape, soup: Result<&TriangleSoup, &Failure>) {
        let _span =
            tracing::info_span!(parent: self.progress.step(), "describe", shape = %shape.id).entered();
        let described = match soup {
            Ok(soup) => guarded(|| self.describer.describe(shape, soup.clone())),
            Err(failure) => Err(failure.clone()),
        };
        match described {
            Ok(_) => {
                self.computed.fetch_add(1, Ordering::Relaxed);
                self.progress.advance();
            }
            Err(failure) => self.fail(&[shape], &failure),
        }
    }

    fn fail(&self, shapes: &[&Shape], failure: &Failure) {
        for shape in shapes {
            // Only inserts happen under this lock, and they do not panic.
            if let Ok(mut failures) = self.failures.lock() {
                failures.insert(shape.identity(), failure.clone());
            }
            self.progress.advance();
        }
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
